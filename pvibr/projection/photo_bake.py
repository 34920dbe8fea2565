"""The colours of a mesh under photographs as data, and what they are worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.projection.photo_sources import threads
from pvibr.projection.samples import normals_and_areas
from pvibr.projection.texture_bake import baked_texture
from pvibr.projection.unwrap import texel_spacing

#: Arrays of a quality map: their type, and what they have where no photograph sees.
QUALITY = {
    'photo': (np.int32, -1),
    'resolution': (np.float32, np.nan),
    'angle': (np.float32, np.nan),
}
#: Places that are painted at once.
_MANY = 1 << 16
#: Texels along a side of what is painted before it is written.
_TILE = 2048


@dataclass(frozen=True, eq=False)
class Paint:
    """What is shown at places of triangles."""

    #: RGBA, uint8; where no photograph sees the place alpha is 0, and the rest the mesh's colour.
    colors: np.ndarray
    #: The photograph that has most of it, -1 for none.
    photo: np.ndarray
    #: World units per pixel of that photograph on the surface, NaN for none.
    resolution: np.ndarray
    #: Degrees between its ray and the normal.
    angle: np.ndarray


class Painter:
    """Paints places of a mesh that are `spacing` apart; it holds pictures within its memory."""

    def __init__(self, painted, spacing):
        self.painted, self.choice = painted, painted.choice
        self.memory = painted.memory * 2**20
        self.normals, _ = normals_and_areas(self.choice.points[self.choice.faces])
        self._times = {
            int(number): self._halvings(number, spacing)
            for number in np.unique(self.choice.photos[self.choice.photos >= 0])
        }
        self._held: dict[int, np.ndarray] = {}  # the last used one is last

    def _halvings(self, number, spacing):
        """Return how often a picture is halved for pixels as far apart as places are."""
        face = np.flatnonzero((self.choice.photos == number).any(1))
        face = face[:: max(len(face) // 1000, 1)]
        middles = self.choice.points[self.choice.faces[face]].mean(1)
        texel = np.median(self.painted.sources[number].camera.texel(middles))
        return max(int(np.log2(max(spacing / texel, 1.0)) + 0.5), 0)

    def _picture(self, number):
        """Return a picture; those that were not used for long make room for it."""
        picture = self._held.pop(number, None)
        if picture is None:
            picture = self.painted.sources[number].load(self._times[number])
        while self._held and picture.nbytes + sum(p.nbytes for p in self._held.values()) > (
            self.memory
        ):
            del self._held[next(iter(self._held))]
        self._held[number] = picture
        return picture

    def at(self, cell, share, advance, quality=True) -> Paint:
        """Return what is shown at barycentric places of the triangles of the mesh."""
        count, share = len(cell), np.array(share, np.float32)
        face, best = np.empty(count, np.int32), np.full(count, -1, np.int32)
        sums, most = np.zeros((count, 4), np.float32), np.zeros(count, np.float32)
        colors = np.empty((count, 4), np.uint8)
        found: dict[str, np.ndarray] = {
            n: np.full(count * quality, *k[::-1]) for n, k in QUALITY.items()
        }
        parts = [slice(start, start + _MANY) for start in range(0, count, _MANY)]

        def find(part):
            face[part], share[part] = self.choice.at(cell[part], share[part])

        def finish(part):
            colors[part] = self._mean(sums[part])
            if quality:
                values = {name: v[part] for name, v in found.items()}
                self._rate(face[part], share[part], best[part], **values)

        with threads() as pool:
            list(pool.map(find, parts))
            used = self._used(face)
            for done, number in enumerate(used):
                picture = self._picture(number)

                def add(part, number=number, picture=picture):
                    whole = face, share, sums, most, best
                    self._add(number, picture, *(v[part] for v in whole))

                list(pool.map(add, parts))
                advance((done + 1) / len(used))
            list(pool.map(finish, parts))
        return Paint(colors, **found)

    def _mean(self, sums):
        """Return colours of their weighted sums and those of weights; clear where none is."""
        colors, covered = np.empty(sums.shape, np.uint8), sums[:, 3] > 0
        colors[:] = (*self.painted.prop.color.int_rgb, 0)
        colors[covered, :3] = np.rint(sums[covered, :3] / sums[covered, 3:])
        colors[covered, 3] = 255
        return colors

    def _used(self, face):
        """Return the photographs that are shown on some of the triangles."""
        shown = np.zeros(len(self.choice.photos), bool)
        shown[face] = True
        numbers = np.unique(self.choice.photos[shown])
        return numbers[numbers >= 0].tolist()

    def _add(self, number, picture, face, share, sums, most, best):
        """Add what one picture shows."""
        choice, painted = self.choice, self.painted
        rows, place = np.nonzero(choice.photos[face] == number)
        if not len(rows):
            return
        face, share = face[rows], share[rows]
        weight = np.einsum('nc,nc->n', share, choice.weights[face, :, place])
        changes = painted.changes[painted.pairs.of_corners[face, :, place]]
        uv, _ = painted.sources[number].camera.project(self._points(face, share))
        colors = sample(picture, np.clip(uv, 0, 1))
        weight = weight * colors[:, 3] / 255
        shown = colors[:, :3] * painted.found_gains[number]
        shown += 255 * np.einsum('nc,ncd->nd', share, changes)
        sums[rows, :3] += weight[:, None] * np.clip(shown, 0, 255)
        sums[rows, 3] += weight
        first = rows[weight > most[rows]]
        most[rows], best[first] = np.maximum(most[rows], weight), number

    def _rate(self, face, share, best, photo, resolution, angle):
        """Tell what the best pictures are worth."""
        for number in np.unique(best[best >= 0]):
            source, rows = self.painted.sources[number], np.flatnonzero(best == number)
            points, normals = self._points(face[rows], share[rows]), self.normals[face[rows]]
            cosine = np.einsum('ij,ij->i', normals, source.camera.toward(points))
            photo[rows] = source.index
            resolution[rows] = pixel_sizes(source.camera, points, normals)
            angle[rows] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    def _points(self, face, share):
        return np.einsum('nk,nkd->nd', share, self.choice.points[self.choice.faces[face]])


def pixel_sizes(camera, points, normals):
    """Return the roots of the areas that pixels of a camera have on a surface."""
    side = np.eye(3)[np.abs(normals).argmin(1)]
    across = unit_vectors(np.cross(normals, side))
    step = 0.1 * camera.texel(points)
    here, *near = (
        camera.project(points + step[:, None] * way)[0] * camera.size
        for way in (np.zeros(3), across, np.cross(normals, across))
    )
    (a, b), (c, d) = (near[0] - here).T, (near[1] - here).T
    return step / np.sqrt(np.maximum(np.abs(a * d - b * c), 1e-12))


def texture_of(painted, mesh, size, quality, file, advance):
    """Return the mesh with texture coordinates, its texture, and the images of a quality map."""

    def painter(mesh):
        own = Painter(painted, texel_spacing(mesh, size))

        def paint(tile, step):
            found = own.at(tile.cell, tile.share, step, quality)
            images = {'': tile.filled(found.colors, found.colors[:, 3] > 0)}
            for name in QUALITY if quality else ():
                images[name] = tile.values(getattr(found, name), QUALITY[name][1])
            return images

        return paint

    maps = QUALITY if quality else None
    return baked_texture(mesh, size, painter, file, advance, side=_TILE, maps=maps)


def data_of(painted, mesh, to, advance):
    """Return the mesh with arrays of its points or cells."""
    mesh = mesh.copy()
    faces = mesh.regular_faces
    rows, count = np.arange(len(faces)), len(faces)
    cell, share = rows, np.full((count, 3), 1 / 3)
    if to == 'points':
        rows, first = np.unique(faces, return_index=True)
        cell, share, count = first // 3, np.eye(3)[first % 3], mesh.n_points
    paint = Painter(painted, np.sqrt(mesh.area / len(cell))).at(cell, share, advance)
    data = mesh.point_data if to == 'points' else mesh.cell_data
    for name, (kind, empty) in QUALITY.items():
        data[name] = np.full(count, empty, kind)
        data[name][rows] = getattr(paint, name)
    colors = np.zeros((count, 4), np.uint8)
    colors[rows] = paint.colors
    data['projected'] = colors
    mesh.set_active_scalars('projected', preference=to[:-1])
    return mesh
