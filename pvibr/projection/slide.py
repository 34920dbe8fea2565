"""An image and its calibrated camera, with texture and depth map."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.cameras.photos import Photo
from pvibr.gl import MipTexture, Texture, nbytes_of, texture_limit
from pvibr.images.projected import LivePictures, Pictures, is_live
from pvibr.maths import depth_test
from pvibr.maths.cameras import as_camera
from pvibr.maths.image_error import box_reduce
from pvibr.maths.orthographic import Orthographic
from pvibr.projection.depth_maps import view_of
from pvibr.scene.depth_view import DepthView

#: Pictures on a surface at once: each takes two of the 16 texture units that OpenGL promises, and
#: the mesh, the light and other effects need some.
MOST = 6
#: Depth views are at least as sharp as this, and at most: texels along a side.
_SIDES = (2048, 4096)
#: Pixels of a photograph by which a lens may be off between the corners of triangles.
_BENT = 0.1


class Slide:
    """An image and its camera, with texture and depth map."""

    def __init__(self, image, camera, mask=None):
        self.live: Any = image if is_live(image) else None
        self.pictures: Any = (LivePictures if self.live is not None else Pictures)(image, mask)
        self.given = camera
        self.camera()
        self.view: Any = None
        self.depth: DepthView | None = None
        self.texture: Texture | None = None
        self.reduced = 1
        self._shown: tuple = ()
        self._released = 0

    def camera(self):
        """Return the camera as it is now: a ``pyvista.Camera`` may have moved."""
        return as_camera(self.given, self.pictures.size)

    @property
    def bakes(self) -> int:
        """How many times its depth was drawn."""
        return self._released + (self.depth.bakes if self.depth else 0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        own = None if self.live is not None else self.texture
        return nbytes_of(own, self.depth)

    def side(self, resolution) -> int:
        """Return the texels along a side of the depth view."""
        return resolution or int(np.clip(2 * max(self.pictures.size), *_SIDES))

    def picture(self, time, settings) -> np.ndarray:
        """Return the picture of a time, (h, w, 4) uint8."""
        return self.pictures.weighted(*self._wanted(time, settings))

    def _wanted(self, time, settings) -> tuple:
        return self.pictures.at(time, settings.fps, settings.loop), settings.mode != 'replace'

    def content_key(self, settings) -> tuple:
        """Return a value that changes with its picture and camera."""
        time = settings.pipeline.time
        return self.camera(), None if self.live else self._wanted(time, settings)

    def show(self, window, time, settings):
        """Put the picture of a time on the GPU, with mip levels."""
        if self.live is not None:
            self.texture = self.live.shown
            return
        wanted = self._wanted(time, settings)
        if self._shown == wanted:
            return
        if self.texture is None:
            self.texture = MipTexture(window)
        picture = self.pictures.weighted(*wanted)
        self.reduced = -(-max(picture.shape[:2]) // texture_limit(window))
        self.texture.upload(_reduced(picture, self.reduced)[::-1])
        self._shown = wanted

    def look(self, frame, drawer, casters, resolution):
        """Draw the depth that the camera sees, if it is stale."""
        side = self.side(resolution)
        self.view = view_of(self.camera(), casters.bounds(), side)
        if self.view is None:
            return
        limit = texture_limit(frame.window)
        if self.depth is not None and self.depth.resolution != min(side, limit):
            self.drop_depth()
        if self.depth is None:
            self.depth = DepthView(drawer, 1, side)
        self.depth.update(frame, [self.view], casters)

    def drop_depth(self):
        """Free the depth."""
        if self.depth is not None:
            self._released += self.depth.bakes
            self.depth.release()
            self.depth = None

    def release(self):
        """Free the GPU's memory and close films; the context must be alive."""
        self.drop_depth()
        if self.texture is not None and self.live is None:
            self.texture.release()
        self.texture, self._shown = None, ()
        self.pictures.close()

    def textures(self) -> dict:
        """Return its textures by name: the picture, and the depth that its camera sees."""
        depth = None if self.depth is None or self.view is None else self.depth.texture
        found = {'picture': self.texture, 'depth': depth}
        return {name: texture for name, texture in found.items() if texture is not None}

    @property
    def has_lens(self) -> bool:
        """Whether its camera has lens distortion."""
        camera = self.camera()
        return not isinstance(camera, Orthographic) and bool(camera.distortion.any())

    # -- the numbers of the shader ------------------------------------------------------------

    def matrices(self, world_from_view, size):
        """Return view space to the picture's plane, and to the depth texture."""
        camera = self.camera()
        plane = plane_from_world(camera, size) @ world_from_view
        if self.view is None:
            return [plane, np.eye(4)]
        return [plane, self.view.texture_from_world() @ world_from_view]

    def numbers(self, view_from_world, size, gain) -> list:
        """Return the numbers of NUMBER in projector.glsl."""
        camera = self.camera()
        lens, radius, uv = lens_numbers(camera)
        if isinstance(camera, Orthographic):
            place = np.append(view_from_world[:3, :3] @ camera.toward(np.zeros((1, 3)))[0], 0.0)
        else:
            place = (view_from_world @ np.append(camera.position, 1.0))[:3]
            place = np.append(place, 1.0)
        texel = 1.0
        if self.view is not None and self.depth is not None:
            texel = depth_test.texel_size(self.view, self.depth.resolution)
        found = [*lens, radius, *uv.ravel(), *place, *gain]
        return [*found, _density(camera, size), texel]


