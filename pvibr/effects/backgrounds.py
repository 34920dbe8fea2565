"""Backgrounds: an image fixed to the screen, or a sky that turns with the camera."""

from __future__ import annotations

import numpy as np

from pvibr.core.colors import Color
from pvibr.core.params import Param
from pvibr.effects.full_screen import FullScreen, FullScreenImage
from pvibr.images.projected import Shown
from pvibr.maths.arguments import naming
from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors

_BLACK = (0.0, 0.0, 0.0)


class _Behind(FullScreen):
    """A background that replaces the renderer's own while a frame is drawn."""

    draws_background = True
    hidden_background: tuple | None = None

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        others = self.pipeline.effects if self.pipeline is not None else ()
        for other in others:
            if other is not self and isinstance(other, _Behind) and other.hidden_background:
                return f'{other.name} is behind the scene already'
        if frame.renderer.GetLayer() > 0 or frame.renderer.GetPreserveColorBuffer():
            return 'another renderer, such as a background image, is behind this one'
        return super().needed(frame)

    def prepare(self, frame):
        """Draw the scene on black, so that the background can be composited below it."""
        self.finish(frame)
        renderer = frame.renderer
        gradient, textured = renderer.GetGradientBackground(), renderer.GetTexturedBackground()
        low = renderer.GetBackground()
        self.hidden_background = (low, bool(gradient), bool(textured))
        self._ground = (low, renderer.GetBackground2() if gradient else low)
        renderer.SetBackground(_BLACK)
        renderer.SetGradientBackground(False)
        renderer.SetTexturedBackground(False)

    def finish(self, frame):
        """Restore the renderer's background."""
        if self.hidden_background is not None:
            low, gradient, textured = self.hidden_background
            self.hidden_background = None
            frame.renderer.SetBackground(low)
            frame.renderer.SetGradientBackground(gradient)
            frame.renderer.SetTexturedBackground(textured)

    def _uniforms(self, frame, size):
        low, high = self._ground
        return super()._uniforms(frame, size) | {'low': low, 'high': high}


class Backdrop(_Behind, FullScreenImage):
    """An image, image sequence or film behind the scene, fixed to the screen.

    The alpha of pixels is kept: a transparent background stays transparent in screenshots.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        Image to show; its alpha channel is used.
    **settings
        `opacity`, `fit`, `place`, `fps`, `loop`.

    See Also
    --------
    ImageOverlay : An image over the scene.
    Sky : A background that turns with the camera.

    Examples
    --------
    >>> from pvibr import Backdrop
    >>> Backdrop(np.ones((8, 8, 3)), opacity=0.5).fit
    'cover'
    """

    fit = Param('cover', 'Fit to the rectangle.', choices=('contain', 'cover', 'stretch'))

    single = True
    parts = ('image', 'behind', 'backdrop')
    web = 'lost', 'fixed to the screen, and a browser has no such background'


