"""Billboard clouds: a mesh as a few textured rectangles, with bounded displacement."""

from __future__ import annotations

import io
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.core.arguments import check_one_of, checked_number, checked_whole
from pvibr.core.files import replacing
from pvibr.gl import shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.io.glb_writer import CLAMPED, GlbWriter
from pvibr.meshes.parts import as_parts, check_triangles
from pvibr.substitutes.cloud_coverage import Triangles, coverage_errors, joined
from pvibr.substitutes.cloud_maths import Planes, greedy_planes, kmeans_planes
from pvibr.substitutes.cloud_patches import NO_PATCHES, closing_patches
from pvibr.substitutes.cloud_texture import arranged, draw, opaque_texels

_APART = 0.01  # offset of the images of two sides from their plane, over the bound
_NEAR = 0.25  # distance of other triangles drawn onto a plane against gaps, over the bound
_BOTH = 0.1  # least share of a plane's area that faces each way for two sides


@dataclass(frozen=True, eq=False)
class BillboardCloud:
    """The textured rectangles of a mesh, with their error.

    Attributes
    ----------
    mesh : pyvista.PolyData
        A quadrilateral per plane, or per side if these differ, with texture coordinates, normals,
        tangents, and the index of its ``'plane'``.
    texture : pyvista.Texture
        Unlit colours; alpha is 0 or 255.
    normal_texture : pyvista.Texture
        Normals in tangent space: red along the tangent, green up, blue out of the plane.
    planes : pvibr.substitutes.cloud_maths.Planes
        The planes, and that of each triangle.
    epsilon : float or None
        Maximum displacement allowed, world units; None if the number of planes was set.
    displacement : float
        Maximum displacement of a vertex, world units.
    holes : float
        Share of pixels inside the mesh's outline that show none of the cloud, over all views.
    normal_error : float
        Mean angle between the normals of mesh and cloud, degrees.
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
        """Add the cloud to a plotter, alpha-tested and lit by its normal map.

        Parameters
        ----------
        plotter : pyvista.Plotter
            Plotter to add to.
        lighting : bool, optional
            Apply lighting.
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
            color.SetUseSRGBColorSpace(True)  # required by VTK's PBR
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
        """Write the cloud to a file.

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
            If the suffix is neither.
        OSError
            If a file cannot be written; files are replaced atomically.
        """
        path = Path(path).expanduser()
        writers = {'.glb': write_glb, '.obj': write_obj}
        if path.suffix.lower() not in writers:
            raise ValueError(f'path must end in .glb or .obj, got {str(path)!r}')
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
    """Return a mesh as a few textured rectangles that any viewer shows.

    Decoret, Durand, Sillion and Dorsey, "Billboard Clouds for Extreme Model Simplification",
    SIGGRAPH 2003. Triangles very near another plane are drawn onto it as well, against gaps. Gaps
    that remain in 52 views are closed by triangles of the simplified mesh, unless it has alpha.
    """
    _check(epsilon, planes, size, supersample)
    start = time.perf_counter()
    parts = as_parts(mesh, **looks)
    check_triangles(parts)
    points, faces = joined(parts, 0.0)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not diagonal > 0:
        raise ValueError('mesh must have a size, got points that all coincide')
    # Relative to the mean, for precision far from the origin.
    origin = points.mean(0)
    local = points - origin
    error_bound = None if planes is not None else epsilon * diagonal
    side_offset = _APART * (1e-2 * diagonal if error_bound is None else error_bound)
    if error_bound is None:
        cloud_planes = kmeans_planes(local, faces, planes, seed=seed)
    else:
        cloud_planes = greedy_planes(local, faces, error_bound - side_offset)
    solid = np.concatenate([np.full(p.mesh.n_cells, p.alpha_cutoff is None) for p in parts])
    side_planes, plane_of_side = _sides(cloud_planes, local, faces, solid, side_offset)
    displacements = side_planes.displacements(local, faces).max(1)
    reach = _NEAR * _reach(side_planes, displacements, error_bound)
    closing = NO_PATCHES
    if patches and error_bound is not None:
        sheet = arranged(side_planes, local, faces, int(size))
        opaque = opaque_texels(parts, origin, side_planes, sheet, reach)
        closing = closing_patches(parts, origin, sheet, opaque, error_bound)
    all_planes = _with_patches(side_planes, closing)
    points, faces = joined([*parts, *closing.parts], origin)
    sheet = arranged(all_planes, points, faces, int(size))
    color, normal = draw(parts, closing.parts, origin, all_planes, sheet, reach, supersample)
    opaque = color[::-1, :, 3] > 0
    count = len(side_planes)
    holes, normal_error = _errors(parts, closing, origin, sheet, count, opaque, normal)
    normals, offsets = cloud_planes.normals, cloud_planes.offsets
    texel_counts = sheet.texels.prod(1)
    return BillboardCloud(
        _mesh(sheet, origin, plane_of_side, closing),
        pv.Texture(color),
        pv.Texture(normal),
        Planes(normals, offsets + normals @ origin, cloud_planes.owner),
        error_bound,
        float(displacements.max()),
        holes,
        normal_error,
        len(closing.planes.owner),
        float(_opaque_count(opaque, sheet, count) / texel_counts[:count].sum()),
        int(texel_counts.sum()) / size**2,
        time.perf_counter() - start,
    )