def _photo_slides(photos, mask) -> list[tuple]:
    """Return (image, camera, mask) of each pinhole of photographs that have cameras."""
    photos = [photos] if isinstance(photos, Photo) else photos
    if not (isinstance(photos, list | tuple) and all(isinstance(p, Photo) for p in photos)):
        raise TypeError(
            'camera is missing; only photographs of pvibr.read_cameras have their own.'
        )
    masks = mask if isinstance(mask, list | tuple) else [mask] * len(photos)
    if len(masks) != len(photos):
        raise ValueError(f'mask has {len(masks)} entries; there are {len(photos)} photographs.')
    found: list[tuple] = []
    for photo, own in zip(photos, masks, strict=True):
        slides = photo.slides()
        if own is not None and slides[0][0] is not photo.path:
            raise ValueError(
                f'mask is given for {photo!r}, whose lens needs resampling: it takes none.'
            )
        found += slides if own is None else [(*slides[0][:2], own)]
    if not 1 <= len(found) <= MOST:
        raise ValueError(
            f'image is {len(photos)} photographs, {len(found)} pictures by their lenses; a '
            f'projector takes 1 to {MOST}: choose the nearest, or bake groups of them in turn.'
        )
    return found


def checked_slides(image, camera, mask) -> list[tuple]:
    """Return (image, camera, mask) of each image."""
    if camera is None:
        return _photo_slides(image, mask)
    if not isinstance(camera, list):
        return [(image, camera, mask)]
    masks = [None] * len(camera) if mask is None else mask
    if not (isinstance(image, list) and isinstance(masks, list)):
        raise TypeError(
            'camera is a list, image or mask is not: give lists, or one camera as a tuple'
        )
    if not len(image) == len(camera) == len(masks) or not 1 <= len(camera) <= MOST:
        raise ValueError(
            f'image, camera and mask have {len(image)}, {len(camera)} and {len(masks)} entries: '
            f'must be as many each, 1 to {MOST}'
        )
    return list(zip(image, camera, masks, strict=True))


def lens_numbers(camera):
    """Return a camera's distortion (8,), squared radius where it ends, plane to uv (2, 3)."""
    if isinstance(camera, Orthographic):
        return np.zeros(8), 1e30, np.eye(2, 3)
    return camera.distortion, min(camera.valid_radius, 1e15) ** 2, camera.uv_from_plane


def bends(camera, corners) -> bool:
    """Return whether a lens moves places of triangles off what their corners tell, in pixels."""
    if isinstance(camera, Orthographic) or not camera.distortion.any() or not len(corners):
        return False
    weights = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3]]) / [[3], [6], [6], [6]]
    uv, depth = camera.project(corners.reshape(-1, 3))
    uv, depth = uv.reshape(-1, 3, 2), depth.reshape(-1, 3)
    for weight in weights:
        share = weight * depth
        between = (share[..., None] * uv).sum(1) / share.sum(1)[:, None]
        off = camera.project(np.einsum('k,fkd->fd', weight, corners))[0] - between
        if np.nanmax(np.abs(off * camera.size), initial=0.0) > _BENT:
            return True
    return False


def plane_from_world(camera, size):
    """Return the matrix from world space to x, y and depth on the image plane, times w."""
    if isinstance(camera, Orthographic):
        view = camera.view_from_world
        matrix = np.zeros((4, 4))
        matrix[0], matrix[1] = view[0] / camera.width, view[1] / camera.height
        matrix[2], matrix[3, 3] = _depth_row(view, camera.near, camera.far, size), 1.0
        return matrix
    rows = np.column_stack([camera.R, camera.t]) / size
    return np.stack([rows[0], rows[1], 0.5 * rows[2], rows[2]])


def _depth_row(view, near, far, size):
    """Return the row whose product is 0 to 1 from near to far."""
    ends = np.isfinite([near, far])
    if not ends.any():
        return np.array([0, 0, 0, 0.5])
    if not ends.all():  # a scene is far smaller than this
        near, far = (near, near + 1e4 * size) if ends[0] else (far - 1e4 * size, far)
    return (-view[2] - [0, 0, 0, near]) / (far - near)


def _density(camera, size) -> float:
    """Return pixels per length of the scene, at a distance of that length."""
    if isinstance(camera, Orthographic):
        return size / float(camera.texel(np.zeros((1, 3)))[0])
    return float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))


def _reduced(picture, factor):
    """Return a picture reduced by averaging boxes of pixels."""
    if factor == 1:
        return picture
    high, wide = picture.shape[:2]
    padded = np.pad(picture, ((0, -high % factor), (0, -wide % factor), (0, 0)), mode='edge')
    return np.rint(box_reduce(padded, factor)).astype(np.uint8)
