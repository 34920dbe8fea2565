"""Shadows and projected images baked into colours of surfaces, which are subdivided for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pvibr.export.drawn_surfaces import Surface, albedo_of, material_of
from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.cutting import Cut, edges_of
from pvibr.things.lights import lights_of
from pvibr.visibility.surface_samples import Samples
from pvibr.visibility.unwrap import tiles_of, unwrapped
from pvibr.visibility.visibility import Reach, toward_light

#: Longest edge as a fraction of the scene, and the colour step across shorter edges that splits
#: them.
_COARSE, _STEP = 1 / 64, 6 / 255
_PASSES = 16
_DRAPED = 200_000  # most triangles for projected images as point colours
_DARK = 1e-4  # light below which shadows make no difference
_INWARD = 1e-3  # fraction by which vertices are moved towards their triangle's centre
_TEXELS = 2048  # along a side of a shadow map
_SOFT_TEXELS, _SOFT_SAMPLES = 1024, 16


@dataclass
class Places:
    """Points to colour, with normals and albedo."""

    samples: Samples
    points: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray


class Lamps:
    """A renderer's lights, with the diffuse light that VTK computes."""

    def __init__(self, renderer):
        lights_on = [light for light in renderer.GetLights() if light.GetSwitch()]
        self.lights = lights_of(renderer)
        self.colors = [np.array(i.GetDiffuseColor()) * i.GetIntensity() for i in lights_on]
        self._fades = [(np.array(i.GetAttenuationValues()), i.GetExponent()) for i in lights_on]

    def on(self, number, points, normals) -> np.ndarray:
        """Return one light's diffuse light on points, (n, 3)."""
        light = self.lights[number]
        toward = toward_light(light, points)
        irradiance = np.maximum((toward * normals).sum(1), 0.0)
        if light.positional:
            (constant, linear, square), exponent = self._fades[number]
            distance = np.linalg.norm(points - light.position, axis=1)
            attenuation = constant + linear * distance + square * distance**2
            irradiance /= np.maximum(attenuation, 1e-12)
            if light.kind == 'spot':
                cosine = -toward @ np.array(light.direction)
                in_cone = cosine > np.cos(np.radians(light.cone))
                irradiance *= np.where(in_cone, np.maximum(cosine, 0) ** exponent, 0.0)
        return irradiance[:, None] * self.colors[number]


