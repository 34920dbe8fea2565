"""The colours of a mesh under photographs as data, with a quality map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.photos.photo_choice import mask_at
from pvibr.photos.photo_sources import threads
from pvibr.photos.texture_bake import baked_texture
from pvibr.visibility.surface_samples import Samples, normals_and_areas
from pvibr.visibility.unwrap import texel_spacing

#: Arrays of a quality map: dtype, and value where no photograph sees.
QUALITY = {
    'photo': (np.int32, -1),
    'resolution': (np.float32, np.nan),
    'angle': (np.float32, np.nan),
}
#: Samples painted at once.
_CHUNK = 1 << 16
#: Texels along a side of the tiles that are painted and written.
_TILE = 2048


@dataclass(frozen=True, eq=False)
class Paint:
    """Colours and quality of samples."""

    #: RGBA, uint8; where no photograph sees the sample alpha is 0 and RGB the mesh's colour.
    colors: np.ndarray
    #: The photograph with the largest weight, -1 for none.
    photo: np.ndarray
    #: World units per pixel of that photograph on the surface, NaN for none.
    resolution: np.ndarray
    #: Degrees between its ray and the normal, NaN for none.
    angle: np.ndarray


class Painter:
    """Paints samples of a mesh that are `spacing` apart, caching pictures within its memory."""

    def __init__(self, painted, spacing):
        self.painted, self.choice = painted, painted.choice
        self.memory = painted.memory * 2**20
        self.normals, _ = normals_and_areas(self.choice.points[self.choice.faces])
        self._halvings_of = {
            int(number): self._halvings(number, spacing)
            for number in np.unique(self.choice.photos[self.choice.photos >= 0])
        }
        self._pictures: dict[int, np.ndarray] = {}  # least recently used first

    def _halvings(self, photo_index, spacing):
        """Return how often to halve a picture so that pixels are about as dense as samples."""
        shown_faces = np.flatnonzero((self.choice.photos == photo_index).any(1))
        shown_faces = shown_faces[:: max(len(shown_faces) // 1000, 1)]
        middles = self.choice.points[self.choice.faces[shown_faces]].mean(1)
        median_texel = np.median(self.painted.sources[photo_index].camera.texel(middles))
        return max(int(np.log2(max(spacing / median_texel, 1.0)) + 0.5), 0)

    def _picture(self, photo_index):
        """Return a picture, evicting the least recently used ones from the cache."""
        picture = self._pictures.pop(photo_index, None)
        if picture is None:
            picture = self.painted.sources[photo_index].load(self._halvings_of[photo_index])
        free_bytes = self.memory - picture.nbytes
        while self._pictures and sum(p.nbytes for p in self._pictures.values()) > free_bytes:
            del self._pictures[next(iter(self._pictures))]
        self._pictures[photo_index] = picture
        return picture

    def at(self, cell, barycentric, advance, quality=True) -> Paint:
        """Return the paint at barycentric coordinates in triangles of the mesh."""
        count, barycentric = len(cell), np.array(barycentric, np.float32)
        face, best_photo = np.empty(count, np.int32), np.full(count, -1, np.int32)
        color_sums, best_weight = np.zeros((count, 4), np.float32), np.zeros(count, np.float32)
        colors = np.empty((count, 4), np.uint8)
        quality_maps: dict[str, np.ndarray] = {
            n: np.full(count * quality, *k[::-1]) for n, k in QUALITY.items()
        }
        chunks = [slice(start, start + _CHUNK) for start in range(0, count, _CHUNK)]

        def find(chunk):
            face[chunk], barycentric[chunk] = self.choice.at(cell[chunk], barycentric[chunk])

        def finish(chunk):
            colors[chunk] = self._mean(color_sums[chunk])
            if quality:
                values = {name: v[chunk] for name, v in quality_maps.items()}
                self._rate(face[chunk], barycentric[chunk], best_photo[chunk], **values)

        with threads() as pool:
            list(pool.map(find, chunks))
            used_photos = self._photos_on(face)
            for finished, photo_index in enumerate(used_photos):
                picture = self._picture(photo_index)

                def add(chunk, photo_index=photo_index, picture=picture):
                    arrays = face, barycentric, color_sums, best_weight, best_photo
                    self._add(photo_index, picture, *(v[chunk] for v in arrays))

                list(pool.map(add, chunks))
                advance((finished + 1) / len(used_photos))
            list(pool.map(finish, chunks))
        return Paint(colors, **quality_maps)

    def _mean(self, color_sums):
        """Return RGBA from weighted sums (n, 4) of RGB and 1; clear where the weight is 0."""
        colors, covered = np.empty(color_sums.shape, np.uint8), color_sums[:, 3] > 0
        colors[:] = (*self.painted.prop.color.int_rgb, 0)
        colors[covered, :3] = np.rint(color_sums[covered, :3] / color_sums[covered, 3:])
        colors[covered, 3] = 255
        return colors

    def _photos_on(self, face):
        """Return the photographs shown on any of the triangles."""
        numbers = np.unique(self.choice.photos[mask_at(face, len(self.choice.photos))])
        return numbers[numbers >= 0].tolist()

    def _add(self, photo_index, picture, face, barycentric, color_sums, best_weight, best_photo):
        """Accumulate the colours and weights of one picture."""
        choice, painted = self.choice, self.painted
        hits, slot = np.nonzero(choice.photos[face] == photo_index)
        if not len(hits):
            return
        face, barycentric = face[hits], barycentric[hits]
        photo_weights = np.einsum('nc,nc->n', barycentric, choice.weights[face, :, slot])
        changes = painted.changes[painted.pairs.of_corners[face, :, slot]]
        uv, _ = painted.sources[photo_index].camera.project(self._points(face, barycentric))
        colors = sample(picture, np.clip(uv, 0, 1))
        photo_weights = photo_weights * colors[:, 3] / 255
        corrected = colors[:, :3] * painted.found_gains[photo_index]
        corrected += 255 * np.einsum('nc,ncd->nd', barycentric, changes)
        color_sums[hits, :3] += photo_weights[:, None] * np.clip(corrected, 0, 255)
        color_sums[hits, 3] += photo_weights
        improved = hits[photo_weights > best_weight[hits]]
        best_weight[hits] = np.maximum(best_weight[hits], photo_weights)
        best_photo[improved] = photo_index

    def _rate(self, face, barycentric, best_photo, photo, resolution, angle):
        """Fill the quality map from the best photographs."""
        for photo_index in np.unique(best_photo[best_photo >= 0]):
            camera, is_best = self.painted.sources[photo_index].camera, best_photo == photo_index
            points = self._points(face[is_best], barycentric[is_best])
            normals = self.normals[face[is_best]]
            cosine = np.einsum('ij,ij->i', normals, camera.toward(points))
            photo[is_best] = self.painted.sources[photo_index].index
            resolution[is_best] = pixel_sizes(camera, points, normals)
            angle[is_best] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    def _points(self, face, barycentric):
        return np.einsum('nk,nkd->nd', barycentric, self.choice.points[self.choice.faces[face]])


def pixel_sizes(camera, points, normals):
    """Return the square roots of the areas of a camera's pixels on a surface, (n,)."""
    helper_axis = np.eye(3)[np.abs(normals).argmin(1)]
    across = unit_vectors(np.cross(normals, helper_axis))
    step = 0.1 * camera.texel(points)
    center_pixel, *near_pixels = (
        camera.project(points + step[:, None] * direction)[0] * camera.size
        for direction in (np.zeros(3), across, np.cross(normals, across))
    )
    (a, b), (c, d) = (near_pixels[0] - center_pixel).T, (near_pixels[1] - center_pixel).T
    return step / np.sqrt(np.maximum(np.abs(a * d - b * c), 1e-12))


