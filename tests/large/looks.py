"""Pictures of large meshes beside those of `add_mesh`."""

import numpy as np

from tests.pictures import place, plotter, shot

SIZE = (320, 240)
OVER = {'eye': (0.4, -1.0, 0.9), 'focus': (0.5, 0.5, 0.0)}
NEAR = {'eye': (0.45, 0.3, 0.12), 'focus': (0.5, 0.5, 0.03)}
FAR = {'eye': (0.4, -4.0, 3.4), 'focus': (0.5, 0.5, 0.0)}
_LARGE = 'max_error', 'cache', 'moving', 'detail'


def drawn(mesh, *, view=OVER, size=SIZE, large=True, **kwargs):
    """Return a plotter that shows a mesh, within an error of places, and what was added."""
    pl = plotter(size)
    pl.set_background('magenta')
    kwargs = {'show_scalar_bar': False, 'detail': 'none'} | kwargs
    if not large:
        kwargs = {name: value for name, value in kwargs.items() if name not in _LARGE}
    # add_mesh stores arrays passed by value in the mesh.
    plain = mesh if large else mesh.copy(deep=False)
    added = pl.ibr.add_large_mesh(mesh, **kwargs) if large else pl.add_mesh(plain, **kwargs)
    place(pl, **view)
    pl.show(auto_close=False)
    return pl, added


def pictures(mesh, **kwargs):
    """Return pictures of a large mesh and of the mesh itself."""
    large, thing = drawn(mesh, **kwargs)
    plain, _ = drawn(mesh, large=False, **kwargs)
    return shot(large), shot(plain), thing


def blocks(picture, side=8):
    """Return the means of square blocks of a picture."""
    height, width = (length // side * side for length in picture.shape[:2])
    picture = picture[:height, :width].reshape(height // side, side, width // side, side, -1)
    return np.asarray(picture, float).mean((1, 3))
