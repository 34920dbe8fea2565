"""A subplot as plain meshes, collected from its effects and things."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.export.copies import Copies, chosen_levels
from pvibr.export.paint import Paint
from pvibr.export.props import copied, range_teller
from pvibr.export.strokes import add_strokes
from pvibr.export.surfaces import Surface, surface_of_part, tiled
from pvibr.gl.scene_pass import is_marker
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts
from pvibr.projection.silhouette_lines import silhouette_lines

_SURFACE = 2  # VTK_SURFACE
#: Offset of lines from their surface toward the eye, as a fraction of the distance.
_BEFORE = 2e-3
#: Radius of the sky dome in radii of the sphere around the scene and the eye, and its sides.
_DOME, _DOME_SIDES = 4.0, 96
SKY = 'sky'
#: How lines and the sky are added.
_UNLIT = {'lighting': False, 'reset_camera': False, 'render': False, 'copy_mesh': False}


class BakedScene:
    """Plain meshes, lines and a sky in place of a subplot's effects and things."""

    def __init__(self, frame, *, triangles, detail, texels):
        self.frame = frame
        self.triangles, self.detail, self.texels = triangles, detail, texels
        self.dropped: dict[str, int] = {}
        #: Whether lights must stop following the camera, since their shadows are baked.
        self.lights_stand = False
        self._pieces: list = []
        self._cards: list[Surface] = []
        self._groups: list[Copies] = []
        self._requests: list = []
        self._lines: list = []
        self._strokes: list = []
        self._dome: Callable | None = None

    # -- called by effects and things ----------------------------------------------------------

    def part(self, owner, part, *, color=None, multiply=False):
        """Add one mesh, in world space."""
        self._pieces.append((owner, part, color, multiply))

    def copies(
        self, owner, levels, poses, *, largest=None, colors=None, multiply=False, scales=None
    ):
        """Add many copies of a mesh."""
        if len(poses) and any(part.mesh.n_cells for part in levels[0]):
            largest = largest or (np.inf, *[0.0] * (len(levels) - 1))
            matrices = _matrices(np.asarray(poses, float), scales)
            levels = [list(level) for level in levels]
            self._groups.append(Copies(owner, levels, largest, matrices, colors, multiply))

    def strokes(self, parts, poses, *, colors=None):
        """Add the lines and vertices of many copies of a mesh."""
        matrices = _matrices(np.asarray(poses, float), None)
        self._strokes += [(part, matrices, colors) for part in parts if len(part.strokes)]

    def quads(self, owner, corners, coordinates, image, *, colors, lighting, cutout):
        """Add rectangles with an image."""
        count = len(corners)
        if not count:
            return
        material = pv.Property(color='white', lighting=lighting, interpolation='Phong')
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        normals = unit_vectors(across)
        faces = 4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
        made = Surface(
            corners.reshape(-1, 3),
            faces.reshape(-1, 3),
            normals.repeat(4, 0),
            coordinates.reshape(-1, 2),
            colors.repeat(4, 0),
            image,
            material,
            owner,
            cutout=cutout,
            repeat=False,
        )
        self._cards.append(made)

    def shadow(self, casts, receives, casting, strength, extents=None):
        """Add shadows of casters on receivers; see `Paint.shadow`."""
        self.lights_stand = True
        self._requests.append(
            lambda paint: paint.shadow(
                chosen(casts),
                chosen(receives),
                casting,
                strength,
                self._sized(extents) if extents else None,
            )
        )

    def drape(self, draped, *, mode, lit, dim, receives, casts):
        """Add projected images; see `Paint.drape`."""
        self._requests.append(
            lambda paint: paint.drape(draped, mode, lit, dim, chosen(receives), chosen(casts))
        )

    def lines(self, owners, *, color, width, opacity, crease):
        """Add silhouettes, borders and creases as lines."""
        self._lines.append((chosen(owners), color, width, opacity, crease))

    def dome(self, color_of):
        """Add a sky dome with the colours of view directions."""
        self._dome = color_of

    # -- the result ----------------------------------------------------------------------------

    def add_to(self, plotter, props):
        """Add everything to the active subplot of a plotter."""
        plain = [_Plain(name, p) for name, p in props if p.GetVisibility() and not is_marker(p)]
        own = self._own()
        needs = bool(self._requests or self._lines)
        surfaces = [s for p in plain for s in p.surfaces(needs)] + own
        if surfaces and self._requests:
            own = self._painted(surfaces, plain, own)
        for one in plain:
            one.add_to(plotter)
        for surface in sorted(own, key=_last_if_cut):
            surface.add_to(plotter)
        self._add_lines(plotter, surfaces)
        for strokes in self._strokes:
            add_strokes(plotter, *strokes)
        self._add_dome(plotter)

    def _painted(self, surfaces, plain, own):
        options = {'detail': self.detail, 'texels': self.texels, 'most': self.triangles}
        paint = Paint(self.frame, surfaces, **options)
        for request in self._requests:
            request(paint)
        for one in plain:
            one.paint(paint)
        return [paint.painted(s) for s in own]

    def _own(self) -> list[Surface]:
        """Return the surfaces of things, within the triangle budget."""
        cards = sum(len(s.faces) for s in self._cards)
        most = max(self.triangles - cards, 0)
        pieces = _within(self._pieces, most)
        parts = [_colored(*piece) for piece in pieces]
        most -= sum(len(s.faces) for s in parts)
        levels = chosen_levels(self._groups, self.frame, max(most, 0))
        for group, level in zip(self._groups, levels, strict=True):
            left_out = int((level < 0).sum())
            if left_out:
                name = group.owner.name
                self.dropped[name] = self.dropped.get(name, 0) + left_out
            parts += group.surfaces(level)
        return [left for s in parts + self._cards if (left := _cut(s)) is not None]

    def _sized(self, extents):
        """Return a function for the extent of a light, given its distance from the scene."""

        def size(light):
            bounds = np.reshape(self.frame.renderer.ComputeVisiblePropBounds(), (3, 2))
            return extents(light, float(np.linalg.norm(bounds.mean(1) - light.position)))

        return size

    def _add_lines(self, plotter, surfaces):
        for mine, color, width, opacity, crease in self._lines:
            found = [_outlined(s, self.frame, crease) for s in surfaces if mine(s)]
            if not any(lines.n_cells for lines in found):
                continue
            lines = _joined(found)
            lines.points = _before(self.frame, np.asarray(lines.points, float))
            look = {'color': color, 'line_width': width, 'opacity': opacity}
            plotter.add_mesh(lines, **look, **_UNLIT)

    def _add_dome(self, plotter):
        if self._dome is None:
            return
        bounds = np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
        seen = bounds[0, 0] <= bounds[0, 1]
        middle = bounds.mean(1) if seen else self.frame.eye
        reach = np.linalg.norm(np.ptp(bounds, axis=1)) / 2 if seen else 1.0
        radius = _DOME * max(reach, np.linalg.norm(self.frame.eye - middle))
        ball = pv.Sphere(radius=1.0, theta_resolution=2 * _DOME_SIDES, phi_resolution=_DOME_SIDES)
        points = np.asarray(ball.points, float) * radius + middle
        away = points - self.frame.eye  # from the eye: the sky is infinitely far
        directions = unit_vectors(away)
        colors = np.rint(255 * np.clip(self._dome(directions), 0, 1)).astype(np.uint8)
        dome = pv.PolyData.from_regular_faces(points, np.asarray(ball.regular_faces)[:, ::-1])
        dome['colors'] = colors
        look = {'scalars': 'colors', 'rgb': True, 'culling': 'back'}
        plotter.add_mesh(dome, name=SKY, pickable=False, **look, **_UNLIT)