def texture_of(painted, mesh, size, quality, file, advance):
    """Return the mesh with texture coordinates, its texture, and the images of a quality map."""

    def painter(mesh):
        painter_of_mesh = Painter(painted, texel_spacing(mesh, size))

        def paint(tile, step):
            paints = painter_of_mesh.at(tile.cell, tile.share, step, quality)
            images = {'': tile.filled(paints.colors, paints.colors[:, 3] > 0, keep_bare=True)}
            for name in QUALITY if quality else ():
                images[name] = tile.values(getattr(paints, name), QUALITY[name][1])
            return images

        return paint

    maps = QUALITY if quality else None
    return baked_texture(mesh, size, painter, file, advance, side=_TILE, maps=maps)


def data_of(painted, mesh, to, advance):
    """Return the mesh with colours and quality as arrays of points or cells."""
    mesh = mesh.copy()
    faces = mesh.regular_faces
    item_rows, item_count = np.arange(len(faces)), len(faces)
    cell, barycentric = item_rows, np.full((item_count, 3), 1 / 3)
    if to == 'points':
        item_rows, first_corner = np.unique(faces, return_index=True)
        cell, barycentric, item_count = (
            first_corner // 3,
            np.eye(3)[first_corner % 3],
            mesh.n_points,
        )
    paint = Painter(painted, np.sqrt(mesh.area / len(cell))).at(cell, barycentric, advance)
    data = mesh.point_data if to == 'points' else mesh.cell_data
    for name, (kind, empty) in QUALITY.items():
        data[name] = np.full(item_count, empty, kind)
        data[name][item_rows] = getattr(paint, name)
    colors = np.zeros((item_count, 4), np.uint8)
    colors[item_rows] = paint.colors
    if to == 'points':
        colors[:, :3] = Samples.of(mesh, to).filled(colors[:, :3], colors[:, 3] > 0)
    data['projected'] = colors
    mesh.set_active_scalars('projected', preference=to[:-1])
    return mesh
