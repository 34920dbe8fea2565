"""Billboards that fill a subplot: over the picture, or behind the scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from pvibr.effect import Effect
from pvibr.gl import Texture, shader_source, uniform_matrix
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.params import Param
from pvibr.pictures import Shown, as_rgba

_BLACK = (0.0, 0.0, 0.0)
_MODES = ('over', 'add', 'multiply', 'screen')
_UNSEEN = 1 / 512  # what covers less than that changes no byte


_TEXTS = sections(shader_source(__file__))


class _Screen(Effect):
    """One full-screen program over the picture, with at most one texture of its own."""

    #: Entry points of the shader, the last with ``main``.
    parts: tuple[str, ...] = ()
    #: Whether it covers the picture, and is blended with it in place.
    covers = False

    _image: Any = None

    def render(self, frame, picture):
        """Draw over or behind the picture.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that was drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels.
        """
        size = frame.whole
        uniforms = {'tile': frame.tile, 'size': size, **self._uniforms(frame, size)}
        code = ''.join(_TEXTS[name] for name in ('common', *self._entries()))
        name, textures = f'screen {self.name}', self._textures(frame)
        blend = 'over' if self._covers() else ''
        picture.apply(Pointwise(name, code, uniforms, textures, blend))

    def _covers(self) -> bool:
        return self.covers

    def _entries(self) -> tuple[str, ...]:
        return self.parts

    def _uniforms(self, frame, size) -> dict:
        return {}

    def _textures(self, frame) -> dict:
        return {}

    def release(self):
        """Free what it holds on the GPU and close films; the context is current."""
        if self._image is not None:
            self._image.release()

    def report(self) -> dict:
        """Return the bytes on the GPU."""
        return {'bytes': self._image.nbytes if self._image else 0}


class Vignette(_Screen):
    """Darken the picture towards its corners.

    Parameters
    ----------
    **settings
        `intensity`, `radius`, `softness`, `center`, `color`.

    Examples
    --------
    >>> from pvibr import Vignette
    >>> Vignette(intensity=0.3).radius
    0.4
    """

    parts = ('vignette',)

    intensity = Param(0.5, 'How much is taken away at the outside.', range='[0, 1]')
    radius = Param(
        0.4, 'Where it begins, as a share of half the diagonal: colours within stay.',
        range='[0, 4]',
    )  # fmt: skip
    softness = Param(
        0.6, 'Width of the ring in which it grows, as a share of half the diagonal.',
        range='(0, 4]',
    )  # fmt: skip
    center = Param((0.5, 0.5), 'The middle, from (0, 0) lower left to (1, 1).')
    color = Param(_BLACK, 'What the picture turns to.', range='[0, 1]')

    def needed(self, frame) -> bool | str:
        """Tell whether it darkens anything.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        return self.intensity > 0 or 'intensity is 0'

    def _uniforms(self, frame, size):
        ring = (self.radius, self.softness, self.intensity)
        half = 0.5 * math.hypot(*size)
        away = tuple(edge / half for edge in _away(frame, self.center))
        return {'tint': self.color, 'away': away, 'ring': ring}


class Flash(_Screen):
    """Cover the picture with light that fades.

    Parameters
    ----------
    **settings
        `at`, `duration`, `intensity`, `color`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Flash
    >>> pl = pv.Plotter(off_screen=True)
    >>> flash = pl.ibr.add(Flash(duration=0.5))
    >>> pl.ibr.time = 3.0
    >>> flash.fire()
    >>> flash.cover(3.0), round(flash.cover(3.5), 3)
    (1.0, 0.368)
    >>> pl.close()
    """

    parts = ('flash',)
    covers = True

    at = Param(
        None, 'When it is fired, by pl.ibr.time; None is never.', range='(-inf, inf)', unit='s',
        kind=float,
    )  # fmt: skip
    duration = Param(0.3, 'Time in which it fades by 63 %.', range='(0, inf)', unit='s')
    intensity = Param(1.0, 'How much it covers when it is fired.', range='[0, 1]')
    color = Param((1.0, 1.0, 1.0), 'The light.', range='[0, 1]')

    def fire(self):
        """Fire it now, by the time of the subplot."""
        self.at = float(self.pipeline.time) if self.pipeline is not None else 0.0

    def cover(self, time) -> float:
        """Return how much of the picture it covers.

        Parameters
        ----------
        time : float
            Seconds.

        Returns
        -------
        float
            From 0 to 1.
        """
        if self.at is None or time < self.at:
            return 0.0
        return float(self.intensity * np.exp(-(time - self.at) / self.duration))

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        return self.cover(frame.time) > _UNSEEN or 'no flash at this time'

    def _uniforms(self, frame, size):
        return {'tint': self.color, 'much': self.cover(frame.time)}


