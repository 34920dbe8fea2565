"""A subplot as plain meshes, collected from effects and things."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.export.copies import Copies, chosen_levels
from pvibr.export.drawn_surfaces import Surface, surface_of_part, tiled
from pvibr.export.paint import Paint
from pvibr.export.props import copied, range_teller
from pvibr.export.strokes import add_strokes
from pvibr.gl.scene_pass import is_marker
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts
from pvibr.visibility.silhouette_lines import silhouette_lines

_SURFACE = 2  # VTK_SURFACE
#: Radius of the sky dome, in radii of a sphere around scene and eye; its sides.
_DOME, _DOME_SIDES = 4.0, 96
SKY = 'sky'
#: Options of lines and the sky.
_UNLIT = {'lighting': False, 'reset_camera': False, 'render': False, 'copy_mesh': False}


class BakedScene:
    """Plain meshes, lines and a sky in place of a subplot's effects and things."""

    def __init__(self, frame, *, triangles, detail, texels, make_cloud):
        self.frame = frame
        self.triangles, self.detail, self.texels = triangles, detail, texels
        self._make_cloud = make_cloud
        self.dropped: dict[str, int] = {}
        #: Whether lights must not follow the camera, since shadows are baked.
        self.lights_stand = False
        self._pieces: list = []
        self._cards: list[Surface] = []
        self._copy_groups: list[Copies] = []
        self._paint_requests: list = []
        self._lines: list = []
        self._strokes: list = []
        self._dome_colors: Callable | None = None

    def part(self, owner, part, *, color=None, multiply=False):
        """Add one mesh, in world space."""
        self._pieces.append((owner, part, color, multiply))

    def copies(self, owner, levels, poses, *, largest=None, colors=None, multiply=False):
        """Add many copies of a mesh."""
        if len(poses) and any(part.mesh.n_cells for part in levels[0]):
            largest = largest or (np.inf, *[0.0] * (len(levels) - 1))
            matrices = _matrices(poses)
            levels = [list(level) for level in levels]
            self._copy_groups.append(Copies(owner, levels, largest, matrices, colors, multiply))

    def strokes(self, parts, poses, *, colors=None):
        """Add the lines and vertices of many copies of a mesh."""
        matrices = _matrices(poses)
        self._strokes += [(part, matrices, colors) for part in parts if len(part.strokes)]

    def quads(self, owner, corners, coordinates, image, *, colors, lighting, cutout):
        """Add textured rectangles."""
        quad_count = len(corners)
        if not quad_count:
            return
        material = pv.Property(color='white', lighting=lighting, interpolation='Phong')
        quad_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        normals = unit_vectors(quad_normals)
        faces = 4 * np.arange(quad_count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
        surface = Surface(
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
        self._cards.append(surface)

    def shadow(self, casts, receives, casting, strength, extents=None):
        """Add shadows of casters on receivers; see `Paint.shadow`."""
        self.lights_stand = True
        self._paint_requests.append(
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
        self._paint_requests.append(
            lambda paint: paint.drape(draped, mode, lit, dim, chosen(receives), chosen(casts))
        )

    def lines(self, owners, *, color, width, opacity, crease):
        """Add silhouettes, borders and creases as lines."""
        self._lines.append((chosen(owners), color, width, opacity, crease))

    def dome(self, color_of):
        """Add a sky dome with the colours of view directions."""
        self._dome_colors = color_of

    def add_to(self, plotter, props):
        """Add everything to the active subplot of a plotter."""
        visible = [(name, p) for name, p in props if p.GetVisibility() and not is_marker(p)]
        plain_props = [_Plain(name, prop) for name, prop in visible]
        thing_surfaces = self._thing_surfaces()
        needs_surfaces = bool(self._paint_requests or self._lines)
        surfaces = [s for p in plain_props for s in p.surfaces(needs_surfaces)] + thing_surfaces
        if surfaces and self._paint_requests:
            thing_surfaces = self._painted(surfaces, plain_props, thing_surfaces)
        for prop in plain_props:
            prop.add_to(plotter)
        # Cut ones last: their soft edges blend with earlier surfaces.
        for surface in sorted(thing_surfaces, key=lambda s: s.cutout is not None):
            surface.add_to(plotter)
        self._add_lines(plotter, surfaces)
        for strokes in self._strokes:
            add_strokes(plotter, *strokes)
        self._add_dome(plotter)

    def _painted(self, surfaces, plain_props, thing_surfaces):
        paint_options = {'detail': self.detail, 'texels': self.texels, 'most': self.triangles}
        paint = Paint(self.frame, surfaces, **paint_options)
        for request in self._paint_requests:
            request(paint)
        for prop in plain_props:
            prop.paint(paint)
        return [paint.painted(s) for s in thing_surfaces]

    def _thing_surfaces(self) -> list[Surface]:
        """Return the surfaces of things, within the triangle budget."""
        card_count = sum(len(s.faces) for s in self._cards)
        max_triangles = max(self.triangles - card_count, 0)
        light_pieces = _within(self._pieces, max_triangles)
        thing_surfaces = [_colored(*piece) for piece in light_pieces]
        max_triangles -= sum(len(s.faces) for s in thing_surfaces)
        levels = chosen_levels(
            self._copy_groups, self.frame, max(max_triangles, 0), self._make_cloud
        )
        for group, level in zip(self._copy_groups, levels, strict=True):
            left_out = int((level < 0).sum())
            if left_out:
                name = group.owner.name
                self.dropped[name] = self.dropped.get(name, 0) + left_out
            thing_surfaces += group.surfaces(level)
        return [inside for s in thing_surfaces + self._cards if (inside := _cut(s)) is not None]

    def _sized(self, extents):
        """Return the extents of lights as a function of the light alone."""

        def size(light):
            bounds = np.reshape(self.frame.renderer.ComputeVisiblePropBounds(), (3, 2))
            return extents(light, float(np.linalg.norm(bounds.mean(1) - light.position)))

        return size

    def _add_lines(self, plotter, surfaces):
        for is_outlined, color, width, opacity, crease in self._lines:
            lines = _joined([_outlined(s, self.frame, crease) for s in surfaces if is_outlined(s)])
            if not lines.n_cells:
                continue
            lines.points = self.frame.before(np.asarray(lines.points, float))
            line_look = {'color': color, 'line_width': width, 'opacity': opacity}
            plotter.add_mesh(lines, **line_look, **_UNLIT)

    def _add_dome(self, plotter):
        if self._dome_colors is None:
            return
        bounds = np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
        is_empty = bounds[0, 0] > bounds[0, 1]
        scene_center = self.frame.eye if is_empty else bounds.mean(1)
        scene_radius = 1.0 if is_empty else np.linalg.norm(np.ptp(bounds, axis=1)) / 2
        dome_radius = _DOME * max(scene_radius, np.linalg.norm(self.frame.eye - scene_center))
        ball = pv.Sphere(radius=1.0, theta_resolution=2 * _DOME_SIDES, phi_resolution=_DOME_SIDES)
        points = np.asarray(ball.points, float) * dome_radius + scene_center
        directions = unit_vectors(points - self.frame.eye)  # the sky is infinitely far away
        colors = np.rint(255 * np.clip(self._dome_colors(directions), 0, 1)).astype(np.uint8)
        dome = pv.PolyData.from_regular_faces(points, np.asarray(ball.regular_faces)[:, ::-1])
        dome['colors'] = colors
        dome_look = {'scalars': 'colors', 'rgb': True, 'culling': 'back'}
        plotter.add_mesh(dome, name=SKY, pickable=False, **dome_look, **_UNLIT)


class _Plain:
    """A prop of the subplot, copied or replaced by recoloured surfaces."""

    def __init__(self, name, prop):
        self.name, self.prop = name, prop
        self.baked_surfaces: list[Surface] = []
        self._changed = False

    def surfaces(self, is_needed) -> list[Surface]:
        """Return its surfaces if they are needed."""
        if is_needed and _has_surface(self.prop):
            try:
                parts = as_parts(self.prop)
            except (TypeError, ValueError):
                return []
            self.baked_surfaces = [surface_of_part(part, self.prop) for part in parts]
            for surface in self.baked_surfaces:
                surface.name = self.name if len(parts) == 1 else ''
        return self.baked_surfaces

    def paint(self, paint):
        """Recolour its surfaces."""
        painted = [paint.painted(s) for s in self.baked_surfaces]
        self._changed = any(a is not b for a, b in zip(painted, self.baked_surfaces, strict=True))
        self.baked_surfaces = painted

    def add_to(self, plotter):
        """Add it to a plotter."""
        if self._changed:
            for surface in self.baked_surfaces:
                surface.add_to(plotter)
            return
        prop = copied(self.prop, plotter)
        if prop is not None:
            quiet_options = {'reset_camera': False, 'render': False}
            pickable = bool(self.prop.GetPickable())
            if prop.IsA('vtkScalarBarActor'):  # vtk.js reads the range as it draws the bar
                plotter.add_actor(range_teller(prop), **quiet_options)
            plotter.add_actor(prop, name=self.name, pickable=pickable, **quiet_options)


def chosen(choice):
    """Return a predicate of surfaces for a choice of actors or things; None is all."""
    if choice is None:
        return lambda surface: True
    if callable(choice):
        return lambda surface: bool(choice(surface.owner))
    owners = {address(item) for item in choice}
    return lambda surface: address(surface.owner) in owners


def _has_surface(prop) -> bool:
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return False
    if prop.IsA('vtkSkybox') or prop.IsA('vtkCubeAxesActor') or prop.IsA('vtkAxesActor'):
        return False
    return prop.GetProperty().GetRepresentation() == _SURFACE


def _matrices(poses):
    """Return the matrices of poses, points or matrices."""
    poses = np.asarray(poses, float)
    matrices = poses if poses.ndim == 3 else np.tile(np.eye(4), (len(poses), 1, 1))
    if poses.ndim == 2:
        matrices[:, :3, 3] = poses
    return matrices


def _within(pieces, max_triangles):
    """Return pieces, decimated where possible to a total number of triangles."""
    triangle_total = sum(part.mesh.n_cells for _, part, *_ in pieces)
    if triangle_total <= max_triangles:
        return pieces
    kept_share = max(max_triangles / triangle_total, 1e-3)
    return [(owner, lighter(part, kept_share) or part, *rest) for owner, part, *rest in pieces]


def _colored(owner, part, color, multiply) -> Surface:
    surface = surface_of_part(part, owner)
    if color is None:
        return surface
    return tiled(surface, np.eye(4)[None], np.asarray(color)[None], multiply)


def _cut(surface) -> Surface | None:
    """Return the part of a surface inside its owner's clipping planes, or None."""
    mapper = getattr(surface.owner, 'mapper', None)
    clipping_planes = None if mapper is None else mapper.GetClippingPlanes()
    return surface.clipped(clipping_planes) if list(clipping_planes or ()) else surface


def _outlined(surface, frame, crease):
    camera = frame.renderer.GetActiveCamera()
    size = tuple(int(n) for n in frame.whole)
    if surface.cutout is not None:
        return pv.PolyData()  # its outline is in its image
    mesh = surface.mesh()
    outlines = [silhouette_lines(mesh, camera, hidden=True, size=size)]
    if crease is not None and surface.normals is None:
        creases = mesh.clean().extract_feature_edges(
            crease, boundary_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        creases.clear_data()
        outlines.append(creases)
    return _joined(outlines)


def _joined(meshes):
    meshes = [mesh for mesh in meshes if mesh.n_cells] or [pv.PolyData()]
    return meshes[0].append_polydata(*meshes[1:]) if len(meshes) > 1 else meshes[0]
