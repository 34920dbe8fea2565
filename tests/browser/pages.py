"""What tests ask of views in pages: their pictures, and what these should be."""

from __future__ import annotations

import base64
import contextlib
import io
import time

import imageio.v3 as imageio
import numpy as np

from tests.browser import everything

#: Mean difference of 8-bit colours that JPEG may make.
JPEG = 3.0


def difference(a, b):
    """Return the mean difference of two pictures, inf where their sizes differ."""
    return np.abs(np.subtract(a, b, dtype=float)).mean() if a.shape == b.shape else np.inf


_AS_PNG = """image => {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  canvas.getContext('2d').drawImage(image, 0, 0);
  return canvas.toDataURL().split(',')[1];
}"""


_TRIGGER = """([name, args]) => Promise.race([
  trame.trigger(name, args),
  new Promise((_, fail) => setTimeout(() => fail(new Error(`no answer to ${name}`)), 120000)),
])"""


def pixels_of(image):
    """Return the pixels of an image of a page, whatever its size there."""
    end = time.monotonic() + 60
    # While an image is loading it has no pixels, and a canvas of none is no file.
    while not (data := image.evaluate(_AS_PNG)):
        assert time.monotonic() < end, 'an image that is not loaded'
        time.sleep(0.05)
    return imageio.imread(io.BytesIO(base64.b64decode(data)), extension='.png')[..., :3]


class View:
    """A view of trame in a page, or in a frame of one."""

    def __init__(self, page, picture_of, until, place=None):
        self.page, self._picture_of, self._until = page, picture_of, until
        self._place = place or page
        self._place.locator('img').wait_for()

    @classmethod
    def opened(cls, page, program, picture_of, until):
        """Open the page of :mod:`everything`."""
        page.set_viewport_size({'width': 480, 'height': 320})
        page.goto(program.url)
        return cls(page, picture_of, until)

    def tell(self, name, *args):
        """Call a trigger of the application; Playwright itself would wait forever."""
        return self.page.evaluate(_TRIGGER, [name, args])

    @property
    def picture(self):
        """What is seen; in a frame, which may lie between two pixels, what its image holds."""
        image = self._place.locator('img')
        return self._picture_of(image) if self._place is self.page else pixels_of(image)

    @property
    def size(self):
        """Width and height, once the picture is of the size that it has in the page."""
        sizes = 'i => [i.naturalWidth, i.naturalHeight, i.clientWidth, i.clientHeight]'

        def fits():
            *size, width, height = self._place.locator('img').evaluate(sizes)
            return size if size == [width, height] else None

        return self._until(fits)

    def resize(self, width, height):
        """Give the page another size, and wait until the plotter has it."""
        for slightly_wider in (0, 2, 0, 4, 0):
            # A closed tab's last request may still arrive later than this one's: ask again.
            self.page.set_viewport_size({'width': width + slightly_wider, 'height': height})
            with contextlib.suppress(AssertionError):
                size = [width + slightly_wider, height]
                self._until(lambda size=size: self.tell('look')['size'] == size, seconds=20.0)
                if not slightly_wider:
                    return
        raise AssertionError(f'the plotter never had {width} x {height}')

    def shows(self, expected, bound=JPEG):
        """Wait until a picture is seen; return how far it is from it."""
        seen = []

        def near():
            seen.append(difference(self.picture, expected))
            return seen[-1] <= bound

        with contextlib.suppress(AssertionError):
            self._until(near)
        return min(seen)

    def drag(self, start, end, steps=4):
        """Drag with the left button, positions as shares of the view."""
        box = self._place.locator('canvas').bounding_box()
        places = np.linspace(start, end, steps + 1) * [box['width'], box['height']]
        places += [box['x'], box['y']]
        mouse = self.page.mouse
        mouse.move(*places[0])
        mouse.down()
        for place in places[1:]:
            mouse.move(*place)
        mouse.up()


class Reference:
    """The same scene off screen, in this process."""

    def __init__(self, **looks):
        self._pl = everything.plotter(**looks)
        self._pl.show(auto_close=False)

    def picture(self, look, name, column=0, **settings):
        """Return the picture from a camera, of one effect or thing."""
        pl = self._pl
        pl.subplot(0, column)
        pl.window_size = look['size']
        pl.camera_position = look['camera']
        pl.ibr.time = look['time']
        everything.show_only(pl, name)
        for key, value in settings.items():
            setattr(pl.ibr.effects[0], key, value)
        pl.render()
        return pl.screenshot(return_img=True)
