"""What is behind the scene: an image, or a sky that turns with the camera."""

from __future__ import annotations

import numpy as np

from pvibr.core.params import Param
from pvibr.effects.full_screen import FullScreen, FullScreenImage
from pvibr.images.projected import Shown
from pvibr.maths.draping import sample

_BLACK = (0.0, 0.0, 0.0)


class _Behind(FullScreen):
    """What shows where the scene does not: the renderer's background is away meanwhile."""

    _hidden: tuple | None = None

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen."""
        others = self.pipeline.effects if self.pipeline is not None else ()
        for other in others:
            if other is not self and isinstance(other, _Behind) and other._hidden:
                return f'{other.name} is behind the scene already'
        if frame.renderer.GetLayer() > 0 or frame.renderer.GetPreserveColorBuffer():
            return 'another renderer, such as a background image, is behind this one'
        return super().needed(frame)

    def prepare(self, frame):
        """Take the background away, so that what shows through can be told from the scene."""
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
        """Put the background back."""
        if self._hidden is not None:
            low, gradient, textured = self._hidden
            self._hidden = None
            frame.renderer.SetBackground(low)
            frame.renderer.SetGradientBackground(gradient)
            frame.renderer.SetTexturedBackground(textured)

    def _uniforms(self, frame, size):
        low, high = self._ground
        return super()._uniforms(frame, size) | {'low': low, 'high': high}


class Backdrop(_Behind, FullScreenImage):
    """Put an image, a sequence or a film behind the scene; it does not turn with the camera.

    The alpha of pixels stays: screenshots with a transparent background have it so still.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.images.projected.Shown`; its alpha counts.
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
    web = 'lost', 'stays with the screen, and a browser has no such background'


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

    web = 'baked', 'a dome around the scene'
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

    @property
    def panorama(self):
        """The picture that is shown; None is a gradient."""
        return self._image

    def _entries(self):
        return 'behind', 'gradient' if self._image is None else 'panorama', 'sky'

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen."""
        if not np.any(self.up):
            return 'up is (0, 0, 0): give a direction'
        if self._image is not None and self._image.missing:
            return self._image.missing
        return super().needed(frame) if self.opacity > 0 else 'opacity is 0'

    def bake_into(self, scene):
        """Hand it to a scene without pvibr."""
        scene.dome(lambda directions: self.colors(directions, scene.frame))

    def colors(self, directions, frame) -> np.ndarray:
        """Return what is seen of it in some directions.

        Parameters
        ----------
        directions : numpy.ndarray, shape (n, 3)
            World space, of length 1.
        frame : pvibr.core.frame.Frame
            Its time and what is behind it.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            0 to 1.
        """
        to = directions @ _axes(self.up, self.turn).T
        rise = np.arcsin(np.clip(to[:, 2:], -1, 1)) / (np.pi / 2)
        if self._image is None:
            end = np.where(rise > 0, self.top, self.bottom)
            seen = np.array(self.horizon) * (1 - np.abs(rise)) + end * np.abs(rise)
        else:
            around = 0.5 - np.arctan2(to[:, 1:2], to[:, :1]) / (2 * np.pi)
            picture = self._image.picture(frame.time)
            seen = sample(picture, np.hstack([around, 0.5 + 0.5 * rise]))[:, :3] / 255
        ground = np.array(frame.renderer.GetBackground())
        return np.clip(self.opacity * self.strength * seen + (1 - self.opacity) * ground, 0, 1)

    def directions(self, frame) -> np.ndarray:
        """Return what brings a place on the screen to a direction.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
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
            'sky_from_clip': self.directions(frame),
            'top': self.top,
            'horizon': self.horizon,
            'bottom': self.bottom,
            'amount': (self.opacity, self.strength),
        }

    def _textures(self, frame):
        if self._image is None:
            return {}
        return {'panorama': self._image.texture(frame.window, frame.time)}


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
