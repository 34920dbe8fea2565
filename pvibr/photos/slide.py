"""Images with their calibrated cameras."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.gl import MipTexture, Texture, nbytes_of, texture_limit
from pvibr.maths.camera_views import view_of
from pvibr.maths.cameras import as_camera
from pvibr.maths.orthographic import Orthographic
from pvibr.photos.photos import Photo
from pvibr.textures.projected import LivePictures, Pictures, is_live, resized, upload
from pvibr.things.depth_view import DepthView
from pvibr.visibility import depth_test

#: Most slides of a projector: each takes two of the 16 texture units that OpenGL guarantees, and
#: the mesh, shadows and other effects need some.
MAX_SLIDES = 6
#: Bounds of the depth map's resolution, texels along a side.
_DEPTH_SIDES = (2048, 4096)
#: Tolerated error in pixels where lens distortion is interpolated between triangle corners.
_MAX_LENS_ERROR = 0.1


class Slide:
    """An image and its camera, with texture and depth map."""

    def __init__(self, image, camera, mask=None):
        self.live: Any = image if is_live(image) else None
        self.pictures: Any = (LivePictures if self.live is not None else Pictures)(image, mask)
        self.given_camera = camera
        self.camera()
        self.view: Any = None
        self.depth: DepthView | None = None
        self.texture: Texture | None = None
        self.reduced = 1
        self._shown_key: tuple = ()
        self._earlier_bakes = 0

    def camera(self):
        """Return the camera as it is now: a ``pyvista.Camera`` may have moved."""
        return as_camera(self.given_camera, self.pictures.size)

    @property
    def bakes(self) -> int:
        """Number of times that its depth was drawn."""
        return self._earlier_bakes + (self.depth.bakes if self.depth else 0)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(None if self.live is not None else self.texture, self.depth)

    def side(self, resolution) -> int:
        """Return the resolution of the depth map, texels along a side."""
        return resolution or int(np.clip(2 * max(self.pictures.size), *_DEPTH_SIDES))

    def picture(self, time, settings) -> np.ndarray:
        """Return the picture at a time, (h, w, 4) uint8."""
        return self.pictures.weighted(*self._picture_key(time, settings))

    def _picture_key(self, time, settings) -> tuple:
        return self.pictures.at(time, settings.fps, settings.loop), settings.mode != 'replace'

    def content_key(self, settings) -> tuple:
        """Return a value that changes with its picture and camera."""
        time = settings.pipeline.time
        return self.camera(), None if self.live else self._picture_key(time, settings)

    def show(self, window, time, settings):
        """Upload the picture at a time, with mip levels."""
        if self.live is not None:
            self.texture = self.live.shown
            return
        picture_key = self._picture_key(time, settings)
        if self._shown_key == picture_key:
            return
        if self.texture is None:
            self.texture = MipTexture(window)
        picture = self.pictures.weighted(*picture_key)
        self.reduced = -(-max(picture.shape[:2]) // texture_limit(window))
        size = -(-picture.shape[1] // self.reduced), -(-picture.shape[0] // self.reduced)
        upload(self.texture, resized(picture, size), keep=len(self.pictures) > 1)
        self._shown_key = picture_key

    def update_depth(self, frame, drawer, casters, resolution):
        """Redraw the depth map if it is stale."""
        side = self.side(resolution)
        self.view = view_of(self.camera(), casters.bounds(), side)
        if self.view is None:
            return
        side_limit = texture_limit(frame.window)
        if self.depth is not None and self.depth.resolution != min(side, side_limit):
            self.drop_depth()
        if self.depth is None:
            self.depth = DepthView(drawer, 1, side)
        self.depth.update(frame, [self.view], casters)

    def drop_depth(self):
        """Free the depth map."""
        if self.depth is not None:
            self._earlier_bakes += self.depth.bakes
            self.depth.release()
            self.depth = None

    def release(self):
        """Free the GPU's memory and close films; the context must be alive."""
        self.drop_depth()
        if self.texture is not None and self.live is None:
            self.texture.release()
        self.texture, self._shown_key = None, ()
        self.pictures.close()

    def textures(self) -> dict:
        """Return its textures by name, ``picture`` and ``depth``."""
        depth = None if self.depth is None or self.view is None else self.depth.texture
        textures = {'picture': self.texture, 'depth': depth}
        return {name: texture for name, texture in textures.items() if texture is not None}

    @property
    def has_lens(self) -> bool:
        """Whether its camera has lens distortion."""
        camera = self.camera()
        return not isinstance(camera, Orthographic) and bool(camera.distortion.any())

    # -- uniforms ------------------------------------------------------------------------------

    def matrices(self, world_from_view, size):
        """Return the matrices from view space to the image plane and to the depth texture."""
        camera = self.camera()
        plane = plane_from_world(camera, size) @ world_from_view
        if self.view is None:
            return [plane, np.eye(4)]
        return [plane, self.view.texture_from_world() @ world_from_view]

    def numbers(self, view_from_world, size, gain) -> list:
        """Return NUMBER of projector.glsl."""
        camera = self.camera()
        lens, radius, uv = lens_numbers(camera)
        if isinstance(camera, Orthographic):
            position = np.append(camera.toward(np.zeros((1, 3)))[0], 0.0)
        else:
            position = np.append(camera.position, 1.0)
        texel = 1.0
        if self.view is not None and self.depth is not None:
            texel = depth_test.texel_size(self.view, self.depth.resolution)
        position = view_from_world @ position
        density = _density(camera, size)
        return [*lens, radius, *uv.ravel(), *position, *gain, density, texel]


