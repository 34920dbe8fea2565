"""Accumulation: a still view converges to the mean of many samples of each pixel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.core.passes import samples_of
from pvibr.gl import Quad, Target, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.gl.scene_pass import like_window
from pvibr.maths.sequences import disk
from pvibr.things.buffers import Tap
from pvibr.things.content_key import scene_key
from pvibr.things.frame import Frame, Sample

#: Samples over which the picture before them fades out.
_FADE = 8
_MOVES = 'the view moves'


class Accumulation(Effect):
    """Refinement of a still view, frame by frame: the mean of many samples of each pixel.

    Each sample has its own position within the pixels, and varies whatever else is sampled: the
    eye within the lens of `DepthOfField`, the point of a light of ``Shadows(method='pcss')``, the
    directions of `AmbientOcclusion`. It starts once a frame is unchanged, and restarts after each
    change; while the view moves it costs nothing. Windows and pages keep drawing until it is done;
    text, scalar bars and picking are unaffected.

    Parameters
    ----------
    samples : int, optional
        Samples per pixel of the finished picture.

    See Also
    --------
    pvibr.api.plotter_component.IBRComponent.screenshot : ``samples=`` draws them all at once.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> still = pl.ibr.add(pvibr.Accumulation(16))
    >>> pl.show(auto_close=False)
    >>> for _ in range(20):
    ...     pl.render()
    >>> still.report()['samples']
    16
    >>> pl.close()
    """

    single = True
    neutral = 'samples', 1
    presets = {'fast': {'samples': 16}, 'fine': {'samples': 256}}
    web = 'lost', 'browsers draw a frame at a time'

    samples = Param(64, 'Samples per pixel of the picture: more takes longer.', range='[1, 65536]')

    def __init__(self, samples=samples.default, **settings):
        super().__init__(samples=samples, **settings)
        self._quads: dict[str, Quad] = {}
        self._means: dict[bool, _Mean] = {}
        self._current_mean: Any = None  # of the current frame; None if it does not count
        self._camera: Any = None
        self._fixed_sample: Any = None  # number and count, set by `take`

    def take(self, index=None, count=1):
        """Render the next frames as one fixed sample, whatever changes between them.

        Parameters
        ----------
        index : int, optional
            Number of the sample, from 0; None ends this.
        count : int
            Number of samples; the last one shows the mean of all.
        """
        if index is None or index == 0:
            self._means = {eye: mean.restart() for eye, mean in self._means.items()}
        self._fixed_sample = None if index is None else (index, count)

    @property
    def unfinished(self) -> bool:
        """Whether more frames would refine the picture."""
        means = self._means.values()
        return self.enabled and self.samples > 1 and any(m.count < self.samples for m in means)

    @property
    def rests(self) -> bool:
        """Whether nothing changed in the last frame."""
        return all(mean.count >= 0 for mean in self._means.values())

    @property
    def one_sample(self) -> bool:
        """Whether the frame is a sample."""
        return self._current_mean is not None and self._current_mean.sample is not None

    def as_sampled(self, frame) -> Frame:
        """Return the frame of the next sample, if nothing changed since the last one."""
        self._current_mean = None
        if 0 in frame.size or (self.samples == 1 and self._fixed_sample is None):
            return frame
        if not frame.window.GetStereoRender():
            release(self._means.pop(True, None))
        eye_mean = self._means.setdefault(_is_left(frame), _Mean())
        if self._fixed_sample is not None:
            eye_mean.count = eye_mean.sample = self._fixed_sample[0]
        elif self._is_tapped:
            eye_mean.sample = None
        else:
            eye_mean.follow(frame, self.pipeline, self.samples)
        self._current_mean = eye_mean if eye_mean.count >= 0 else None
        return frame if eye_mean.sample is None else self._sampled(frame, eye_mean.sample)

    def needed(self, frame) -> bool | str:
        """Return True if the frame is a sample, or the first at rest."""
        if self.samples == 1:
            return super().needed(frame)
        return self._current_mean is not None or _MOVES

    @property
    def _is_tapped(self) -> bool:
        """Whether a tap reads the frame's buffers, which must be those of the unshifted view."""
        return any(isinstance(effect, Tap) for effect in self.pipeline.effects)

    def _sampled(self, frame, index) -> Frame:
        """Return a frame whose eye and position within each pixel are those of a sample."""
        sample_count = self.samples if self._fixed_sample is None else self._fixed_sample[1]
        user_camera, sample = frame.renderer.GetActiveCamera(), Sample(index, sample_count)
        if self._camera is None:
            self._camera = _vtk.vtkOpenGLCamera()
        self._camera.DeepCopy(user_camera)
        supersamples = samples_of(frame.renderer)
        if not frame.renderer.GetPreserveColorBuffer():
            supersamples //= max(frame.window.GetMultiSamples(), 1)
        # Supersampling has smaller pixels.
        pixel_size = 2 / np.array(frame.size) / np.sqrt(supersamples)
        pixel_shift = np.subtract(sample.pair('pixel'), 0.5) * pixel_size
        _aim(self._camera, frame, pixel_shift, self._eye(frame, sample))
        frame.renderer.SetActiveCamera(self._camera)
        sampled = Frame.of(frame.renderer, index=frame.index, time=frame.time)
        return replace(sampled, sample=replace(sample, camera=user_camera))

    def _eye(self, frame, sample) -> tuple[float, float, float]:
        """Return the eye's position within a lens, and the focus distance."""
        for effect in self.pipeline.effects:
            lens = effect.lens_of(frame) if effect.enabled else None
            if lens is not None:
                lens_x, lens_y = disk(*sample.pair('lens'))
                return lens[0] * lens_x, lens[0] * lens_y, lens[1]
        return 0.0, 0.0, 1.0

    def render(self, frame, picture):
        """Add the picture to the sum, and show the mean."""
        mean, accumulates = self._current_mean, self._fixed_sample is None
        if not self._quads:
            self._quads = quads_of(frame.window, __file__)
        mean.allocate(frame.window, picture.size, keeps_first=accumulates)
        if mean.sample is not None:
            self._add(mean, picture)
        elif mean.count == 0:
            mean.first.draw(self._quads['copy'], {}, {'color': picture.color})
            picture.blit_depth(mean.first.object, (0, 0, *picture.size))
        if accumulates or self._fixed_sample[0] == self._fixed_sample[1] - 1:
            self._show(mean, picture)
        if accumulates and not self._is_tapped:
            self._settle_changes(mean, picture)

    def _add(self, mean, picture):
        clear_color = (0.0, 0.0, 0.0, 0.0) if mean.sample == 0 else None
        color = {'color': picture.color}
        mean.sum.draw(self._quads['add'], {}, color, blend='sum', clear=clear_color)

    def _show(self, mean, picture):
        sample_count = mean.count if mean.sample is None else mean.sample + 1
        if sample_count == 0:
            return
        first_picture = mean.first or mean.sum
        mean_share = min(sample_count / _FADE, 1.0) if mean.first else 1.0
        with picture.drawing():
            self._quads['show'].draw(
                {'count': float(sample_count), 'share': mean_share},
                {'sum': mean.sum.colors[0], 'first': first_picture.colors[0]},
            )

    def _settle_changes(self, mean, picture):
        """Restore the depth of the unshifted view, and record the scene as drawn."""
        if mean.sample is not None and picture.find_depth is None:
            picture.put_depth(mean.first.object)
        self.pipeline.surfaces.settle()
        mean.scene = scene_key(self.pipeline)

    def deactivate(self):
        """Free the pictures while the view moves."""
        for mean in self._means.values():
            mean.release()
            mean.count, mean.sample = -1, None

    def release(self):
        """Free GPU memory; the context is current."""
        release(*self._means.values(), *self._quads.values())
        self._means, self._quads, self._current_mean = {}, {}, None

    def report(self) -> dict:
        """Return bytes, and the number of samples in the picture."""
        means = self._means.values()
        sample_count = min((mean.count for mean in means), default=0)
        return {'bytes': sum(mean.nbytes for mean in means), 'samples': max(sample_count, 0)}


