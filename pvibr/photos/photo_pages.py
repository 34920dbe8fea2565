"""The photographs of a mesh on the GPU: all of them reduced, those in view in more detail."""

from __future__ import annotations

from collections import deque
from itertools import islice

import numpy as np

from pvibr.photos.photo_choice import FACE_PHOTOS
from pvibr.photos.photo_sources import THREADS, threads
from pvibr.photos.picture_sheet import PictureSheet, least_halvings
from pvibr.photos.slide import bends
from pvibr.things.placing import scale_of

#: Most triangles sampled to estimate which pictures a view needs, and at which size.
_SAMPLED_FACES = 20_000
_SIZE_STEP = 10  # only every tenth of these is measured for its size on screen


class PhotoPages:
    """Photographs in one texture, within a memory budget in bytes."""

    def __init__(self, window, sources, memory):
        self.sources, self.memory = sources, memory
        sizes = [source.size for source in sources]
        self.sheet = PictureSheet(window, sizes, memory)
        texels, side = self.sheet.texels, self.sheet.side
        #: Halvings of the small versions; half of the sheet is for larger ones, if not all fit.
        self.halvings = least_halvings(sizes, texels, side)
        if self.halvings:
            self.halvings = least_halvings(sizes, texels // 2, side)
        loaded = self._loaded(dict.fromkeys(range(len(sizes)), self.halvings))
        self._small = [self._put(picture) for _, picture in loaded]
        self._large: dict[int, tuple] = {}  # halvings, placement; least recently used first
        self.loads = 0

    def _loaded(self, halvings):
        """Yield (index, picture), decoded in threads, with a bounded queue."""
        numbers = iter(halvings)
        pending: deque = deque()
        with threads() as pool:
            while True:
                for photo_index in islice(numbers, 2 * THREADS - len(pending)):
                    load = self.sources[photo_index].load
                    pending.append((photo_index, pool.submit(load, halvings[photo_index])))
                if not pending:
                    return
                photo_index, future = pending.popleft()
                yield photo_index, future.result()

    def _put(self, picture):
        place = self.sheet.put(picture[::-1])
        height, width = picture.shape[:2]
        return None if place is None else (*place, width, height)

    def stale(self, halvings_per_photo) -> dict:
        """Return the photographs to reload at a larger size, with their halvings.

        `halvings_per_photo` has the allowed halvings, most needed photographs first.
        """
        stale_photos, texel_budget = {}, self.sheet.texels // 2
        for photo_index, halving_count in halvings_per_photo.items():
            halving_count = max(halving_count, 0)
            side = max(self.sources[photo_index].size) >> halving_count
            texel_budget -= 2 * side * side
            if halving_count >= self.halvings or texel_budget < 0:
                continue
            if photo_index not in self._large or self._large[photo_index][0] > halving_count:
                stale_photos[photo_index] = halving_count
        return stale_photos

    def refine(self, stale_photos, halvings_per_photo):
        """Load larger versions, evicting those that the view no longer needs."""
        for photo_index, picture in self._loaded(stale_photos):
            replaced = self._large.pop(photo_index, None)
            if replaced is not None:
                self.sheet.free(replaced[1][:3])
            placement = self._put(picture)
            evictable = [k for k in self._large if k not in halvings_per_photo]
            while placement is None and evictable:
                self.sheet.free(self._large.pop(evictable.pop(0))[1][:3])
                placement = self._put(picture)
            if placement is not None:
                self._large[photo_index] = stale_photos[photo_index], placement
                self.loads += 1

    def places(self) -> np.ndarray:
        """Return x, y, width and height of each photograph, (n, 4)."""
        places = [
            self._large[k][1] if k in self._large else small for k, small in enumerate(self._small)
        ]
        return np.array([(*p[:2], *p[3:]) for p in places], float)

    def report(self) -> dict:
        """Return bytes, the reduction of small versions, and the number of larger ones."""
        return {
            'bytes': self.sheet.nbytes,
            'small': f'1/{1 << self.halvings}',
            'larger': len(self._large),
        }

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.sheet.release()


class Needs:
    """Which photographs a view of a mesh needs, estimated from a sample of its triangles."""

    def __init__(self, choice, sources):
        face_step = max(len(choice.faces) // _SAMPLED_FACES, 1)
        corners = choice.points[choice.faces[::face_step]]
        self._places = corners.mean(1)
        self._normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._sides = np.sqrt(np.linalg.norm(self._normals[::_SIZE_STEP], axis=1))
        self._photos = choice.photos[::face_step]
        #: Size of the photographs' pixels there, in mesh units.
        self._texels = np.full(self._photos.shape, np.inf)
        #: Whether lens distortion between the corners of triangles is visible.
        self.bent = False
        for photo_index, source in enumerate(sources):
            face, slot = np.nonzero(self._photos == photo_index)
            self._texels[face, slot] = source.camera.texel(self._places[face])
            self.bent = self.bent or bends(source.camera, corners[face])

    def of(self, frame, world_from_mesh) -> dict:
        """Return the allowed halvings of photographs, those with the largest area first."""
        in_sight, pixel_size = in_view(frame, world_from_mesh, self._places, self._normals)
        pixel_sizes = np.broadcast_to(pixel_size[:, None], (len(in_sight), FACE_PHOTOS))
        numbers, area = self._photos[in_sight], 1 / pixel_sizes**2
        area_per_photo = np.bincount(numbers[numbers >= 0], area[numbers >= 0])
        needed = {}
        for photo_index in np.argsort(-area_per_photo, kind='stable'):
            if area_per_photo[photo_index] > 0:
                shows_photo = numbers == photo_index
                needed[int(photo_index)] = halvings(
                    pixel_sizes[shows_photo], self._texels[in_sight][shows_photo]
                )
        return needed

    def size(self, frame, world_from_mesh) -> float:
        """Return the size in pixels of the larger triangles in view, their 90th percentile."""
        sampled = self._places[::_SIZE_STEP], self._normals[::_SIZE_STEP]
        in_sight, pixel_size = in_view(frame, world_from_mesh, *sampled)
        if not len(in_sight):
            return 0.0
        return float(np.percentile(self._sides[in_sight] / pixel_size, 90))


def in_view(frame, world_from_mesh, places, normals):
    """Return the indices of points that are in view and face the eye, and pixel sizes there."""
    view_from_mesh, clip_from_view = frame.view_from_world @ world_from_mesh, frame.clip_from_view
    places = np.column_stack([places, np.ones(len(places))])
    clip_points = places @ (clip_from_view @ view_from_mesh).T
    within = (np.abs(clip_points[:, :3]) <= clip_points[:, 3:]).all(1)
    toward = -view_from_mesh[:3, :3].T @ (view_from_mesh @ places.T)[:3]
    if frame.parallel:
        toward = np.broadcast_to(view_from_mesh[2, :3, None], toward.shape)
    within &= np.einsum('ij,ji->i', normals, toward) > 0
    in_view_rows = np.flatnonzero(within)
    scale = clip_from_view[1, 1] * frame.size[1] * scale_of(world_from_mesh)
    return in_view_rows, 2 * clip_points[in_view_rows, 3] / scale


def halvings(pixel_sizes, texel_sizes) -> int:
    """Return how often a picture may be halved so that its texels stay near the pixel size."""
    halving_counts = np.log2(np.maximum(pixel_sizes / texel_sizes, 1e-30))
    return max(int(np.floor(np.percentile(halving_counts, 25) + 0.25)), 0)