class NightVision(_Screen):
    """Show luminance alone, amplified, in one colour and with grain.

    Parameters
    ----------
    **settings
        `intensity`, `gain`, `grain`, `rate`, `seed`, `color`.

    Examples
    --------
    >>> from pvibr import NightVision
    >>> NightVision(gain=8).gain
    8.0
    """

    parts = ('night_vision',)

    intensity = Param(1.0, 'Share of what the tube shows in the picture.', range='[0, 1]')
    gain = Param(
        4.0, 'How much dark parts are amplified: about gain times, white stays white.',
        range='(0, 80]',
    )  # fmt: skip
    grain = Param(0.1, 'How much noise there is, from darkest to brightest.', range='[0, 1]')
    rate = Param(
        25.0, 'Times a second of pl.ibr.time that the noise changes; 0 keeps it.',
        range='[0, 1000]', unit='Hz',
    )  # fmt: skip
    seed = Param(0, 'Another one, another noise.', range='[0, 65535]')
    color = Param((0.35, 1.0, 0.45), 'The light of the tube.', range='[0, 1]')

    def needed(self, frame) -> bool | str:
        """Tell whether the picture changes.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        return self.intensity > 0 or 'intensity is 0'

    def _uniforms(self, frame, size):
        moment = int(np.floor(frame.time * self.rate + 1e-9)) + 65536 * self.seed
        tube = (self.gain, self.grain, self.intensity)
        grid = [n / frame.scale for n in size]
        return {'tint': self.color, 'tube': tube, 'moment': moment % 2**31, 'grid': grid}


class Iris(_Screen):
    """Close the picture around a point, as silent films end.

    Parameters
    ----------
    shape : path, array or pyvista.Texture, optional
        What is bright and opaque is the opening; a circle unless given. It is scaled so that its
        largest inner circle, whose middle lies on `center`, does what the circle would do.
    **settings
        `opening`, `center`, `softness`, `color`.

    Raises
    ------
    ValueError
        Where no pixel of the shape is bright.

    Examples
    --------
    >>> from pvibr import Iris
    >>> Iris(opening=0.25, center=(0.3, 0.6)).opening
    0.25
    """

    covers = True

    opening = Param(
        0.5, 'How far it is open: 0 shows nothing, 1 the whole picture.', range='[0, 1]'
    )
    center = Param(
        (0.5, 0.5), 'What it closes around, from (0, 0) lower left to (1, 1).', range='[0, 1]'
    )
    softness = Param(
        0.0, 'Width of its edge, as a share of the height; a pixel at least.', range='[0, 1]'
    )
    color = Param(_BLACK, 'What covers the rest.', range='[0, 1]')

    def __init__(self, shape=None, **settings):
        self._shape = None if shape is None else _shape_of(shape)
        self._distances: Texture | None = None
        super().__init__(**settings)

    def _entries(self):
        return 'disk' if self._shape is None else 'shape', 'iris'

    def needed(self, frame) -> bool | str:
        """Tell whether it covers anything.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        return self.opening < 1 or 'opening is 1'

    def _uniforms(self, frame, size):
        soft = max(self.softness * size[1], 1.0)
        away = (max(c, 1 - c) * n for c, n in zip(self.center, size, strict=True))
        reach = self.opening * (math.hypot(*away) + soft)
        found = {'tint': self.color, 'away': _away(frame, self.center), 'reach': (reach, 1 / soft)}
        return found if self._shape is None else found | {'scale': self._shape[1]}

    def _textures(self, frame):
        if self._shape is None:
            return {}
        if self._distances is None:
            self._distances = Texture(frame.window, filter='linear').upload(self._shape[0][::-1])
        return {'shape': self._distances}

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        super().release()
        if self._distances is not None:
            self._distances.release()
        self._distances = None

    def report(self) -> dict:
        """Return the bytes on the GPU."""
        return {'bytes': self._distances.nbytes if self._distances else 0}