class _Mean:
    """The sum of the samples of one eye."""

    def __init__(self):
        self.sum: Any = None
        self.first: Any = None  # the picture before all samples, with its depth
        self.view: tuple = ()
        self.scene: Any = None
        self.restart()

    def restart(self) -> _Mean:
        """Restart."""
        #: Samples in the picture after the frame; below 0 while the view moves.
        self.count = -1
        #: Number of the current sample; None if the frame is not one.
        self.sample: int | None = None
        self.view = ()
        return self

    def follow(self, frame, pipeline, samples):
        """Choose which sample a frame is."""
        self.sample = None
        view_key = frame.view.key(), frame.size, frame.origin, frame.tile, frame.time
        if view_key != self.view or frame.quality < 1:
            self.view, self.scene, self.count = view_key, None, -1
            return
        content_key = scene_key(pipeline)
        if self.scene is not None and content_key != self.scene:
            self.scene, self.count = content_key, -1
            return
        self.scene = content_key
        if 0 <= self.count < samples:
            self.sample = self.count
        self.count = min(self.count + 1, samples)

    def allocate(self, window, size, *, keeps_first):
        """Allocate targets of a size."""
        if self.sum is not None and (self.sum.width, self.sum.height) != tuple(size):
            self.release()
        if self.sum is None:
            self.sum = Target(window, size[0], size[1], ('rgba32f',), filter='nearest')
        if self.first is None and keeps_first:
            self.first = like_window(window, size, 'rgba16f')

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self.sum, self.first)

    def release(self):
        """Free GPU memory; the context must be current."""
        release(self.sum, self.first)
        self.sum = self.first = None


