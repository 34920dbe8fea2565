"""Accumulation: a still view converges to the mean of many samples of each pixel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.frame import Frame, Sample
from pvibr.core.params import Param
from pvibr.core.passes import samples_of
from pvibr.gl import Quad, Target, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.gl.scene_pass import like_window
from pvibr.maths.sequences import disk
from pvibr.scene.buffers import Tap
from pvibr.scene.content_key import scene_key

#: Samples over which the picture before them fades.
_FADE = 8
_MOVES = 'the view moves'


class Accumulation(Effect):
    """Refinement of a still view, frame by frame: the mean of many samples of each pixel.

    Each sample has its own place within the pixels, and varies what else is sampled: the eye
    within the lens of `DepthOfField`, the point of a light that casts ``Shadows(method='pcss')``,
    the directions of `AmbientOcclusion`. It begins once a frame is unchanged, and again after each
    change; while the view moves it costs nothing. Windows and pages keep drawing until it is done;
    text, scalar bars and picking are unaffected.

    Parameters
    ----------
    samples : int, optional
        Samples per pixel until the picture is done.

    See Also
    --------
    pvibr.component.IBRComponent.screenshot : ``samples=`` takes them all at once.

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

    samples = Param(64, 'Samples per pixel until the picture is done.', range='[1, 65536]')

    def __init__(self, samples=samples.default, **settings):
        super().__init__(samples=samples, **settings)
        self._quads: dict[str, Quad] = {}
        self._eyes: dict[bool, _Mean] = {}
        self._mean: Any = None  # of the frame that is drawn, None if it is not of use
        self._camera: Any = None
        self._asked: Any = None  # number and count of the sample that is drawn next

    # -- which frame is which sample ----------------------------------------------------------

    def take(self, index=None, count=1):
        """Let the next frames be a certain sample, whatever changes between them.

        Parameters
        ----------
        index : int, optional
            Number of the sample, from 0; by default frames are what they are without this.
        count : int
            Number of samples: the mean of all is shown with the last one.
        """
        if index is None or index == 0:
            self._eyes = {eye: mean.restart() for eye, mean in self._eyes.items()}
        self._asked = None if index is None else (index, count)

    @property
    def unfinished(self) -> bool:
        """Whether more frames would refine the picture."""
        means = self._eyes.values()
        return self.enabled and self.samples > 1 and any(m.count < self.samples for m in means)

    @property
    def rests(self) -> bool:
        """Whether nothing had changed in the last frame."""
        return all(mean.count >= 0 for mean in self._eyes.values())

    @property
    def one_sample(self) -> bool:
        """Whether the frame is a sample."""
        return self._mean is not None and self._mean.sample is not None

    def as_sampled(self, frame) -> Frame:
        """Return the frame of the next sample, if nothing changed since the last one."""
        self._mean = None
        if 0 in frame.size or (self.samples == 1 and self._asked is None):
            return frame
        if not frame.window.GetStereoRender():
            release(self._eyes.pop(True, None))
        mean = self._eyes.setdefault(_is_left(frame), _Mean())
        if self._asked is not None:
            mean.count = mean.sample = self._asked[0]
        elif self._is_read:
            mean.sample = None
        else:
            mean.follow(frame, self.pipeline, self.samples)
        self._mean = mean if mean.count >= 0 else None
        return frame if mean.sample is None else self._sampled(frame, mean.sample)

    def needed(self, frame) -> bool | str:
        """Return True if the frame is a sample, or the first one at rest."""
        return super().needed(frame) if self.samples == 1 else self._mean is not None or _MOVES

    @property
    def _is_read(self) -> bool:
        """Whether buffers of the frame are read, which are those of the view itself."""
        return any(isinstance(effect, Tap) for effect in self.pipeline.effects)

    def _sampled(self, frame, index) -> Frame:
        """Return a frame of another eye, and of another place within each pixel."""
        count = self.samples if self._asked is None else self._asked[1]
        user, sample = frame.renderer.GetActiveCamera(), Sample(index, count)
        if self._camera is None:
            self._camera = _vtk.vtkOpenGLCamera()
        self._camera.DeepCopy(user)
        drawn = samples_of(frame.renderer)
        if not frame.renderer.GetPreserveColorBuffer():
            drawn //= max(frame.window.GetMultiSamples(), 1)
        # Supersampling has smaller pixels.
        place = np.subtract(sample.pair('pixel'), 0.5) * 2 / np.array(frame.size) / np.sqrt(drawn)
        _aim(self._camera, frame, place, self._eye(frame, sample))
        frame.renderer.SetActiveCamera(self._camera)
        sampled = Frame.of(frame.renderer, index=frame.index, time=frame.time)
        return replace(sampled, sample=replace(sample, camera=user))

    def _eye(self, frame, sample) -> tuple[float, float, float]:
        """Return the place of the eye within a lens, and the distance in focus."""
        for effect in self.pipeline.effects:
            lens = effect.lens_of(frame) if effect.enabled else None
            if lens is not None:
                x, y = disk(*sample.pair('lens'))
                return lens[0] * x, lens[0] * y, lens[1]
        return 0.0, 0.0, 1.0

    # -- drawing --------------------------------------------------------------------------------

    def render(self, frame, picture):
        """Add the picture to the sum, and show the mean."""
        mean, kept = self._mean, self._asked is None
        if not self._quads:
            self._quads = quads_of(frame.window, __file__)
        mean.allocate(frame.window, picture.size, keeps_first=kept)
        if mean.sample is not None:
            self._add(mean, picture)
        elif mean.count == 0:
            mean.first.draw(self._quads['copy'], {}, {'color': picture.color})
            picture.blit_depth(mean.first.object, (0, 0, *picture.size))
        if kept or self._asked[0] == self._asked[1] - 1:
            self._show(mean, picture)
        if kept and not self._is_read:
            self._settle(mean, picture)

    def _add(self, mean, picture):
        start = (0.0, 0.0, 0.0, 0.0) if mean.sample == 0 else None
        color = {'color': picture.color}
        mean.sum.draw(self._quads['add'], {}, color, blend='sum', clear=start)

    def _show(self, mean, picture):
        count = mean.count if mean.sample is None else mean.sample + 1
        if count == 0:
            return
        first = mean.first or mean.sum
        share = min(count / _FADE, 1.0) if mean.first else 1.0
        with picture.drawing():
            self._quads['show'].draw(
                {'count': float(count), 'share': share},
                {'sum': mean.sum.colors[0], 'first': first.colors[0]},
            )

    def _settle(self, mean, picture):
        """Let what drawing changed be no change, and the depth that of the view itself."""
        if mean.sample is not None and picture.find_depth is None:
            picture.put_depth(mean.first.object)
        self.pipeline.surfaces.settle()
        mean.scene = scene_key(self.pipeline)

    def deactivate(self):
        """Free the pictures: the view moves."""
        for mean in self._eyes.values():
            mean.release()
            mean.count, mean.sample = -1, None

    def release(self):
        """Free GPU memory; the context is current."""
        release(*self._eyes.values(), *self._quads.values())
        self._eyes, self._quads, self._mean = {}, {}, None

    def report(self) -> dict:
        """Return bytes, and how many samples the picture has."""
        means = self._eyes.values()
        count = min((mean.count for mean in means), default=0)
        return {'bytes': sum(mean.nbytes for mean in means), 'samples': max(count, 0)}