class _Image(_Screen):
    """What a picture over the scene and one behind it have in common."""

    opacity = Param(1.0, 'How much of the picture is seen.', range='[0, 1]')
    fit = Param(
        'contain', 'How it fills its place: whole, cut to the shape of the place, or stretched.',
        choices=('contain', 'cover', 'stretch'),
    )  # fmt: skip
    place = Param(
        (0.0, 0.0, 1.0, 1.0), 'Left, bottom, right, top of where it is, as shares of the subplot.'
    )
    fps = Param(
        None, "Pictures of a sequence per second of pl.ibr.time; by default the film's own.",
        range='(0, inf)', kind=float,
    )  # fmt: skip
    loop = Param(True, 'Whether a sequence begins again after its end, or its last is held.')

    def __init__(self, image, **settings):
        self._image = Shown(image)
        super().__init__(**settings)

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        left, bottom, right, top = self.place
        if not (left < right and bottom < top):
            return f'place = {self.place} is empty: left < right and bottom < top'
        if self._image.missing:
            return self._image.missing
        return self.opacity > 0 or 'opacity is 0'

    def _uniforms(self, frame, size):
        edges = _fitted(self.place, self.fit, self._image.size, size)
        return {'frame': edges, 'bounds': self.place, 'opacity': self.opacity}

    def _textures(self, frame):
        return {'image': self._image.texture(frame.window, frame.time, self.fps, self.loop)}


class Picture(_Image):
    """Lay an image, a sequence or a film over the picture: a title, a logo, a frame.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.pictures.Shown`; its alpha counts.
    **settings
        `mode`, `opacity`, `fit`, `place`, `fps`, `loop`.

    See Also
    --------
    Backdrop : Behind the scene.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr import Picture
    >>> Picture(np.ones((8, 8, 3)), place=(0.8, 0.8, 1, 1), opacity=0.5).mode
    'over'
    """

    mode = Param('over', 'How it meets the picture.', choices=_MODES)

    def _covers(self):
        return self.mode == 'over'

    def _entries(self):
        return 'image', 'picture' if self._covers() else 'mixed'

    def _uniforms(self, frame, size):
        found = super()._uniforms(frame, size)
        return found if self._covers() else found | {'mode': _MODES.index(self.mode)}