def _photo_slides(photos, mask) -> list[tuple]:
    """Return (image, camera, mask) of each pinhole picture of photographs."""
    photos = [photos] if isinstance(photos, Photo) else photos
    if not (isinstance(photos, list | tuple) and all(isinstance(p, Photo) for p in photos)):
        raise TypeError('camera must be given, except for photographs of pvibr.read_cameras')
    masks = mask if isinstance(mask, list | tuple) else [mask] * len(photos)
    if len(masks) != len(photos):
        raise ValueError(f'mask must have {len(photos)} entries, got {len(masks)}')
    slides_of_all: list[tuple] = []
    for photo, photo_mask in zip(photos, masks, strict=True):
        slides = photo.slides()
        if photo_mask is not None and slides[0][0] is not photo.path:
            raise ValueError(f'mask must be None for {photo!r}, whose lens needs resampling')
        slides_of_all += slides if photo_mask is None else [(*slides[0][:2], photo_mask)]
    if not 1 <= len(slides_of_all) <= MAX_SLIDES:
        raise ValueError(
            f'image must be 1 to {MAX_SLIDES} pictures, got {len(slides_of_all)} from '
            f'{len(photos)} photographs: choose the nearest, or bake groups of them in turn'
        )
    return slides_of_all


def checked_slides(image, camera, mask) -> list[tuple]:
    """Return (image, camera, mask) of each image."""
    if camera is None:
        return _photo_slides(image, mask)
    if not isinstance(camera, list):
        return [(image, camera, mask)]
    masks = [None] * len(camera) if mask is None else mask
    if not (isinstance(image, list) and isinstance(masks, list)):
        raise TypeError('image and mask must be lists if camera is; pass one camera as a tuple')
    if not len(image) == len(camera) == len(masks) or not 1 <= len(camera) <= MAX_SLIDES:
        raise ValueError(
            f'image, camera and mask must have the same number of entries, 1 to {MAX_SLIDES}, got '
            f'{len(image)}, {len(camera)} and {len(masks)}'
        )
    return list(zip(image, camera, masks, strict=True))


def lens_numbers(camera):
    """Return a camera's distortion (8,), its squared valid radius, and uv from plane (2, 3)."""
    if isinstance(camera, Orthographic):
        return np.zeros(8), 1e30, np.eye(2, 3)
    return camera.distortion, min(camera.valid_radius, 1e15) ** 2, camera.uv_from_plane


def bends(camera, corners) -> bool:
    """Return whether distortion interpolated from triangle corners is visibly wrong."""
    if isinstance(camera, Orthographic) or not camera.distortion.any() or not len(corners):
        return False
    sample_weights = np.array([[1, 1, 1], [3, 3, 0], [0, 3, 3], [3, 0, 3]]) / [[3], [6], [6], [6]]
    uv, depth = camera.project(corners.reshape(-1, 3))
    uv, depth = uv.reshape(-1, 3, 2), depth.reshape(-1, 3)
    for weight in sample_weights:
        homogeneous = weight * depth
        interpolated = (homogeneous[..., None] * uv).sum(1) / homogeneous.sum(1)[:, None]
        pixel_error = camera.project(np.einsum('k,fkd->fd', weight, corners))[0] - interpolated
        if np.nanmax(np.abs(pixel_error * camera.size), initial=0.0) > _MAX_LENS_ERROR:
            return True
    return False


def plane_from_world(camera, size):
    """Return the matrix from world space to homogeneous x, y and depth on the image plane."""
    if isinstance(camera, Orthographic):
        view = camera.view_from_world
        matrix = np.zeros((4, 4))
        matrix[0], matrix[1] = view[0] / camera.width, view[1] / camera.height
        matrix[2], matrix[3, 3] = _depth_row(view, camera.near, camera.far, size), 1.0
        return matrix
    camera_rows = np.column_stack([camera.R, camera.t]) / size
    return np.stack([camera_rows[0], camera_rows[1], 0.5 * camera_rows[2], camera_rows[2]])


def _depth_row(view, near, far, size):
    """Return the matrix row that maps near to far onto 0 to 1."""
    is_bounded = np.isfinite([near, far])
    if not is_bounded.any():
        return np.array([0, 0, 0, 0.5])
    if not is_bounded.all():  # far beyond any scene
        near, far = (near, near + 1e4 * size) if is_bounded[0] else (far - 1e4 * size, far)
    return (-view[2] - [0, 0, 0, near]) / (far - near)


def _density(camera, size) -> float:
    """Return pixels per scene size, at a distance of that size."""
    if isinstance(camera, Orthographic):
        return size / float(camera.texel(np.zeros((1, 3)))[0])
    return float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