class Paint:
    """Shadows and projected images on the surfaces of a subplot."""

    def __init__(self, frame, surfaces, *, detail, texels, most):
        self.frame, self.surfaces = frame, surfaces
        self.detail, self.texels, self.max_triangles = detail, texels, most
        all_points = np.concatenate([s.points for s in surfaces])
        self.size = float(np.linalg.norm(np.ptp(all_points, axis=0))) or 1.0
        self.lamps = Lamps(frame.renderer)
        self._shadow_requests: list = []
        self._image_requests: list = []

    def shadow(self, is_caster, is_receiver, light_numbers, strength, extents=None):
        """Add shadows of casters on receivers, from numbered lights."""
        casters = [s.solid() for s in self.surfaces if s.opaque and is_caster(s)]
        lights = [self.lamps.lights[k] for k in light_numbers]
        if extents is None:
            reach = Reach(casters, lights, _TEXELS)
        else:
            light_sizes = [extents(light) for light in lights]
            reach = Reach(casters, lights, _SOFT_TEXELS, _SOFT_SAMPLES, light_sizes)
        number_of = {number: k for k, number in enumerate(light_numbers)}
        self._shadow_requests.append((number_of, reach, strength, is_receiver))

    def drape(self, draped_colors, mode, lit, dim, is_receiver, is_caster):
        """Add projected images."""
        caster_meshes = [s.solid() for s in self.surfaces if s.opaque and is_caster(s)]
        self._image_requests.append((draped_colors, caster_meshes, mode, lit, dim, is_receiver))

    def painted(self, surface) -> Surface:
        """Return a surface with shadows and images in its colours or texture."""
        pictures = [p for p in self._image_requests if p[-1](surface)]
        shadows = self._shadow_requests if surface.material.GetLighting() else ()
        shadows = [s for s in shadows if s[-1](surface)]
        if not pictures and not shadows:
            return surface
        if pictures and self.texels:
            textured = self._with_texture(surface, pictures, shadows)
            if textured is not None:
                return textured
        if surface.normals is None:
            surface = surface.exploded()
            surface.normals = np.repeat(_face_normals(surface), 3, axis=0)
        return self._with_colors(surface, pictures, shadows)

    def _with_colors(self, surface, pictures, shadows):
        base = surface
        if base.colors is None:
            base = replace(base, colors=_bytes(albedo_of(base)))
        max_triangles = self.max_triangles // len(self.surfaces)
        shortest_edge, longest_edge = self.detail * self.size, _COARSE * self.size
        if pictures:  # detail everywhere: split evenly, and sample once
            max_triangles = min(max_triangles, _DRAPED)
            longest_edge = max(shortest_edge, _side(base, max_triangles))
        max_triangles = max(max_triangles, len(base.faces))
        colors, lit = self._colors(_vertices(base, 0), base, pictures, shadows)

        def refined(colors, is_split, passes):
            old_count = len(base.points)
            arrays, faces = cut(base.point_arrays(), base.faces, is_split, max_triangles, passes)
            finer = base.with_arrays(arrays, faces)
            if len(finer.points) == old_count:
                return finer, colors
            new_colors, _ = self._colors(_vertices(finer, old_count), finer, pictures, shadows)
            return finer, np.concatenate([colors, new_colors])

        base, colors = refined(colors, lambda _, length: length > longest_edge, _PASSES)

        def has_changes(ends, length):
            color_step = np.abs(colors[ends[:, 0]] - colors[ends[:, 1]]).max(1)
            return (color_step > _STEP) & (length > shortest_edge)

        for _ in range(0 if pictures else _PASSES):
            old_count = len(colors)
            base, colors = refined(colors, has_changes, 1)
            if len(colors) == old_count:
                break
        return _recolored(replace(base, colors=_bytes(colors)), lit)

    def _with_texture(self, surface, pictures, shadows):
        """Return a surface with its own texture, or None if it cannot be unwrapped."""
        mesh = surface.mesh()
        uv = surface.coordinates
        if uv is not None and (uv.min() < 0 or uv.max() > 1):
            return None
        mesh.point_data['row'] = np.arange(mesh.n_points)
        if uv is not None:
            mesh.active_texture_coordinates = uv
        try:
            flat_mesh = unwrapped(mesh, self.texels)
        except ImportError:
            return None
        arrays = {k: v[_origin(flat_mesh, surface)] for k, v in surface.point_arrays().items()}
        arrays['coordinates'] = np.asarray(flat_mesh.active_texture_coordinates, float)
        unwrapped_surface = surface.with_arrays(arrays, np.asarray(flat_mesh.regular_faces, int))
        (tile,) = tiles_of(flat_mesh, self.texels, self.texels)
        places = _texels(unwrapped_surface, tile.samples(flat_mesh), tile.share, surface.texture)
        colors, lit = self._colors(places, unwrapped_surface, pictures, shadows)
        texture = tile.filled(_bytes(colors), np.ones(len(colors), bool))
        textured = replace(unwrapped_surface, colors=None, texture=texture, repeat=False)
        return _recolored(textured, lit)

    def _colors(self, places, surface, pictures, shadows):
        """Return colours of places, (n, 4), and whether the viewer lights the surface."""
        material = surface.material
        full_light, shadowed = self._light(places, surface, shadows)
        ambient, diffuse = material.GetAmbient(), material.GetDiffuse()
        full_light, shadowed = ambient + diffuse * full_light, ambient + diffuse * shadowed
        is_lit = bool(material.GetLighting()) and all(_takes_light(p) for p in pictures)
        colors = places.albedo.copy()
        if not material.GetLighting():
            full_light = shadowed = np.ones_like(full_light)
        if not is_lit:
            colors[:, :3] *= shadowed
        for draped, meshes, mode, _, dim, _ in pictures:
            sides = 1 if surface.closed else 0
            image = draped(places.samples, [surface.mesh(), *meshes], sides) / 255.0
            colors[:, :3] = _mixed(colors[:, :3], image, mode, dim, places.albedo[:, :3])
        if is_lit:
            shadow = shadowed / np.maximum(full_light, _DARK)
            colors[:, :3] *= np.where(full_light > _DARK, shadow, 1.0)
        return np.clip(colors, 0, 1), is_lit

    def _light(self, places, surface, shadows):
        """Return the light without and with shadows, (n, 3) each."""
        normals = places.normals
        if not surface.closed:  # VTK flips the normals of back faces
            eye_directions = self.frame.eye - places.points
            if self.frame.parallel:
                eye_directions = np.broadcast_to(self.frame.view_from_world[2, :3], normals.shape)
            normals = np.where((normals * eye_directions).sum(1)[:, None] < 0, -normals, normals)
        full_light, shadowed = np.zeros((2, len(normals), 3))
        for k in range(len(self.lamps.lights)):
            light = self.lamps.on(k, places.points, normals)
            lit_share = np.ones(len(normals))
            for numbers, reach, strength, _ in shadows:
                if k in numbers:
                    open_share = 1 - strength * (1 - reach.of(numbers[k], places.samples))
                    lit_share = np.minimum(lit_share, places.samples.most(open_share))
            full_light += light
            shadowed += light * lit_share[:, None]
        return full_light, shadowed