class Sky(_Behind):
    """A sky that turns with the camera: a panorama or a gradient.

    The alpha of pixels is kept: a transparent background stays transparent in screenshots. Under
    a parallel projection, the sky is drawn in perspective with the camera's view angle.

    Parameters
    ----------
    panorama : path, array, pyvista.Texture or film, optional
        Equirectangular image, 360 x 180 degrees, centred on +x (+y if `up` is along x) and
        rotated by `turn`. A gradient by default.
    **settings
        `up`, `turn`, `intensity`, `opacity`, `top`, `horizon`, `bottom`, `middle`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Sky
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> sky = pl.ibr.add(Sky(top=(0.1, 0.2, 0.5)))
    >>> pl.show()
    """

    single = True
    web = 'baked', 'a dome around the scene'
    neutral = 'opacity', 0
    presets = {
        'evening': {
            'top': (0.13, 0.16, 0.35),
            'horizon': (0.95, 0.62, 0.40),
            'bottom': (0.18, 0.15, 0.16),
        },
        'overcast': {
            'top': (0.62, 0.65, 0.69),
            'horizon': (0.80, 0.81, 0.82),
            'bottom': (0.40, 0.40, 0.39),
        },
    }
    up = Param((0.0, 0.0, 1.0), 'Up direction in world space.')
    turn = Param(0.0, 'Rotation about the up direction.', unit='degrees')
    intensity = Param(1.0, 'Brightness factor; above 1, the sky can bloom.', range='[0, 1000]')
    opacity = Param(1.0, "Opacity over the subplot's background.", range='[0, 1]')
    top = Color((0.20, 0.38, 0.70), 'Colour of the gradient at the zenith.')
    horizon = Color((0.80, 0.87, 0.93), 'Colour of the gradient at the horizon.')
    bottom = Color((0.35, 0.33, 0.31), 'Colour of the gradient at the nadir.')
    middle = Param(
        45.0,
        'Angle from the horizon at which the gradient is half way.',
        range='[1, 89]',
        unit='degrees',
    )

    def __init__(self, panorama=None, **settings):
        with naming('panorama', panorama):
            self._image = None if panorama is None else Shown(panorama, repeat=True)
        super().__init__(**settings)

    @property
    def panorama(self):
        """The panorama; None if the sky is a gradient."""
        return self._image

    def _entries(self):
        return 'behind', 'gradient' if self._image is None else 'panorama', 'sky'

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if not np.any(self.up):
            return 'up is (0, 0, 0): give a direction'
        if self._image is not None and self._image.missing:
            return self._image.missing
        return super().needed(frame)

    def bake_into(self, scene):
        """Add the sky to a scene without pvibr."""
        scene.dome(lambda directions: self.colors(directions, scene.frame))

    def colors(self, directions, frame) -> np.ndarray:
        """Return the colours of the sky in some directions.

        Parameters
        ----------
        directions : numpy.ndarray, shape (n, 3)
            Unit vectors in world space.
        frame : pvibr.core.frame.Frame
            Frame whose time and background are used.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            Colours in [0, 1].
        """
        to = directions @ _axes(self.up, self.turn).T
        rise = np.arcsin(np.clip(to[:, 2:], -1, 1)) / (np.pi / 2)
        if self._image is None:
            end = np.where(rise > 0, self.top, self.bottom)
            share = np.abs(rise) / (1 + self._bend * (1 - np.abs(rise)))
            seen = np.array(self.horizon) * (1 - share) + end * share
        else:
            around = 0.5 - np.arctan2(to[:, 1:2], to[:, :1]) / (2 * np.pi)
            picture = self._image.picture(frame.time)
            seen = sample(picture, np.hstack([around, 0.5 + 0.5 * rise]))[:, :3] / 255
        ground = np.array(frame.renderer.GetBackground())
        return np.clip(self.opacity * self.intensity * seen + (1 - self.opacity) * ground, 0, 1)

    @property
    def _bend(self) -> float:
        """Bend of the gradient: 0 is linear in the angle."""
        return (2 * self.middle / 90 - 1) / (1 - self.middle / 90)

    def horizon_color(self, frame):
        """Return the mean colour around the horizon."""
        if not (self.opacity and np.any(self.up)):
            return None
        angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
        return tuple(self.colors(around @ _axes(self.up, self.turn), frame).mean(axis=0))

    def directions(self, frame) -> np.ndarray:
        """Return the matrix from positions on the screen to directions.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            Frame with the camera.

        Returns
        -------
        numpy.ndarray, shape (3, 3), float64
            Takes (x, y, 1), with x and y from -1 to 1 across the frame, to a direction that is
            not normalized: z up, x towards the centre of the panorama.
        """
        return _axes(self.up, self.turn) @ frame.view_from_world[:3, :3].T @ _rays(frame)

    def _uniforms(self, frame, size):
        return super()._uniforms(frame, size) | {
            'sky_from_clip': self.directions(frame),
            'top': self.top,
            'horizon': self.horizon,
            'bottom': self.bottom,
            'bend': self._bend,
            'amount': (self.opacity, self.intensity),
        }

    def _textures(self, frame):
        if self._image is None:
            return {}
        return {'panorama': self._image.texture(frame.window, frame.time)}


def _axes(up, turn):
    """Return the rotation from world space into the space of the sky."""
    z = unit_vectors(up)
    ahead = np.eye(3)[0] if abs(z[0]) < 0.999 else np.eye(3)[1]
    x = unit_vectors(ahead - (ahead @ z) * z)
    y = np.cross(z, x)
    angle = np.radians(turn)
    return np.array(
        [np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x, z]
    )


def _rays(frame):
    """Return the matrix from (x, y, 1) on the screen to directions in view space."""
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
