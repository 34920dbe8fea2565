"""A wide blur as small blurs of small images."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from pvibr.gl.feature import sections
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import Target

# llvmpipe samples whole floats faster than half ones, and these images are small.
_FORMAT = ('rgba32f',)
_X, _Y = (1.0, 0.0), (0.0, 1.0)


def halving_taps(kernel):
    """Return the bilinear taps of a Gaussian that halves an image along one axis.

    Parameters
    ----------
    kernel : int
        Texels of the smaller image that it spans; odd.

    Returns
    -------
    places : numpy.ndarray, shape (kernel,), float64
        Texels of the larger image from the middle of the smaller one's texel.
    weights : numpy.ndarray, shape (kernel,), float64
        With the sum 1.

    Examples
    --------
    >>> from pvibr.gl.blur import halving_taps
    >>> halving_taps(1)
    (array([0.]), array([1.]))
    """
    texels = np.arange(2 * kernel) - kernel + 0.5
    weights = np.exp(-0.5 * (texels * 3 / kernel) ** 2).reshape(-1, 2)
    pairs = weights.sum(axis=1)
    places = (texels.reshape(-1, 2) * weights).sum(axis=1) / pairs
    return places, pairs / pairs.sum()


def halves(size, times=1) -> tuple[int, int]:
    """Return a size halved, rounded up so that nothing is lost.

    Parameters
    ----------
    size : tuple of 2 int
        Width and height.
    times : int
        How often.

    Returns
    -------
    tuple of 2 int
        At least 1 each.
    """
    return -(-size[0] // 2**times), -(-size[1] // 2**times)


@contextmanager
def filtered(texture):
    """Have a texture, whoever made it, sampled linearly within.

    Not for longer: where a picture is read pixel by pixel, neighbours of weight zero that are no
    numbers would spread.

    Parameters
    ----------
    texture : pvibr.gl.Texture
        Of colours.
    """
    to = texture.object
    found = to.GetMagnificationFilter(), to.GetMinificationFilter()
    to.SetMagnificationFilter(to.Linear)
    to.SetMinificationFilter(to.Linear)
    try:
        yield
    finally:
        to.SetMagnificationFilter(found[0])
        to.SetMinificationFilter(found[1])


class Blur:
    """Blurs an image: its result is of half the size, and as bright in sum.

    Parameters
    ----------
    window : vtkOpenGLRenderWindow
        The window whose context holds it.
    size : tuple of 2 int
        Width and height of what is blurred, in texels.
    levels : int
        How often it is halved; each doubles the width of the widest part.
    kernel : int
        See :func:`halving_taps`.

    Attributes
    ----------
    source : Target
        Of that size: a place to draw the image.
    """

    def __init__(self, window, size, levels, kernel):
        self.key = size, levels, kernel
        text = sections(shader_source(__file__))
        self._halve = Quad(window, _constants(kernel) + text['halve'], 'blur halve')
        self._mix = Quad(window, text['mix'], 'blur mix')
        self._any = Quad(window, text['any'], 'blur any')
        self._blend = Quad(window, text['blend'], 'blur blend')
        self._most = _target(window, halves(size, 4))
        self.source = _target(window, size)
        self._levels = [_Level(window, halves(size, k)) for k in range(levels)]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(target.nbytes for target in self._targets())

    def _targets(self):
        return [self.source, self._most, *(t for level in self._levels for t in level.targets)]

    def is_dark(self) -> bool:
        """Tell whether there is no light in `source`, where it was drawn: waits for the GPU."""
        with self._most.drawing():
            self._any.draw(None, {'light': self.source.colors[0]})
        return not self._most.colors[0].download()[..., :3].any()

    def draw(self, image, spread):
        """Blur.

        Parameters
        ----------
        image : pvibr.gl.Texture
            Of the size that it was made for, filtered linearly.
        spread : float
            From 0, the narrowest blur alone, to 1, the widest alone: the share of all wider
            levels in each.

        Returns
        -------
        pvibr.gl.Texture
            Half the size.
        """
        for level in self._levels:
            with level.tall.drawing():
                self._halve.draw({'axis': _X}, {'image': image})
            with level.small.drawing():
                self._halve.draw({'axis': _Y}, {'image': level.tall.colors[0]})
            image = level.small.colors[0]
        for level in reversed(self._levels[:-1]):
            images = {'image': level.small.colors[0], 'wide': image}
            with level.mixed.drawing():
                self._mix.draw({'share': spread}, images)
            image = level.mixed.colors[0]
        return image

    def blend(self, picture, light, scale, *, intensity=1.0, screen=False, alone=False):
        """Draw a picture with light on it.

        Parameters
        ----------
        picture : pvibr.gl.picture.Picture
            Read and drawn.
        light : pvibr.gl.Texture
            Filtered linearly.
        scale : int
            Pixels of the picture to a texel of the light.
        intensity : float
            What the light is multiplied by.
        screen : bool
            Light fills what is left to white, else it is added.
        alone : bool
            The light without the picture.
        """
        uniforms = {
            'place': [1 / (scale * texels) for texels in light.size],
            'keep': float(not alone),
            'intensity': intensity,
            'screen': float(screen),
        }
        with picture.drawing():
            self._blend.draw(uniforms, {'color': picture.color, 'light': light})

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        for quad in (self._halve, self._mix, self._any, self._blend):
            quad.release()
        for target in self._targets():
            target.release()


class _Level:
    def __init__(self, window, size):
        width, height = halves(size)
        self.tall = _target(window, (width, size[1]))
        self.small = _target(window, (width, height))
        self.mixed = _target(window, (width, height))
        self.targets = self.tall, self.small, self.mixed


def _target(window, size):
    return Target(window, size[0], size[1], _FORMAT)


def _constants(kernel):
    places, weights = halving_taps(kernel)
    text = f'#define PAIRS {kernel}\n'
    for name, values in (('PLACES', places), ('WEIGHTS', weights)):
        numbers = ', '.join(f'{v:.9f}' for v in values)
        text += f'const float {name}[{kernel}] = float[{kernel}]({numbers});\n'
    return text