def _errors(parts, closing, origin, sheet, count, opaque, normal):
    """Return the share of holes, and the mean error of normals in degrees."""
    triangles, patches = Triangles.of(parts, origin), Triangles.of(closing.parts, origin)
    owner, normals = closing.planes.owner + count, normal[::-1] / 127.5 - 1
    return coverage_errors(triangles, patches, owner, sheet, count, opaque, normals)


def _reach(planes, displacements, bound):
    """Return the greatest displacement of each plane."""
    reach = np.full(len(planes), bound or 0.0)
    if bound is None:
        np.maximum.at(reach, planes.owner, displacements)
    return reach


def _opaque_count(opaque, sheet, count):
    """Return the number of opaque texels in the first rectangles."""
    rectangles = zip(sheet.corners[:count], sheet.texels[:count], strict=True)
    return sum(opaque[y : y + h, x : x + w].sum() for (x, y), (w, h) in rectangles)


def _with_patches(sides, patches):
    """Return planes of sides, then of patches."""
    patch_planes = patches.planes
    return Planes(
        np.concatenate([sides.normals, patch_planes.normals]),
        np.concatenate([sides.offsets, patch_planes.offsets]),
        np.concatenate([sides.owner, patch_planes.owner + len(sides)]),
    )


def _check(epsilon, planes, size, supersample):
    if planes is None:
        checked_number('epsilon', epsilon, 1e-4, 1)
    else:
        checked_whole('planes', planes, 1, np.inf)
    checked_whole('size', size, 16, 8192)
    check_one_of('supersample', supersample, (1, 2, 4, 8))


def _sides(planes, points, faces, solid, side_offset):
    """Return a plane for each visible side, and the index of its original."""
    a, b, c = points[faces].transpose(1, 0, 2)
    area = (np.cross(b - a, c - a) * planes.normals[planes.owner]).sum(1)
    count = len(planes)
    front_area, back_area = (
        np.bincount(planes.owner, np.maximum(sign * area, 0) * solid, count) for sign in (1, -1)
    )
    total_area = np.maximum(np.bincount(planes.owner, np.abs(area), count), 1e-300)
    flip_per_plane = np.where(back_area > front_area, -1.0, 1.0)
    normals, offsets = planes.normals * flip_per_plane[:, None], planes.offsets * flip_per_plane
    two_sided = np.flatnonzero(np.minimum(front_area, back_area) > _BOTH * total_area)
    offsets[two_sided] += side_offset
    second_side = np.full(count, -1)
    second_side[two_sided] = count + np.arange(len(two_sided))
    is_behind = (area * flip_per_plane[planes.owner] < 0) & (second_side[planes.owner] >= 0)
    owner = np.where(is_behind, second_side[planes.owner], planes.owner)
    normals = np.concatenate([normals, -normals[two_sided]])
    offsets = np.concatenate([offsets, 2 * side_offset - offsets[two_sided]])
    return Planes(normals, offsets, owner), np.concatenate([np.arange(count), two_sided])