class _Behind(_Screen):
    """What shows where the scene does not: the renderer's background is away meanwhile."""

    _hidden: tuple | None = None

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        others = self.pipeline.effects if self.pipeline is not None else ()
        for other in others:
            if other is not self and isinstance(other, _Behind) and other._hidden:
                return f'{other.name} is behind the scene already'
        if frame.renderer.GetLayer() > 0 or frame.renderer.GetPreserveColorBuffer():
            return 'another renderer, such as a background image, is behind this one'
        return super().needed(frame)

    def prepare(self, frame):
        """Take the background away, so that what shows through can be told from the scene.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        self.finish(frame)
        renderer = frame.renderer
        gradient, textured = renderer.GetGradientBackground(), renderer.GetTexturedBackground()
        low = renderer.GetBackground()
        self._hidden = (low, bool(gradient), bool(textured))
        self._ground = (low, renderer.GetBackground2() if gradient else low)
        renderer.SetBackground(_BLACK)
        renderer.SetGradientBackground(False)
        renderer.SetTexturedBackground(False)

    def finish(self, frame):
        """Put the background back.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that was drawn.
        """
        if self._hidden is not None:
            low, gradient, textured = self._hidden
            self._hidden = None
            frame.renderer.SetBackground(low)
            frame.renderer.SetGradientBackground(gradient)
            frame.renderer.SetTexturedBackground(textured)

    def _uniforms(self, frame, size):
        low, high = self._ground
        return super()._uniforms(frame, size) | {'low': low, 'high': high}


class Backdrop(_Behind, _Image):
    """Put an image, a sequence or a film behind the scene; it does not turn with the camera.

    The alpha of pixels stays: screenshots with a transparent background have it so still.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.pictures.Shown`; its alpha counts.
    **settings
        `opacity`, `fit`, `place`, `fps`, `loop`.

    See Also
    --------
    Picture : Over the scene.
    Sky : Turns with the camera.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr import Backdrop
    >>> Backdrop(np.ones((8, 8, 3)), fit='cover').fit
    'cover'
    """

    parts = ('image', 'behind', 'backdrop')


class Sky(_Behind):
    """Put a sky behind the scene that turns with the camera: a panorama, or a gradient.

    The alpha of pixels stays: screenshots with a transparent background have it so still. With a
    parallel projection, it is seen as a camera with the same view angle would see it.

    Parameters
    ----------
    panorama : path, array, pyvista.Texture or film, optional
        Equirectangular: 360 degrees wide, 180 high, its middle towards +x (+y where `up` is x)
        turned by `turn`. Without it, a gradient.
    **settings
        `up`, `turn`, `strength`, `opacity`, `top`, `horizon`, `bottom`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Sky
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> sky = pl.ibr.add(Sky(top=(0.1, 0.2, 0.5)))
    >>> pl.show()
    """

    up = Param((0.0, 0.0, 1.0), 'Where up is in the world.')
    turn = Param(0.0, 'How far it is turned about up.', unit='degrees')
    strength = Param(
        1.0, 'What its colours are multiplied by: above 1 it shines.', range='[0, 1000]'
    )
    opacity = Param(
        1.0, "How much of it is seen, before the subplot's background.", range='[0, 1]'
    )
    top = Param((0.20, 0.38, 0.70), 'Colour of the gradient above.', range='[0, 1]')
    horizon = Param((0.80, 0.87, 0.93), 'Colour of the gradient at the horizon.', range='[0, 1]')
    bottom = Param((0.35, 0.33, 0.31), 'Colour of the gradient below.', range='[0, 1]')

    def __init__(self, panorama=None, **settings):
        self._image = None if panorama is None else Shown(panorama, repeat=True)
        super().__init__(**settings)

    def _entries(self):
        return 'behind', 'gradient' if self._image is None else 'panorama', 'sky'

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        if not np.any(self.up):
            return 'up is (0, 0, 0): give a direction'
        if self._image is not None and self._image.missing:
            return self._image.missing
        return super().needed(frame) if self.opacity > 0 else 'opacity is 0'

    def directions(self, frame) -> np.ndarray:
        """Return what brings a place on the screen to a direction.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The camera's frame.

        Returns
        -------
        numpy.ndarray, shape (3, 3), float64
            Applied to (x, y, 1), x and y from -1 to 1 across what is drawn: a direction, not
            normalized, z up, x to the middle of the panorama.
        """
        return _axes(self.up, self.turn) @ frame.view_from_world[:3, :3].T @ _rays(frame)

    def _uniforms(self, frame, size):
        return super()._uniforms(frame, size) | {
            'sky_from_clip': uniform_matrix(self.directions(frame)),
            'top': self.top,
            'horizon': self.horizon,
            'bottom': self.bottom,
            'amount': (self.opacity, self.strength),
        }

    def _textures(self, frame):
        if self._image is None:
            return {}
        return {'panorama': self._image.texture(frame.window, frame.time)}


def _away(frame, center):
    """Return where what is drawn begins, as seen from a place, and its size; in pixels."""
    (left, bottom, right, top), (width, height) = frame.tile, frame.whole
    return (
        (left - center[0]) * width,
        (bottom - center[1]) * height,
        (right - left) * width,
        (top - bottom) * height,
    )


def _fitted(place, fit, image, size):
    """Return where the edges of an image are, as shares of the subplot."""
    low, high = np.array(place[:2]), np.array(place[2:])
    pixels = (high - low) * size
    scale = pixels / image
    if fit != 'stretch':
        scale = np.full(2, scale.min() if fit == 'contain' else scale.max())
    half = scale * image / size / 2
    middle = (low + high) / 2
    return (*(middle - half), *(middle + half))


def _shape_of(image):
    """Return distances to the edge of what is bright, and its inner circle in texture space."""
    pixels = as_rgba(image) / 255.0
    bright = np.pad(pixels[..., :3].mean(axis=-1) * pixels[..., 3] > 0.5, 2)
    if not bright.any():
        msg = 'shape has no bright pixel: white, or opaque on transparent, is where it is open'
        raise ValueError(msg)
    inside = distance_transform_edt(bright)
    away = np.where(bright, inside - 0.5, 0.5 - distance_transform_edt(~bright))
    away = gaussian_filter(away, 1.0)  # else its edge has steps where it is seen large
    row, column = np.unravel_index(inside.argmax(), inside.shape)
    radius, (height, width) = away.max(), bright.shape
    middle = ((column + 0.5) / width, 1 - (row + 0.5) / height)
    return (away / radius).astype(np.float32), (*middle, radius / width, radius / height)


def _axes(up, turn):
    """Return the rows that bring a direction in the world into the sky's space."""
    z = np.array(up) / np.linalg.norm(up)
    ahead = np.eye(3)[0] if abs(z[0]) < 0.999 else np.eye(3)[1]
    x = ahead - (ahead @ z) * z
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    angle = np.radians(turn)
    return np.array(
        [np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x, z]
    )


def _rays(frame):
    """Return what brings (x, y, 1) on the screen to a direction in view space."""
    if frame.parallel:
        camera = frame.renderer.GetActiveCamera()
        tangent = np.tan(np.radians(camera.GetViewAngle()) / 2)
        half = tangent * np.array([frame.renderer.GetTiledAspectRatio(), 1.0])
        rays = np.diag([*half, -1.0])
        rays[:2, 2] = half * camera.GetWindowCenter()
        return rays
    near = np.linalg.inv(frame.clip_from_view)
    # On the near plane, z is -1 and w is the same everywhere.
    away = near[3, 3] - near[3, 2]
    return np.column_stack([near[:3, 0], near[:3, 1], near[:3, 3] - near[:3, 2]]) / away
