"""The photographs of a surface on the GPU: all of them small, those of the view larger."""

from __future__ import annotations

from collections import deque
from itertools import islice

import numpy as np

from pvibr.images.picture_sheet import PictureSheet, least_halvings
from pvibr.projection.photo_choice import SHOWN
from pvibr.projection.photo_sources import THREADS, threads
from pvibr.projection.slide import bends
from pvibr.scene.placing import scale_of

#: Triangles that are asked which pictures a view needs, and how large.
_ASKED = 20_000
_FEWER = 10  # of these, only one in so many is asked how large it is


class PhotoPages:
    """Photographs in textures, within a number of bytes."""

    def __init__(self, window, sources, memory):
        self.sources, self.memory = sources, memory
        sizes = [source.size for source in sources]
        self.sheet = PictureSheet(window, sizes, memory)
        whole = least_halvings(sizes, self.sheet.texels, self.sheet.side) == 0
        #: How often the small versions are halved.
        self.halvings = (
            0 if whole else least_halvings(sizes, self.sheet.texels // 2, self.sheet.side)
        )
        self._small = [
            self._put(k, p)
            for k, p in self._loaded(dict.fromkeys(range(len(sizes)), self.halvings))
        ]
        self._large: dict[int, tuple] = {}  # times halved, place; the last used one is last
        self.loads = 0

    def _loaded(self, wanted):
        """Yield numbers and pictures, decoded in threads, few at once."""
        numbers = iter(wanted)
        ahead: deque = deque()
        with threads() as pool:
            while True:
                for number in islice(numbers, 2 * THREADS - len(ahead)):
                    ahead.append((number, pool.submit(self.sources[number].load, wanted[number])))
                if not ahead:
                    return
                number, picture = ahead.popleft()
                yield number, picture.result()

    def _put(self, number, picture):
        place = self.sheet.put(picture[::-1])
        height, width = picture.shape[:2]
        return None if place is None else (*place, width, height)

    def stale(self, wanted) -> dict:
        """Return the numbers whose larger version is to be loaded, and how often it is halved.

        `wanted` has numbers, the most needed first, and how often they may be halved.
        """
        found, texels = {}, self.sheet.texels // 2
        for number, times in wanted.items():
            times = max(times, 0)
            side = max(self.sources[number].size) >> times
            texels -= 2 * side * side
            if times >= self.halvings or texels < 0:
                continue
            if number not in self._large or self._large[number][0] > times:
                found[number] = times
        return found

    def refine(self, stale, wanted):
        """Load larger versions, in place of those that the view needs no more."""
        for number, picture in self._loaded(stale):
            old = self._large.pop(number, None)
            if old is not None:
                self.sheet.free(old[1][:3])
            place = self._put(number, picture)
            unused = [k for k in self._large if k not in wanted]
            while place is None and unused:
                self.sheet.free(self._large.pop(unused.pop(0))[1][:3])
                place = self._put(number, picture)
            if place is not None:
                self._large[number] = stale[number], place
                self.loads += 1

    def places(self) -> np.ndarray:
        """Return x, y, width and height of each photograph, (n, 4)."""
        places = [
            self._large[k][1] if k in self._large else small for k, small in enumerate(self._small)
        ]
        return np.array([(*p[:2], *p[3:]) for p in places], float)

    def report(self) -> dict:
        """Return what is held."""
        return {
            'bytes': self.sheet.nbytes,
            'small': f'1/{1 << self.halvings}',
            'larger': len(self._large),
        }

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.sheet.release()


class Needs:
    """Which photographs views of a mesh need, asked of some of its triangles."""

    def __init__(self, choice, sources):
        step = max(len(choice.faces) // _ASKED, 1)
        corners = choice.points[choice.faces[::step]]
        self._places = corners.mean(1)
        self._normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._sides = np.sqrt(np.linalg.norm(self._normals[::_FEWER], axis=1))
        self._of = choice.photos[::step]
        #: Pixels of the photographs there, in the units of the mesh.
        self._texels = np.full(self._of.shape, np.inf)
        #: Whether triangles are so large that what a lens does between corners would be seen.
        self.bent = False
        for number, source in enumerate(sources):
            face, place = np.nonzero(self._of == number)
            self._texels[face, place] = source.camera.texel(self._places[face])
            self.bent = self.bent or bends(source.camera, corners[face])

    def of(self, frame, matrix) -> dict:
        """Return photographs, those that show most first, and how small they may be."""
        rows, pixel = in_view(frame, matrix, self._places, self._normals)
        pixels = np.broadcast_to(pixel[:, None], (len(rows), SHOWN))
        numbers, area = self._of[rows], 1 / pixels**2
        shares = np.bincount(numbers[numbers >= 0], area[numbers >= 0])
        found = {}
        for number in np.argsort(-shares, kind='stable'):
            if shares[number] > 0:
                mine = numbers == number
                found[int(number)] = halvings(pixels[mine], self._texels[rows][mine])
        return found

    def size(self, frame, matrix) -> float:
        """Return how long the larger ones of the triangles in a view are in pixels."""
        few = self._places[::_FEWER], self._normals[::_FEWER]
        rows, pixel = in_view(frame, matrix, *few)
        return float(np.percentile(self._sides[rows] / pixel, 90)) if len(rows) else 0.0


def in_view(frame, matrix, places, normals):
    """Return the rows of what faces the eye in a view, and pixels in the mesh's units."""
    view, clip = frame.view_from_world @ matrix, frame.clip_from_view
    places = np.column_stack([places, np.ones(len(places))])
    clipped = places @ (clip @ view).T
    within = (np.abs(clipped[:, :3]) <= clipped[:, 3:]).all(1)
    toward = -view[:3, :3].T @ (view @ places.T)[:3]
    if frame.parallel:
        toward = np.broadcast_to(view[2, :3, None], toward.shape)
    within &= np.einsum('ij,ji->i', normals, toward) > 0
    rows = np.flatnonzero(within)
    scale = clip[1, 1] * frame.size[1] * scale_of(matrix)
    return rows, 2 * clipped[rows, 3] / scale


def halvings(pixels, texels) -> int:
    """Return how often a picture of such texels may be halved for such pixels."""
    times = np.log2(np.maximum(pixels / texels, 1e-30))
    return max(int(np.floor(np.percentile(times, 25) + 0.25)), 0)
