"""Light, shadows and projected images as colours of surfaces, which are subdivided for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pvibr.export.surfaces import Surface, albedo_of, material_of
from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.cutting import Cut, edges_of
from pvibr.projection.samples import Samples
from pvibr.projection.unwrap import tiles_of, unwrapped
from pvibr.projection.visibility import Reach, toward_light
from pvibr.scene.lights import lights_of

#: Edges longer than this fraction of the scene are split, shorter ones only where colours differ
#: by more than a step.
_COARSE, _STEP = 1 / 64, 6 / 255
_PASSES = 16
_DRAPED = 200_000  # triangles that show projected images by point colours
_DARK = 1e-4  # light below which shadows make no difference
_INWARD = 1e-3  # fraction by which vertices are moved towards the middle of their triangle
_TEXELS = 2048  # along a side of a shadow map
_SOFT_TEXELS, _SOFT_SAMPLES = 1024, 16


@dataclass
class Places:
    """Points to colour."""

    samples: Samples
    points: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray


class Lamps:
    """The lights of a renderer, and the diffuse light that VTK computes for them."""

    def __init__(self, renderer):
        on = [light for light in renderer.GetLights() if light.GetSwitch()]
        self.lights = lights_of(renderer)
        self.colors = [np.array(i.GetDiffuseColor()) * i.GetIntensity() for i in on]
        self._fades = [(np.array(i.GetAttenuationValues()), i.GetExponent()) for i in on]

    def on(self, number, points, normals) -> np.ndarray:
        """Return the diffuse light of one light, (n, 3)."""
        light = self.lights[number]
        toward = toward_light(light, points)
        amount = np.maximum((toward * normals).sum(1), 0.0)
        if light.positional:
            (constant, linear, square), exponent = self._fades[number]
            away = np.linalg.norm(points - light.position, axis=1)
            amount /= np.maximum(constant + linear * away + square * away**2, 1e-12)
            if light.kind == 'spot':
                cosine = -toward @ np.array(light.direction)
                inside = cosine > np.cos(np.radians(light.cone))
                amount *= np.where(inside, np.maximum(cosine, 0) ** exponent, 0.0)
        return amount[:, None] * self.colors[number]


class Paint:
    """Shadows and projected images on the surfaces of a subplot."""

    def __init__(self, frame, surfaces, *, detail, texels, most):
        self.frame, self.surfaces = frame, surfaces
        self.detail, self.texels, self.most = detail, texels, most
        ends = np.concatenate([s.points for s in surfaces])
        self.size = float(np.linalg.norm(np.ptp(ends, axis=0))) or 1.0
        self.lamps = Lamps(frame.renderer)
        self._shadows: list = []
        self._pictures: list = []

    # -- requests of effects -------------------------------------------------------------------

    def shadow(self, casts, receives, numbers, strength, extents=None):
        """Add shadows of casters on receivers, by the lights of these numbers."""
        casters = [s.solid() for s in self.surfaces if s.opaque and casts(s)]
        lights = [self.lamps.lights[k] for k in numbers]
        if extents is None:
            reach = Reach(casters, lights, _TEXELS)
        else:
            sizes = [extents(light) for light in lights]
            reach = Reach(casters, lights, _SOFT_TEXELS, _SOFT_SAMPLES, sizes)
        self._shadows.append(
            (dict(zip(numbers, range(len(numbers)), strict=True)), reach, strength, receives)
        )

    def drape(self, draped, mode, lit, dim, receives, casts):
        """Add projected images."""
        meshes = [s.solid() for s in self.surfaces if s.opaque and casts(s)]
        self._pictures.append((draped, meshes, mode, lit, dim, receives))

    # -- colours of surfaces -------------------------------------------------------------------

    def painted(self, surface) -> Surface:
        """Return a surface with shadows and images as its colours or texture."""
        pictures = [p for p in self._pictures if p[-1](surface)]
        shadows = [s for s in self._shadows if s[-1](surface) and surface.material.GetLighting()]
        if not pictures and not shadows:
            return surface
        if pictures and self.texels:
            flat = self._with_texture(surface, pictures, shadows)
            if flat is not None:
                return flat
        if surface.normals is None:
            surface = surface.exploded()
            surface.normals = np.repeat(_face_normals(surface), 3, axis=0)
        return self._with_colors(surface, pictures, shadows)

    def _with_colors(self, surface, pictures, shadows):
        base = surface
        if base.colors is None:
            base = replace(base, colors=_bytes(albedo_of(base)))
        most = self.most // len(self.surfaces)
        shortest, longest = self.detail * self.size, _COARSE * self.size
        if pictures:  # they change everywhere: split evenly, and sample once
            most = min(most, _DRAPED)
            longest = max(shortest, _side(base, most))
        most = max(most, len(base.faces))
        found, lit = self._colors(_vertices(base, 0), base, pictures, shadows)

        def more(found, wanted, passes):
            known = len(base.points)
            rows, faces = cut(base.rows(), base.faces, wanted, most, passes)
            cut_up = base.with_rows(rows, faces)
            if len(cut_up.points) == known:
                return cut_up, found
            new, _ = self._colors(_vertices(cut_up, known), cut_up, pictures, shadows)
            return cut_up, np.concatenate([found, new])

        base, found = more(found, lambda _, length: length > longest, _PASSES)

        def changes(ends, length):
            step = np.abs(found[ends[:, 0]] - found[ends[:, 1]]).max(1)
            return (step > _STEP) & (length > shortest)

        for _ in range(0 if pictures else _PASSES):
            known = len(found)
            base, found = more(found, changes, 1)
            if len(found) == known:
                break
        return _shown(replace(base, colors=_bytes(found)), lit)

    def _with_texture(self, surface, pictures, shadows):
        """Return a surface with a texture of its own, or None if it cannot be unwrapped."""
        mesh = surface.mesh()
        uv = surface.coordinates
        if uv is not None and (uv.min() < 0 or uv.max() > 1):
            return None
        mesh.point_data['row'] = np.arange(mesh.n_points)
        if uv is not None:
            mesh.active_texture_coordinates = uv
        try:
            flat = unwrapped(mesh, self.texels)
        except ImportError:
            return None
        rows = {k: v[_origin(flat, surface)] for k, v in surface.rows().items()}
        rows |= {'coordinates': np.asarray(flat.active_texture_coordinates, float)}
        whole = surface.with_rows(rows, np.asarray(flat.regular_faces, int))
        (tile,) = tiles_of(flat, self.texels, self.texels)
        places = _texels(whole, tile.samples(flat), surface.texture)
        found, lit = self._colors(places, whole, pictures, shadows)
        texture = tile.filled(_bytes(found), np.ones(len(found), bool))
        whole = replace(whole, colors=None, texture=texture, repeat=False)
        return _shown(whole, lit)

    def _colors(self, places, surface, pictures, shadows):
        """Return colours of places, (n, 4), and whether the surface stays lit."""
        material = surface.material
        whole, left = self._light(places, surface, shadows)
        ambient, diffuse = material.GetAmbient(), material.GetDiffuse()
        whole, left = ambient + diffuse * whole, ambient + diffuse * left
        lit = bool(material.GetLighting()) and all(_takes_light(p) for p in pictures)
        out = places.albedo.copy()
        if not material.GetLighting():
            whole = left = np.ones_like(whole)
        if not lit:
            out[:, :3] *= left
        for draped, meshes, mode, _, dim, _ in pictures:
            side = 1 if surface.closed else 0
            found = draped(places.samples, [surface.mesh(), *meshes], side) / 255.0
            out[:, :3] = _mixed(out[:, :3], found, mode, dim, places.albedo[:, :3])
        if lit:
            out[:, :3] *= np.where(whole > _DARK, left / np.maximum(whole, _DARK), 1.0)
        return np.clip(out, 0, 1), lit

    def _light(self, places, surface, shadows):
        """Return the light on places without and with shadows, (n, 3) each."""
        normals = places.normals
        if not surface.closed:  # VTK flips the normals of back faces
            toward = self.frame.eye - places.points
            if self.frame.parallel:
                toward = np.broadcast_to(self.frame.view_from_world[2, :3], normals.shape)
            normals = np.where((normals * toward).sum(1)[:, None] < 0, -normals, normals)
        whole, left = np.zeros((2, len(normals), 3))
        for k in range(len(self.lamps.lights)):
            light = self.lamps.on(k, places.points, normals)
            reached = np.ones(len(normals))
            for numbers, reach, strength, _ in shadows:
                if k in numbers:
                    one = 1 - strength * (1 - reach.of(numbers[k], places.samples))
                    reached = np.minimum(reached, places.samples.most(one))
            whole += light
            left += light * reached[:, None]
        return whole, left


def _takes_light(picture) -> bool:
    _, _, mode, lit, *_ = picture
    return lit and mode in ('replace', 'decal')


def _mixed(under, over, mode, dim, albedo):
    """Return colours with an image on them, as a projector's shader computes them."""
    colors, cover = over[:, :3], over[:, 3:]
    if mode in ('replace', 'decal'):
        return under * dim * (1 - cover) + colors * cover
    rest = under * (dim * (1 - cover) + cover)
    return rest + colors * cover * (albedo if mode == 'modulate' else 1.0)


