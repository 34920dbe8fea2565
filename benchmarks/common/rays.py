"""What light reaches, by rays cast with embree: the reference of shadows, independent of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pvibr.maths.kernels import vogel_disk
from pvibr.maths.octahedral import frame
from pvibr.maths.vectors import unit_vectors

#: A shadow ray starts so far above its surface, in sizes of the scene: some 16 units in the last
#: place of embree's float32.
LIFT = 1e-6
#: Rays cast at once: what they need stays within some 100 MiB.
CHUNK = 1 << 20
_FAR = 1e30
_AROUND = np.ones((3, 3), bool)
#: Neighbouring pixels see one surface where their points are no farther apart than this, in
#: footprints of the pixel that needs less.
_JUMP = 4.0
#: The cosine below which a footprint grows no further.
_GRAZING = 0.02


@dataclass(frozen=True, eq=False)
class Surface:
    """What is seen through the centre of each pixel, top row first."""

    hit: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    mesh: np.ndarray
    footprint: np.ndarray

    def facing(self, light):
        """Return the cosine between normals and the direction to a light's middle."""
        toward, _ = _toward(light, self.points)
        return np.einsum('...i,...i', self.normals, toward)


class Rays:
    """Meshes to cast rays at."""

    def __init__(self, meshes):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners = [_triangles(mesh) for mesh in meshes]
        self._first = np.cumsum([0, *map(len, corners)])
        triangles = np.concatenate(corners)
        low, high = triangles.min((0, 1)), triangles.max((0, 1))
        self.center = (low + high) / 2
        #: Diagonal of the box around all, world units.
        self.size = float(np.linalg.norm(high - low))
        triangles -= self.center
        triangles /= self.size
        self._corner = triangles[:, 0].copy()
        across = np.cross(triangles[:, 1] - self._corner, triangles[:, 2] - self._corner)
        self._normals = unit_vectors(across)
        # Far from the origin points are known no better than numbers there are spaced.
        spacing = np.spacing(np.abs(self.center).max()) / self.size
        self._lift = LIFT + 4 * spacing
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, np.ascontiguousarray(triangles, np.float32))

    def surface(self, frame) -> Surface:
        """Return what a camera sees."""
        width, height = frame.size
        origins, ways = _pixel_rays(frame)
        origins, ways = (np.ascontiguousarray(a.reshape(-1, 3)) for a in (origins, ways))
        cells, away = self._first_hit(origins, ways)
        hit = cells >= 0
        points = np.where(hit[:, None], origins + ways * away[:, None], np.nan)
        normals = np.where(hit[:, None], self._normals[cells], np.nan)
        slope = np.einsum('ni,ni->n', normals, ways)
        normals *= np.where(slope > 0, -1.0, 1.0)[:, None]
        ahead = 1.0
        if not frame.parallel:  # along the view axis, as pixel_scale is meant
            ahead = away * np.abs(ways @ frame.view_from_world[2, :3])
        footprint = ahead / frame.pixel_scale / np.fmax(np.abs(slope), _GRAZING)
        shape = (height, width)
        mesh = np.where(hit, np.searchsorted(self._first, cells, 'right') - 1, -1)
        return Surface(
            hit=hit.reshape(shape),
            points=points.reshape(*shape, 3),
            normals=normals.reshape(*shape, 3),
            mesh=mesh.reshape(shape),
            footprint=np.where(hit, footprint, np.nan).reshape(shape),
        )

    def lit(self, points, normals, light, *, extent=0.0, samples=256):
        """Return the share of a light that points see."""
        points = np.asarray(points, np.float64)
        normals = np.broadcast_to(np.asarray(normals, np.float64), points.shape)
        shape, found = points.shape[:-1], np.zeros(points.shape[:-1]).ravel()
        toward, reach = _toward(light, points)
        points, normals, toward = (a.reshape(-1, 3) for a in (points, normals, toward))
        disc = vogel_disk(samples) * _relative(light, extent) if extent else np.zeros((1, 2))
        rows = np.flatnonzero(np.einsum('ni,ni->n', normals, toward) > 0)
        for part in np.array_split(rows, max(1, -(-len(rows) * len(disc) // CHUNK))):
            seen = self._seen(points[part], normals[part], toward[part], reach.flat[part], disc)
            found[part] = seen.mean(1)
        found[np.isnan(points).any(1)] = np.nan
        return found.reshape(shape)

    def _seen(self, points, normals, toward, reach, disc):
        """Return which points of a light's disc are seen from some points, (n, samples)."""
        aside, above, _ = frame(toward).swapaxes(0, 1)
        if np.isfinite(reach).all():
            disc = disc / reach[:, None, None]
        aside, above = disc[..., :1] * aside[:, None], disc[..., 1:] * above[:, None]
        ways = toward[:, None] + aside + above
        origins = (points - self.center) / self.size + self._lift * normals
        origins = np.broadcast_to(origins[:, None], ways.shape)
        # The way has the light's distance as its unit: what is behind the light hides nothing.
        reach = np.fmin(reach / self.size, _FAR)
        reach = np.broadcast_to(reach[:, None], ways.shape[:2])
        origins, ways = (_float32(a).reshape(-1, 3) for a in (origins, ways))
        hits = self._scene.run(origins, ways, _float32(reach).ravel(), query='OCCLUDED')
        return (hits < 0).reshape(reach.shape)

    def _first_hit(self, origins, ways):
        """Return the triangle that each ray meets, -1 for none, and how far away it is."""
        cells = np.full(len(origins), -1)
        away = np.full(len(origins), np.nan)
        local = (origins - self.center) / self.size
        # Beginning beside the scene: embree's float32 would not know a far eye well enough.
        start = np.fmax(-np.einsum('ni,ni->n', local, ways) - 1.0, 0.0)
        local += ways * start[:, None]
        for rows in np.array_split(np.arange(len(origins)), max(1, len(origins) // CHUNK)):
            found = self._scene.run(_float32(local[rows]), _float32(ways[rows]), output=True)
            cells[rows] = found['primID']
            away[rows] = found['tfar']
        slope = np.einsum('ni,ni->n', self._normals[cells], ways)
        with np.errstate(divide='ignore', invalid='ignore'):
            up = np.einsum('ni,ni->n', self._corner[cells] - local, self._normals[cells])
            exact = up / slope
        # Along a triangle's plane there is no such point.
        away = np.where(np.abs(slope) > 1e-6, exact, away)
        return cells, (away + start) * self.size


def edge_band(lit, surface=None, width=1):
    """Return the pixels beside an edge of light and dark, or of a surface."""
    state = np.where(np.isnan(lit), -1.0, lit > 0.5)
    around = {'footprint': _AROUND, 'mode': 'nearest'}
    band = ndimage.maximum_filter(state, **around) != ndimage.minimum_filter(state, **around)
    if surface is not None:
        band |= _jumps(surface)
    return band if width == 1 else ndimage.binary_dilation(band, _AROUND, width - 1)


def wrong(drawn, true, *leave_out):
    """Return the share of pixels whose light is on the wrong side of a half."""
    counts = _known(drawn, true, leave_out)
    return float((np.abs(drawn - true)[counts] > 0.5).mean()) if counts.any() else float('nan')


def strengths(drawn, true, *leave_out):
    """Return how much light is drawn in full shadow and in full light."""
    counts = _known(drawn, true, leave_out)
    found = (drawn[counts & (true == value)] for value in (0, 1))
    dark, light = (float(a.mean()) if len(a) else float('nan') for a in found)
    return dark, light


def _known(drawn, true, leave_out):
    counts = ~(np.isnan(drawn) | np.isnan(true))
    for mask in leave_out:
        counts &= ~mask
    return counts


def _jumps(surface):
    """Return the pixels whose surface does not go on in one of those beside them."""
    found = np.zeros(surface.hit.shape, bool)
    for one, other in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:-1, :-1], np.s_[1:, 1:]),
        (np.s_[1:, :-1], np.s_[:-1, 1:]),
    ):
        apart = np.linalg.norm(surface.points[one] - surface.points[other], axis=-1)
        room = _JUMP * np.fmin(surface.footprint[one], surface.footprint[other])
        jump = (surface.mesh[one] != surface.mesh[other]) | (apart > room)
        found[one] |= jump
        found[other] |= jump
    return found


def _triangles(mesh):
    """Return the corners of a mesh's triangles, (n, 3, 3) float64."""
    mesh = mesh.triangulate()
    return np.asarray(mesh.points, np.float64)[mesh.regular_faces.reshape(-1, 3)]


def _pixel_rays(frame):
    """Return origins and unit directions of the rays through pixel centres, (h, w, 3)."""
    width, height = frame.size
    clip = frame.clip_from_view
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    plane = np.stack(np.meshgrid(x, y), -1)
    axes = frame.view_from_world[:3, :3]
    if frame.parallel:
        plane = (plane - clip[:2, 3]) / clip[[0, 1], [0, 1]]
        origins = frame.eye + plane @ axes[:2]
        return origins, np.broadcast_to(-axes[2], origins.shape)
    plane = (plane + clip[:2, 2]) / clip[[0, 1], [0, 1]]
    ways = unit_vectors(plane @ axes[:2] - axes[2])
    return np.broadcast_to(frame.eye, ways.shape), ways


def _toward(light, points):
    """Return unit directions from points to a light, and how far it is away."""
    place = np.array(light.GetTransformedPosition())
    if light.GetPositional():
        way = place - points
        return unit_vectors(way), np.linalg.norm(way, axis=-1)
    way = unit_vectors(place - np.array(light.GetTransformedFocalPoint()))
    return np.broadcast_to(way, points.shape), np.full(points.shape[:-1], np.inf)


def _relative(light, extent):
    """Return the radius of a light: in world units, or at a distance of 1."""
    return extent if light.GetPositional() else np.tan(np.radians(extent / 2))


def _float32(array):
    return np.ascontiguousarray(array, np.float32)
