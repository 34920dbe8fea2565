"""What the tests of instances share: folders of atlases, and pictures beside references."""

from __future__ import annotations

from collections import deque
from functools import wraps
from types import SimpleNamespace
from weakref import WeakValueDictionary

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.atlas import Atlas
from pvibr.instances.card_layers import PATCH_SIDE
from pvibr.instances.levels import make_model
from pvibr.instances.measure import Layout
from tests.pictures import centroid, depths, grab, place, plotter, reduce, rgba

_QUICK = WeakValueDictionary()  # atlases in use whose errors are measured at few sizes
_KEPT = deque(maxlen=4)  # atlases that the next test may show again, of 80 MB each
_textures = Atlas.textures


def quick(patch):
    """Measure the errors of atlases at three sizes, in one view of each patch of directions.

    And bake few and small views of poses: what is baked takes a quarter of its time.
    """
    patch.setattr('pvibr.instances.measure.LAYOUTS', (Layout(PATCH_SIDE, (8, 16, 32)),))
    patch.setattr('pvibr.instances.levels._atlases', _QUICK)
    patch.setattr('pvibr.figures.pose_atlas.VIEWS', 6)
    patch.setattr('pvibr.figures.pose_atlas.TILES', (32,))


@wraps(_textures)
def textures_of(atlas):
    """Return the textures of an atlas, made once while it is in use."""
    if '_textures' not in vars(atlas):
        atlas._textures = _textures(atlas)
    return atlas._textures


def keep(things):
    """Keep the atlases of instances in use for the next tests."""
    for atlas in things.atlases:
        if not any(atlas is kept for kept in _KEPT):
            _KEPT.append(atlas)


def forget():
    """Let go of what is kept."""
    _KEPT.clear()


@pytest.fixture(scope='module')
def atlases(shared_folder, is_quick):
    """A folder of atlases: what one test baked, the next ones read."""
    return shared_folder / ('quick' if is_quick else 'atlases')


@pytest.fixture(scope='session')
def bean():
    """Something without symmetry, concave, 800 triangles, not around the origin."""
    ball = pv.Sphere(theta_resolution=20, phi_resolution=21)
    x, y, z = ball.points.T
    bent = np.stack([x * (1 + 0.5 * z), 0.6 * y + 0.7 * z * z, z + 0.3 * x], 1)
    mesh = pv.PolyData(bent + np.array([0.3, -0.2, 0.1]), ball.faces)
    mesh['height'] = mesh.points[:, 2].copy()
    mesh['paint'] = np.rint(255 * np.clip(np.abs(ball.points) * 2, 0, 1)).astype(np.uint8)
    mesh.set_active_scalars(None)
    return mesh


def matrices(poses):
    """Return poses as matrices."""
    poses = np.asarray(poses, float)
    if poses.ndim == 3:
        return poses
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    out[:, :3, 3] = poses
    return out


class Scenes:
    """Plotters with instances, and with plain actors in the same places."""

    def __init__(self, folder, tile=128):
        self.folder, self._tile = folder, tile  # texels of images at a forced level
        self._last = None, '', None

    def instances(self, mesh, poses, *, level=None, size=(120, 90), camera=None, **kwargs):
        """Return a plotter with instances and the instances."""
        pl = self.empty(size)
        kwargs = {'show_scalar_bar': False, 'bake': True, 'force_level': level} | kwargs
        folder = self.folder
        with pytest.MonkeyPatch.context() as patch:
            if level is not None:  # whatever its error is
                quick(patch)
                for name, value in (('views', 16), ('tile', self._tile)):
                    patch.setitem(make_model.__kwdefaults__, name, value)
                folder = folder.parent / 'quick'
            things = pl.ibr.add_instances(mesh, poses, cache=folder, **kwargs)
        keep(things)
        return (place(pl, **camera) if camera else pl), things

    def actors(self, mesh, poses, *, size=(120, 90), scale=1, camera=None, **kwargs):
        """Return a plotter with a plain actor at each pose."""
        pl = self.empty(tuple(n * scale for n in size))
        for matrix in matrices(poses):
            actor = pl.add_mesh(mesh, show_scalar_bar=False, name=None, **kwargs)
            actor.user_matrix = matrix
        return place(pl, **camera) if camera else pl

    def empty(self, size=(120, 90)):
        """Return a plotter without anything that smooths edges."""
        return plotter(size)

    def pair(self, mesh, poses, *, level, size=(120, 90), camera, **looks):
        """Return RGBA of the instances and of the supersampled actors."""
        pl, _ = self.instances(mesh, poses, level=level, size=size, camera=camera, **looks)
        drawn = rgba(pl)
        pl.close()

        def draw():
            pl = self.actors(mesh, poses, size=size, scale=4, camera=camera, **looks)
            return reduce(rgba(pl), 4)

        return drawn, self.once(mesh, (poses, size, camera, looks), draw)

    def once(self, mesh, how, draw):
        """Return a reference: the last one if it is of that mesh and looks as asked."""
        with np.printoptions(threshold=10**9, precision=17):
            how = repr(how)
        if self._last[0] is not mesh or self._last[1] != how:
            self._last = mesh, how, draw()
        return self._last[2].copy()


@pytest.fixture(scope='module')
def scenes(atlases):
    """How to make scenes of instances and their references."""
    return Scenes(atlases)


@pytest.fixture(scope='session')
def see():
    """How to look at scenes."""
    return SimpleNamespace(
        grab=grab,
        depths=depths,
        rgba=rgba,
        place=place,
        reduce=reduce,
        centroid=centroid,
        matrices=matrices,
    )