def _shown(surface, lit) -> Surface:
    material = material_of(surface.material)
    material.SetColor(1.0, 1.0, 1.0)
    if not lit:
        material.LightingOff()
    return replace(surface, material=material)


def _bytes(colors):
    return np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)


def _side(surface, count) -> float:
    """Return the edge length of a surface of so many equal triangles."""
    a, b, c = np.moveaxis(surface.points[surface.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return float(np.sqrt(4 * area / count))


def _vertices(surface, known) -> Places:
    """Return the vertices from a number on: at 0 all with all their faces, else with one face."""
    albedo = albedo_of(surface)
    if known == 0:
        samples = Samples.of(surface.mesh(), 'points')
        return Places(samples, surface.points, surface.normals, albedo)
    corner = surface.faces.ravel()
    (place,) = np.nonzero(corner >= known)
    new, first = np.unique(corner[place], return_index=True)
    face = place[first] // 3
    points, normals = surface.points[new], _face_normals(surface, face)
    inward = points + _INWARD * (surface.points[surface.faces[face]].mean(1) - points)
    count = len(new)
    samples = Samples(
        inward, normals, np.arange(count), count, surface.faces[face], np.zeros(count)
    )
    return Places(samples, points, surface.normals[new], albedo[new])


def _face_normals(surface, faces=slice(None)):
    a, b, c = np.moveaxis(surface.points[surface.faces[faces]], 1, 0)
    return unit_vectors(np.cross(b - a, c - a))


def _texels(surface, samples, texture) -> Places:
    """Return the texels of a surface, with the colours of its old texture."""
    shares = _shares(surface.points[samples.corner], samples.points)

    def between(rows):
        return np.einsum('nk,nkd->nd', shares, rows[samples.corner])

    normals = samples.normals
    if surface.normals is not None:
        normals = between(surface.normals)
        normals = unit_vectors(normals)
    albedo = between(albedo_of(surface))
    if texture is not None:
        uv = np.clip(between(surface.coordinates), 0, 1)
        albedo *= np.nan_to_num(sample(texture, uv)) / 255
    return Places(samples, samples.points, normals, albedo)


def _shares(corners, points):
    """Return barycentric coordinates of points in triangles, (n, 3)."""
    a, b, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    pa, pb = (p * a).sum(1), (p * b).sum(1)
    det = aa * bb - ab * ab
    det = np.where(det > 0, det, 1)
    s, t = (bb * pa - ab * pb) / det, (aa * pb - ab * pa) / det
    shares = np.clip(np.stack([1 - s - t, s, t], 1), 0, 1)
    return shares / shares.sum(1, keepdims=True)


def _origin(flat, surface):
    """Return the point of a surface that each point of its unwrapped mesh comes from."""
    if 'row' in flat.point_data:
        return np.asarray(flat.point_data['row'])
    # Seams duplicate points: match them by the corners of their triangles, which keep their order.
    origin = np.zeros(flat.n_points, int)
    origin[np.asarray(flat.regular_faces).ravel()] = surface.faces.ravel()
    return origin


def cut(rows, faces, wanted, most, passes=_PASSES):
    """Split edges in half, and their triangles with them."""
    for _ in range(passes):
        n = len(rows['points'])
        ends, of_face = edges_of(faces, n)
        length = np.linalg.norm(np.diff(rows['points'][ends], axis=1)[:, 0], axis=1)
        halved = np.asarray(wanted(ends, length), bool)
        if not halved.any():
            break
        middle = np.where(halved, n + np.cumsum(halved) - 1, -1)[of_face]
        if len(faces) + (middle >= 0).sum() > most:
            break
        rows = {k: np.concatenate([v, _halfway(k, v, ends[halved])]) for k, v in rows.items()}
        faces = Cut(faces, middle).faces
    return rows, faces


def _halfway(name, values, ends):
    between = values[ends].mean(1)
    if name == 'normals':
        between = unit_vectors(between)
    return np.rint(between).astype(values.dtype) if values.dtype.kind == 'u' else between