def _mesh(sheet, origin, plane_of_side, patches):
    """Return a quadrilateral per side, then the triangles of patches."""
    count = len(plane_of_side)
    points, coordinates = (a[:count].reshape(-1, a.shape[-1]) for a in sheet.quads())
    axes = sheet.axes[:count].repeat(4, 0)
    cells = [np.insert(np.arange(4 * count).reshape(-1, 4), 0, 4, axis=1).ravel()]
    if patches.parts:
        patch_points, faces = joined(patches.parts, origin)
        patch_points, owner = patch_points[faces.ravel()], patches.planes.owner.repeat(3) + count
        corners = np.arange(4 * count, 4 * count + len(patch_points)).reshape(-1, 3)
        cells.append(np.insert(corners, 0, 3, axis=1).ravel())
        points = np.concatenate([points, patch_points])
        patch_coordinates = sheet.flattened(patch_points, owner)[:, :2] / sheet.side
        coordinates = np.concatenate([coordinates, patch_coordinates])
        axes = np.concatenate([axes, sheet.axes[owner]])
    mesh = pv.PolyData()
    mesh.points = points + origin
    mesh.faces = np.concatenate(cells)
    mesh.active_texture_coordinates = coordinates.astype(np.float32)
    mesh.point_data.active_normals = axes[:, 2].astype(np.float32)
    mesh.point_data['Tangents'] = axes[:, 0].astype(np.float32)
    mesh.GetPointData().SetTangents(mesh.GetPointData().GetArray('Tangents'))
    patch_labels = np.full(mesh.n_cells - count, -1)
    mesh.cell_data['plane'] = np.concatenate([plane_of_side, patch_labels])
    mesh.set_active_scalars(None)
    return mesh


_CUTOFF = 0.5


def write_glb(cloud, path):
    """Write a cloud as binary glTF 2.0."""
    glb, mesh = GlbWriter(), cloud.mesh
    middle = np.asarray(mesh.center)
    tangents = np.asarray(mesh.point_data['Tangents'])
    color, normal = (
        glb.texture(texture.to_array(), CLAMPED, optimize=True)
        for texture in (cloud.texture, cloud.normal_texture)
    )
    reflection = {
        'baseColorTexture': {'index': color},
        'metallicFactor': 0.0,
        'roughnessFactor': 1.0,
    }
    primitive = glb.primitive(
        np.asarray(mesh.points, float) - middle,
        mesh.triangulate().regular_faces,
        normals=mesh.point_data.active_normals,
        coordinates=np.asarray(mesh.active_texture_coordinates),
        TANGENT=np.column_stack([tangents, np.ones(len(tangents))]),
    )
    primitive['material'] = glb.material(
        reflection, normalTexture={'index': normal}, cutoff=_CUTOFF, two_sided=True
    )
    number = glb.add('meshes', {'primitives': [primitive]})
    glb.scene([glb.add('nodes', {'mesh': number, 'translation': middle.tolist()})])
    glb.write(path)
    return [path]


def _png(texture):
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(texture.to_array())).save(stream, 'PNG', optimize=True)
    return stream.getvalue()


def write_obj(cloud, path):
    """Write a cloud as OBJ, with material and two images beside it."""
    stem = path.stem.replace(' ', '_')  # OBJ names end at a space
    material, color = path.with_name(f'{stem}.mtl'), path.with_name(f'{stem}.png')
    normal = path.with_name(f'{stem}_normals.png')
    looks = (
        'newmtl cloud\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\n'
        f'map_Kd {color.name}\nmap_d -imfchan m {color.name}\nnorm {normal.name}\n'
    )
    mesh = cloud.mesh
    lines = [f'mtllib {material.name}', 'usemtl cloud']
    for key, rows in (
        ('v', np.asarray(mesh.points, float)),
        ('vt', np.asarray(mesh.active_texture_coordinates, float)),
        ('vn', np.asarray(mesh.point_data.active_normals, float)),
    ):
        lines += [' '.join([key, *(f'{x:.9g}' for x in row)]) for row in rows.tolist()]
    lines += [
        'f ' + ' '.join(f'{i}/{i}/{i}' for i in row)
        for row in (mesh.triangulate().regular_faces + 1).tolist()
    ]
    shape = '\n'.join(lines) + '\n'
    # The mesh last, as it refers to the others.
    for file, content in (
        (color, _png(cloud.texture)),
        (normal, _png(cloud.normal_texture)),
        (material, looks.encode()),
        (path, shape.encode()),
    ):
        with replacing(file) as part:
            part.write_bytes(content)
    return [path, material, color, normal]