def _takes_light(picture) -> bool:
    _, _, mode, lit, *_ = picture
    return lit and mode in ('replace', 'decal')


def _mixed(under_colors, over_colors, mode, dim, albedo):
    """Return colours with an image on top, as a projector's shader mixes them."""
    colors, cover_share = over_colors[:, :3], over_colors[:, 3:]
    if mode in ('replace', 'decal'):
        return under_colors * dim * (1 - cover_share) + colors * cover_share
    remaining = under_colors * (dim * (1 - cover_share) + cover_share)
    return remaining + colors * cover_share * (albedo if mode == 'modulate' else 1.0)


def _recolored(surface, lit) -> Surface:
    material = material_of(surface.material)
    material.SetColor(1.0, 1.0, 1.0)
    if not lit:
        material.LightingOff()
    return replace(surface, material=material)


def _bytes(colors):
    return np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)


def _side(surface, triangle_count) -> float:
    """Return the edge length for a number of equal triangles."""
    a, b, c = np.moveaxis(surface.points[surface.faces], 1, 0)
    surface_area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return float(np.sqrt(4 * surface_area / triangle_count))


def _vertices(surface, first_vertex) -> Places:
    """Return vertices from an index on: from 0 with all their faces, otherwise with one each."""
    albedo = albedo_of(surface)
    if first_vertex == 0:
        samples = Samples.of(surface.mesh(), 'points')
        return Places(samples, surface.points, surface.normals, albedo)
    face_corners = surface.faces.ravel()
    (new_places,) = np.nonzero(face_corners >= first_vertex)
    new_vertices, first_places = np.unique(face_corners[new_places], return_index=True)
    vertex_face = new_places[first_places] // 3
    points, normals = surface.points[new_vertices], _face_normals(surface, vertex_face)
    corners, vertex_count = surface.faces[vertex_face], len(new_vertices)
    inward_points = points + _INWARD * (surface.points[corners].mean(1) - points)
    samples = Samples(
        inward_points,
        normals,
        np.arange(vertex_count),
        vertex_count,
        corners,
        np.zeros(vertex_count),
    )
    return Places(samples, points, surface.normals[new_vertices], albedo[new_vertices])


def _face_normals(surface, faces=slice(None)):
    a, b, c = np.moveaxis(surface.points[surface.faces[faces]], 1, 0)
    return unit_vectors(np.cross(b - a, c - a))


def _texels(surface, samples, shares, texture) -> Places:
    """Return a surface's texels, with the colours of its old texture."""

    def between(values):
        return np.einsum('nk,nkd->nd', shares, values[samples.corner])

    normals = samples.normals
    if surface.normals is not None:
        normals = unit_vectors(between(surface.normals))
    albedo = between(albedo_of(surface))
    if texture is not None:
        uv = np.clip(between(surface.coordinates), 0, 1)
        albedo *= np.nan_to_num(sample(texture, uv)) / 255
    return Places(samples, samples.points, normals, albedo)


def _origin(flat, surface):
    """Return the original point of each point of an unwrapped mesh."""
    if 'row' in flat.point_data:
        return np.asarray(flat.point_data['row'])
    # Seams duplicate points: match them by their triangles' corners, whose order is unchanged.
    origin = np.zeros(flat.n_points, int)
    origin[np.asarray(flat.regular_faces).ravel()] = surface.faces.ravel()
    return origin


def cut(arrays, faces, is_split, max_triangles, passes=_PASSES):
    """Halve edges, and split their triangles."""
    for _ in range(passes):
        point_count = len(arrays['points'])
        edge_ends, face_edges = edges_of(faces, point_count)
        edge_lengths = np.linalg.norm(np.diff(arrays['points'][edge_ends], axis=1)[:, 0], axis=1)
        is_halved = np.asarray(is_split(edge_ends, edge_lengths), bool)
        if not is_halved.any():
            break
        midpoint_rows = np.where(is_halved, point_count + np.cumsum(is_halved) - 1, -1)[face_edges]
        if len(faces) + (midpoint_rows >= 0).sum() > max_triangles:
            break
        ends = edge_ends[is_halved]
        arrays = {k: np.concatenate([v, _halfway(k, v, ends)]) for k, v in arrays.items()}
        faces = Cut(faces, midpoint_rows).faces
    return arrays, faces


def _halfway(name, values, edge_ends):
    midpoints = values[edge_ends].mean(1)
    if name == 'normals':
        midpoints = unit_vectors(midpoints)
    return np.rint(midpoints).astype(values.dtype) if values.dtype.kind == 'u' else midpoints