def _is_left(frame) -> bool:
    """Return True for the frame of the left eye in stereo."""
    stereo = frame.window.GetStereoRender()
    return bool(stereo and frame.renderer.GetActiveCamera().GetLeftEye())


def _aim(camera, frame, pixel_shift, lens_point):
    """Shift a camera's picture by a fraction of its half sides, and its eye across the lens."""
    x, y, focus = lens_point
    clip, view_axes = frame.clip_from_view, frame.view_from_world[:3, :3]
    if camera.GetUseExplicitProjectionTransformMatrix():
        matrix = _sheared(clip, pixel_shift, lens_point, frame.parallel)
        camera.SetExplicitProjectionTransformMatrix(matrix)
    elif frame.parallel:
        # About the focus plane, which must not move.
        camera.SetViewShear(-x / focus, -y / focus, focus / camera.GetDistance())
        camera.SetWindowCenter(*np.add(camera.GetWindowCenter(), pixel_shift))
    else:
        counter_shift = np.array([clip[0, 0] * x, clip[1, 1] * y]) / focus
        camera.SetWindowCenter(*np.add(camera.GetWindowCenter(), pixel_shift - counter_shift))
    if not frame.parallel and (x or y):
        eye_shift = x * view_axes[0] + y * view_axes[1]
        camera.SetPosition(*(camera.GetPosition() + eye_shift))
        camera.SetFocalPoint(*(camera.GetFocalPoint() + eye_shift))


def _sheared(clip_from_view, pixel_shift, lens_point, parallel):
    """Return an explicit projection matrix with that shift."""
    shear, shift = np.eye(4), np.eye(4)
    shear[:2, 2] = -np.array(lens_point[:2]) / lens_point[2]
    shear[:2, 3] = -np.array(lens_point[:2]) if parallel else 0.0
    shift[:2, 3] = pixel_shift
    matrix = _vtk.vtkMatrix4x4()
    matrix.DeepCopy((shift @ clip_from_view @ shear).ravel().tolist())
    return matrix
