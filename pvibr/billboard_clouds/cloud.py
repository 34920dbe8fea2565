"""Billboard clouds: a mesh as a few textured rectangles, with bounded displacement."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.billboard_clouds.coverage import Triangles, coverage_errors, joined
from pvibr.billboard_clouds.patches import NO_PATCHES, closing_patches
from pvibr.billboard_clouds.texture import arranged, draw, opaque_texels
from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.maths.arguments import check_one_of, checked_number, checked_whole
from pvibr.maths.billboard_clouds import Planes, greedy_planes, kmeans_planes
from pvibr.meshes.parts import as_parts, check_triangles

_APART = 0.01  # of the bound: how far pictures of two sides are from their plane
_NEAR = 0.25  # of the bound: what is drawn onto a plane beside what belongs there, against gaps
_BOTH = 0.1  # of the area near a plane that must look each way for it to have two sides


@dataclass(frozen=True, eq=False)
class BillboardCloud:
    """The textured rectangles of a mesh, with their error.

    Attributes
    ----------
    mesh : pyvista.PolyData
        A quadrilateral per plane, or per side if both differ, with texture coordinates, normals,
        tangents, and the index of its ``'plane'``.
    texture : pyvista.Texture
        Unlit colours; alpha is 0 or 255.
    normal_texture : pyvista.Texture
        Normals in tangent space: red along the tangent, green up, blue out of the plane.
    planes : pvibr.maths.billboard_clouds.Planes
        The planes, and the one that each triangle is on.
    epsilon : float or None
        Maximum displacement allowed, world units; None if the number of planes was given.
    displacement : float
        Maximum displacement of a vertex, world units.
    holes : float
        Share of the pixels inside the mesh's outline that show none of the cloud, from all around.
    normal_error : float
        Mean angle between the normals of both where both are seen, degrees.
    patches : int
        Triangles that close holes between the planes.
    fill : float
        Share of opaque texels in the rectangles.
    packing : float
        Share of the texture covered by rectangles.
    seconds : float
        Computing time.
    """

    mesh: pv.PolyData
    texture: pv.Texture
    normal_texture: pv.Texture
    planes: Planes
    epsilon: float | None
    displacement: float
    holes: float
    normal_error: float
    patches: int
    fill: float
    packing: float
    seconds: float

    def __repr__(self):
        width, height = self.texture.dimensions[:2]
        bound = '' if self.epsilon is None else f' of {self.epsilon:.4g}'
        return (
            f'BillboardCloud: {len(self.planes)} planes for {len(self.planes.owner)} triangles, '
            f'displaced by {self.displacement:.4g}{bound}, {self.patches} triangles in gaps; '
            f'{self.holes:.2%} holes, normals off by {self.normal_error:.0f} degrees; '
            f'texture {width} x {height}, {self.fill:.0%} of the rectangles drawn, '
            f'{self.seconds:.1f} s'
        )

    def add_to(self, plotter, *, lighting=True, **kwargs):
        """Add it to a plotter, alpha-tested, and lit by its normal map.

        Parameters
        ----------
        plotter : pyvista.Plotter
            Plotter to add to.
        lighting : bool, optional
            Light it by its normals.
        **kwargs
            As :meth:`pyvista.Plotter.add_mesh`; with ``pbr=True`` VTK applies the normals.

        Returns
        -------
        pyvista.Actor
            The added actor.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> actor = pv.Cube().ibr.billboard_cloud(epsilon=0.02, size=64).add_to(pl)
        >>> actor.mapper.dataset.n_cells
        6
        """
        if kwargs.get('pbr'):
            actor = plotter.add_mesh(self.mesh, **({'roughness': 1.0} | kwargs))
            color = pv.Texture(self.texture.to_array())
            color.SetUseSRGBColorSpace(True)  # what VTK asks of the colour of such a surface
            actor.prop.SetBaseColorTexture(color)
            actor.prop.SetNormalTexture(self.normal_texture)
            return actor
        kwargs = {'texture': self.texture, 'lighting': lighting, 'smooth_shading': True} | kwargs
        actor = plotter.add_mesh(self.mesh, **kwargs)
        if lighting:
            actor.prop.SetNormalTexture(self.normal_texture)
        text = sections(shader_source(__file__))
        tags = {'VTK::Normal::Impl': 'normal', 'VTK::TCoord::Impl': 'coordinates'}
        fragment = {tag: text[f'fragment.{name}'] for tag, name in tags.items()}
        Feature('cloud', fragment=fragment).attach(actor)
        return actor

    def save(self, path):
        """Write it to a file.

        Parameters
        ----------
        path : str or pathlib.Path
            A ``.glb`` file, or an ``.obj`` file with ``.mtl``, ``.png`` and ``_normals.png``
            beside it.

        Returns
        -------
        list of pathlib.Path
            The written files.

        Raises
        ------
        ValueError
            If the suffix is another.
        OSError
            If a file cannot be written; files are replaced atomically.
        """
        from pvibr.billboard_clouds.files import write_glb, write_obj

        path = Path(path).expanduser()
        writers = {'.glb': write_glb, '.obj': write_obj}
        if path.suffix.lower() not in writers:
            raise ValueError(
                f'path is {str(path)!r}; billboard clouds are written as .glb or .obj.'
            )
        return writers[path.suffix.lower()](self, path)


def billboard_cloud(
    mesh,
    *,
    epsilon=0.02,
    planes=None,
    patches=True,
    size=1024,
    supersample=4,
    seed=0,
    **looks,
) -> BillboardCloud:
    """Return a mesh as few textured rectangles that any viewer shows.

    Decoret, Durand, Sillion and Dorsey, "Billboard Clouds for Extreme Model Simplification",
    SIGGRAPH 2003. Triangles very near a plane are drawn onto it even if another plane has them,
    which closes gaps between planes. What is still seen beside or through them, from 52 sides, is
    closed by triangles of the mesh simplified within half of the bound, if `patches` are allowed
    and there is a bound; foliage and what has an alpha cutoff stay as they are.
    """
    _check(epsilon, planes, size, supersample)
    start = time.perf_counter()
    parts = as_parts(mesh, **looks)
    check_triangles(parts)
    points, faces = joined(parts, 0.0)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not diagonal > 0:
        raise ValueError('mesh has no size: all of its points are in one place.')
    # Near its own origin: far from the world's, little would be left of a small number.
    origin = points.mean(0)
    local = points - origin
    bound = None if planes is not None else epsilon * diagonal
    apart = _APART * (1e-2 * diagonal if bound is None else bound)
    found = _planes(local, faces, planes, bound and bound - apart, seed)
    solid = np.concatenate([np.full(p.mesh.n_cells, p.alpha_cutoff is None) for p in parts])
    sides, which = _sides(found, local, faces, solid, apart)
    away = sides.displacements(local, faces).max(1)
    near = _NEAR * _reach(sides, away, bound)
    rest = NO_PATCHES
    if patches and bound is not None:
        sheet = arranged(sides, local, faces, int(size))
        rest = _closing(parts, origin, sides, sheet, near, bound)
    whole = _with_patches(sides, rest)
    points, faces = joined([*parts, *rest.parts], origin)
    sheet = arranged(whole, points, faces, int(size))
    color, normal = draw(parts, rest.parts, origin, whole, sheet, near, supersample)
    opaque = color[::-1, :, 3] > 0
    holes, turned = _errors(parts, rest, origin, sheet, len(sides), opaque, normal)
    found = Planes(found.normals, found.offsets + found.normals @ origin, found.owner)
    texels = sheet.texels.prod(1)
    return BillboardCloud(
        _mesh(sheet, origin, which, rest),
        pv.Texture(color),
        pv.Texture(normal),
        found,
        bound,
        float(away.max()),
        holes,
        turned,
        len(rest.planes.owner),
        float(_shown(opaque, sheet, len(sides)) / texels[: len(sides)].sum()),
        int(texels.sum()) / size**2,
        time.perf_counter() - start,
    )


def _planes(points, faces, count, bound, seed) -> Planes:
    """Return some planes, or as many as a bound needs."""
    if bound is None:
        return kmeans_planes(points, faces, count, seed=seed)
    return greedy_planes(points, faces, bound)


def _closing(parts, origin, sides, sheet, near, bound):
    """Return what closes the holes between planes."""
    return closing_patches(
        parts, origin, sheet, opaque_texels(parts, origin, sides, sheet, near), bound
    )


def _errors(parts, rest, origin, sheet, count, opaque, normal):
    """Return the share of holes, and the mean angle between normals of mesh and picture."""
    own, closing = Triangles.of(parts, origin), Triangles.of(rest.parts, origin)
    owner = rest.planes.owner + count
    return coverage_errors(own, closing, owner, sheet, count, opaque, normal[::-1] / 127.5 - 1)


def _reach(planes, away, bound):
    """Return the largest displacement that each plane allows."""
    reach = np.full(len(planes), bound or 0.0)
    if bound is None:
        np.maximum.at(reach, planes.owner, away)
    return reach


def _shown(opaque, sheet, count):
    """Return the number of opaque texels of the first rectangles."""
    rows = zip(sheet.corners[:count], sheet.texels[:count], strict=True)
    return sum(opaque[y : y + h, x : x + w].sum() for (x, y), (w, h) in rows)


def _with_patches(sides, patches):
    """Return the planes of both, and those of all triangles, in this order."""
    more = patches.planes
    return Planes(
        np.concatenate([sides.normals, more.normals]),
        np.concatenate([sides.offsets, more.offsets]),
        np.concatenate([sides.owner, more.owner + len(sides)]),
    )


def _check(epsilon, planes, size, supersample):
    if planes is None:
        checked_number('epsilon', epsilon, 1e-4, 1)
    else:
        checked_whole('planes', planes, 1, np.inf)
    checked_whole('size', size, 16, 8192)
    check_one_of('supersample', supersample, (1, 2, 4, 8))


def _sides(planes, points, faces, solid, apart):
    """Return a plane for each visible side, and the index of the given one."""
    a, b, c = points[faces].transpose(1, 0, 2)
    area = (np.cross(b - a, c - a) * planes.normals[planes.owner]).sum(1)
    count = len(planes)
    front, back = (
        np.bincount(planes.owner, np.maximum(sign * area, 0) * solid, count) for sign in (1, -1)
    )
    total = np.maximum(np.bincount(planes.owner, np.abs(area), count), 1e-300)
    turn = np.where(back > front, -1.0, 1.0)
    normals, offsets = planes.normals * turn[:, None], planes.offsets * turn
    two = np.flatnonzero(np.minimum(front, back) > _BOTH * total)
    offsets[two] += apart
    second = np.full(count, -1)
    second[two] = count + np.arange(len(two))
    behind = (area * turn[planes.owner] < 0) & (second[planes.owner] >= 0)
    owner = np.where(behind, second[planes.owner], planes.owner)
    normals = np.concatenate([normals, -normals[two]])
    offsets = np.concatenate([offsets, 2 * apart - offsets[two]])
    return Planes(normals, offsets, owner), np.concatenate([np.arange(count), two])


def _mesh(sheet, origin, which, patches):
    """Return a quadrilateral for each picture, and the triangles of patches."""
    count = len(which)
    points, coordinates = (a[:count].reshape(-1, a.shape[-1]) for a in sheet.quads())
    axes = sheet.axes[:count].repeat(4, 0)
    cells = [np.insert(np.arange(4 * count).reshape(-1, 4), 0, 4, axis=1).ravel()]
    if patches.parts:
        own, faces = joined(patches.parts, origin)
        own, owner = own[faces.ravel()], patches.planes.owner.repeat(3) + count
        corners = np.arange(4 * count, 4 * count + len(own)).reshape(-1, 3)
        cells.append(np.insert(corners, 0, 3, axis=1).ravel())
        points = np.concatenate([points, own])
        places = sheet.flattened(own, owner)[:, :2] / sheet.side
        coordinates = np.concatenate([coordinates, places])
        axes = np.concatenate([axes, sheet.axes[owner]])
    mesh = pv.PolyData()
    mesh.points = points + origin
    mesh.faces = np.concatenate(cells)
    mesh.active_texture_coordinates = coordinates.astype(np.float32)
    mesh.point_data.active_normals = axes[:, 2].astype(np.float32)
    mesh.point_data['Tangents'] = axes[:, 0].astype(np.float32)
    mesh.GetPointData().SetTangents(mesh.GetPointData().GetArray('Tangents'))
    rest = np.full(mesh.n_cells - count, -1)
    mesh.cell_data['plane'] = np.concatenate([which, rest])
    mesh.set_active_scalars(None)
    return mesh