class _Plain:
    """A prop of the subplot, kept as it is or replaced by recoloured surfaces."""

    def __init__(self, name, prop):
        self.name, self.prop = name, prop
        self.found: list[Surface] = []
        self._changed = False

    def surfaces(self, needed) -> list[Surface]:
        """Return its surfaces, if any are needed."""
        if needed and _has_surface(self.prop):
            try:
                parts = as_parts(self.prop)
            except (TypeError, ValueError):
                return []
            self.found = [surface_of_part(part, self.prop) for part in parts]
            for surface in self.found:
                surface.name = self.name if len(parts) == 1 else ''
        return self.found

    def paint(self, paint):
        """Recolour its surfaces."""
        painted = [paint.painted(s) for s in self.found]
        self._changed = any(a is not b for a, b in zip(painted, self.found, strict=True))
        self.found = painted

    def add_to(self, plotter):
        """Add it to a plotter."""
        if self._changed:
            for surface in self.found:
                surface.add_to(plotter)
            return
        prop = copied(self.prop, plotter)
        if prop is not None:
            quiet = {'reset_camera': False, 'render': False}
            pickable = bool(self.prop.GetPickable())
            if prop.IsA('vtkScalarBarActor'):  # vtk.js reads the range as it draws the bar
                plotter.add_actor(range_teller(prop), **quiet)
            plotter.add_actor(prop, name=self.name, pickable=pickable, **quiet)


