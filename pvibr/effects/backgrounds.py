"""Backgrounds: an image fixed to the screen, or a sky that turns with the camera."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import naming
from pvibr.core.colors import Color
from pvibr.core.params import Param
from pvibr.effects.full_screen import FullScreen, FullScreenImage
from pvibr.maths.draping import sample
from pvibr.maths.vectors import unit_vectors
from pvibr.textures.projected import Shown

_BLACK = (0.0, 0.0, 0.0)


class _Background(FullScreen):
    """An effect that replaces the renderer's background while a frame is drawn."""

    draws_background = True
    hidden_background: tuple | None = None

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        for effect in self.pipeline.effects if self.pipeline is not None else ():
            is_other = effect is not self and isinstance(effect, _Background)
            if is_other and effect.hidden_background:
                return f'{effect.name} is behind the scene already'
        if frame.renderer.GetLayer() > 0 or frame.renderer.GetPreserveColorBuffer():
            return 'another renderer, such as a background image, is behind this one'
        return super().needed(frame)

    def prepare(self, frame):
        """Draw the scene on black, so that a background can be composited below."""
        self.finish(frame)
        renderer = frame.renderer
        is_gradient = bool(renderer.GetGradientBackground())
        low, high = renderer.GetBackground(), renderer.GetBackground2()
        self.hidden_background = low, is_gradient, bool(renderer.GetTexturedBackground())
        self._background_colors = low, high if is_gradient else low
        renderer.SetBackground(_BLACK)
        renderer.SetGradientBackground(False)
        renderer.SetTexturedBackground(False)

    def finish(self, frame):
        """Restore the renderer's background."""
        if self.hidden_background is not None:
            bottom_color, is_gradient, is_textured = self.hidden_background
            self.hidden_background = None
            frame.renderer.SetBackground(bottom_color)
            frame.renderer.SetGradientBackground(is_gradient)
            frame.renderer.SetTexturedBackground(is_textured)

    def _uniforms(self, frame, size):
        bottom_color, top_color = self._background_colors
        return super()._uniforms(frame, size) | {'low': bottom_color, 'high': top_color}


class Backdrop(_Background, FullScreenImage):
    """An image, image sequence or film behind the scene, fixed to the screen.

    Alpha is kept: a transparent background stays transparent in screenshots.

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

    fit = Param('cover', 'How the image fills `place`.', choices=('contain', 'cover', 'stretch'))

    single = True
    parts = ('image', 'behind', 'backdrop')
    web = 'lost', 'fixed to the screen, which browsers do not have'


class Sky(_Background):
    """A sky that turns with the camera: a panorama or a gradient.

    Alpha is kept: a transparent background stays transparent in screenshots. Under a parallel
    projection, the sky is drawn in perspective with the camera's view angle.

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
    turn = Param(0.0, 'Rotation of the panorama about `up`.', unit='degrees')
    intensity = Param(1.0, 'Brightness factor; above 1 the sky can bloom.', range='[0, 1000]')
    opacity = Param(1.0, "Opacity over the subplot's background.", range='[0, 1]')
    top = Color((0.20, 0.38, 0.70), 'Colour of the gradient at the zenith.')
    horizon = Color((0.80, 0.87, 0.93), 'Colour of the gradient at the horizon.')
    bottom = Color((0.35, 0.33, 0.31), 'Colour of the gradient at the nadir.')
    middle = Param(
        45.0,
        'Angle from the horizon at which the gradient is half done.',
        range='[1, 89]',
        unit='degrees',
    )

    def __init__(self, panorama=None, **settings):
        with naming('panorama', panorama):
            self._image = None if panorama is None else Shown(panorama, repeat=True)
        super().__init__(**settings)

    @property
    def panorama(self):
        """The panorama, None for a gradient."""
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
        """Return the colours of the sky in given directions.

        Parameters
        ----------
        directions : numpy.ndarray, shape (n, 3)
            Unit vectors in world space.
        frame : pvibr.things.frame.Frame
            Frame whose time and background are used.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            Colours in [0, 1].
        """
        sky_directions = directions @ sky_axes(self.up, self.turn).T
        elevation = np.arcsin(np.clip(sky_directions[:, 2:], -1, 1)) / (np.pi / 2)
        if self._image is None:
            end_color = np.where(elevation > 0, self.top, self.bottom)
            end_share = np.abs(elevation) / (1 + self._gradient_bend * (1 - np.abs(elevation)))
            sky_colors = np.array(self.horizon) * (1 - end_share) + end_color * end_share
        else:
            around = 0.5 - np.arctan2(sky_directions[:, 1:2], sky_directions[:, :1]) / (2 * np.pi)
            picture = self._image.picture(frame.time)
            uv = np.hstack([around, 0.5 + 0.5 * elevation])
            sky_colors = sample(picture[..., :3], uv) / 255
        background = (1 - self.opacity) * np.array(frame.renderer.GetBackground())
        return np.clip(self.opacity * self.intensity * sky_colors + background, 0, 1)

    @property
    def _gradient_bend(self) -> float:
        """Bend of the gradient; 0 is linear in the angle."""
        return (2 * self.middle / 90 - 1) / (1 - self.middle / 90)

    def horizon_color(self, frame):
        """Return the mean colour around the horizon."""
        if not (self.opacity and np.any(self.up)):
            return None
        azimuth = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        horizon_directions = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], 1)
        world_directions = horizon_directions @ sky_axes(self.up, self.turn)
        return tuple(self.colors(world_directions, frame).mean(axis=0))

    def directions(self, frame) -> np.ndarray:
        """Return the matrix from positions on the screen to directions.

        Parameters
        ----------
        frame : pvibr.things.frame.Frame
            Frame with the camera.

        Returns
        -------
        numpy.ndarray, shape (3, 3), float64
            Takes (x, y, 1), with x and y from -1 to 1 across the frame, to a direction that is
            not normalized: z up, x towards the centre of the panorama.
        """
        return sky_axes(self.up, self.turn) @ frame.view_from_world[:3, :3].T @ _rays(frame)

    def _uniforms(self, frame, size):
        return super()._uniforms(frame, size) | {
            'sky_from_clip': self.directions(frame),
            'top': self.top,
            'horizon': self.horizon,
            'bottom': self.bottom,
            'bend': self._gradient_bend,
            'amount': (self.opacity, self.intensity),
        }

    def _textures(self, frame):
        if self._image is None:
            return {}
        return {'panorama': self._image.texture(frame.window, frame.time)}


def sky_axes(up, turn):
    """Return the rotation from world space to the sky's space."""
    z = unit_vectors(up)
    panorama_center = np.eye(3)[0] if abs(z[0]) < 0.999 else np.eye(3)[1]
    x = unit_vectors(panorama_center - (panorama_center @ z) * z)
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
        x_scale, y_scale = np.diag(frame.clip_from_view)[:2]
        half_extent = tangent * np.array([y_scale / x_scale, 1.0])
        rays = np.diag([*half_extent, -1.0])
        rays[:2, 2] = half_extent * camera.GetWindowCenter()
        return rays
    x, y, z, w = np.linalg.inv(frame.clip_from_view).T
    # On the near plane z is -1, and w is constant.
    near_plane = w - z
    return np.column_stack([x[:3], y[:3], near_plane[:3]]) / near_plane[3]