class _Mean:
    """The sum of the samples of one eye."""

    def __init__(self):
        self.sum: Any = None
        self.first: Any = None  # the picture before all samples, and its depth
        self.view: tuple = ()
        self.scene: Any = None
        self.restart()

    def restart(self) -> _Mean:
        """Begin anew."""
        #: Samples that the picture has after the frame; below 0 while the view moves.
        self.count = -1
        #: Number of the sample that is drawn, None if the frame is none.
        self.sample: int | None = None
        self.view = ()
        return self

    def follow(self, frame, pipeline, samples):
        """Choose the sample that a frame is."""
        self.sample = None
        view = frame.view.key(), frame.size, frame.origin, frame.tile, frame.time
        if view != self.view or frame.quality < 1:
            self.view, self.scene, self.count = view, None, -1
            return
        scene = scene_key(pipeline)
        if self.scene is not None and scene != self.scene:
            self.scene, self.count = scene, -1
            return
        self.scene = scene
        if 0 <= self.count < samples:
            self.sample = self.count
        self.count = min(self.count + 1, samples)

    def allocate(self, window, size, *, keeps_first):
        """Have targets of a size."""
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
        """Free the GPU's memory; the context must be alive."""
        release(self.sum, self.first)
        self.sum = self.first = None


def _is_left(frame) -> bool:
    """Return whether a frame is that of the left of two eyes."""
    stereo = frame.window.GetStereoRender()
    return bool(stereo and frame.renderer.GetActiveCamera().GetLeftEye())


def _aim(camera, frame, place, eye):
    """Shift a camera's picture by a part of its half sides, and its eye across the view."""
    x, y, focus = eye
    clip, axes = frame.clip_from_view, frame.view_from_world[:3, :3]
    if camera.GetUseExplicitProjectionTransformMatrix():
        camera.SetExplicitProjectionTransformMatrix(_sheared(clip, place, eye, frame.parallel))
    elif frame.parallel:
        # About the plane in focus, which stays where it is.
        camera.SetViewShear(-x / focus, -y / focus, focus / camera.GetDistance())
        camera.SetWindowCenter(*np.add(camera.GetWindowCenter(), place))
    else:
        back = np.array([clip[0, 0] * x, clip[1, 1] * y]) / focus
        camera.SetWindowCenter(*np.add(camera.GetWindowCenter(), place - back))
    if not frame.parallel and (x or y):
        move = x * axes[0] + y * axes[1]
        camera.SetPosition(*(camera.GetPosition() + move))
        camera.SetFocalPoint(*(camera.GetFocalPoint() + move))


def _sheared(clip, place, eye, parallel):
    """Return the same of a projection that is given as a matrix."""
    shear, shift = np.eye(4), np.eye(4)
    shear[:2, 2] = -np.array(eye[:2]) / eye[2]
    shear[:2, 3] = -np.array(eye[:2]) if parallel else 0.0
    shift[:2, 3] = place
    found = _vtk.vtkMatrix4x4()
    found.DeepCopy((shift @ clip @ shear).ravel().tolist())
    return found