def chosen(choice):
    """Return a predicate of surfaces for a choice of actors or things, None for all."""
    if choice is None:
        return lambda surface: True
    if callable(choice):
        return lambda surface: bool(choice(surface.owner))
    wanted = {address(one) for one in choice}
    return lambda surface: address(surface.owner) in wanted


def names_of(renderer) -> dict:
    """Return the names of a renderer's actors by address."""
    actors = getattr(renderer, 'actors', None)
    return {address(a): n for n, a in actors.items()} if isinstance(actors, dict) else {}


def _has_surface(prop) -> bool:
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return False
    if prop.IsA('vtkSkybox') or prop.IsA('vtkCubeAxesActor') or prop.IsA('vtkAxesActor'):
        return False
    return prop.GetProperty().GetRepresentation() == _SURFACE


def _last_if_cut(surface) -> bool:
    return surface.cutout is not None  # soft edges blend with what is drawn before


def _matrices(poses, scales):
    matrices = poses if poses.ndim == 3 else np.tile(np.eye(4), (len(poses), 1, 1))
    if poses.ndim == 2:
        matrices[:, :3, 3] = poses
    if scales is not None:
        matrices = matrices.copy()
        matrices[:, :3, :3] *= np.asarray(scales, float)[:, None, None]
    return matrices


def _within(pieces, most):
    """Return pieces, decimated if possible to fit a total number of triangles."""
    total = sum(part.mesh.n_cells for _, part, *_ in pieces)
    if total <= most:
        return pieces
    share = max(most / total, 1e-3)
    return [(owner, lighter(part, share) or part, *rest) for owner, part, *rest in pieces]


def _colored(owner, part, color, multiply) -> Surface:
    surface = surface_of_part(part, owner)
    if color is None:
        return surface
    return tiled(surface, np.eye(4)[None], np.asarray(color)[None], multiply)


def _cut(surface) -> Surface | None:
    """Return what the clipping planes of its owner leave of a surface."""
    mapper = getattr(surface.owner, 'mapper', None)
    planes = None if mapper is None else mapper.GetClippingPlanes()
    return surface.clipped(planes) if planes is not None and len(list(planes)) else surface


def _outlined(surface, frame, crease):
    camera = frame.renderer.GetActiveCamera()
    size = tuple(int(n) for n in frame.whole)
    if surface.cutout is not None:
        return pv.PolyData()  # its outline is in its image
    mesh = surface.mesh()
    found = [silhouette_lines(mesh, camera, hidden=True, size=size)]
    if crease is not None and surface.normals is None:
        creases = mesh.clean().extract_feature_edges(
            crease, boundary_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        creases.clear_data()
        found.append(creases)
    return _joined(found)


def _joined(meshes):
    found = [mesh for mesh in meshes if mesh.n_cells]
    return found[0].append_polydata(*found[1:]) if len(found) > 1 else (*found, pv.PolyData())[0]


def _before(frame, points):
    """Return points moved slightly toward the eye, in front of their surfaces."""
    if not frame.parallel:
        return points + _BEFORE * (frame.eye - points)
    away = -(points @ frame.view_from_world[2, :3] + frame.view_from_world[2, 3])
    return points + _BEFORE * away[:, None] * frame.view_from_world[2, :3]
