"""What the tests of instances share: one folder of atlases, and pictures beside references."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk


@pytest.fixture(scope='session')
def atlases(shared_folder):
    """A folder of atlases: what one test baked, the next ones read."""
    return shared_folder / 'atlases'


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


def place(pl, eye, focus=(0, 0, 0), up=(0, 0, 1), angle=30.0, parallel=None):
    """Put the camera somewhere, with a half height of the view where it is parallel."""
    camera = pl.camera
    camera.position, camera.focal_point, camera.up = eye, focus, up
    camera.view_angle = angle
    if parallel is not None:
        camera.parallel_projection = True
        camera.parallel_scale = parallel
    pl.renderer.ResetCameraClippingRange()
    return pl


def grab(pl):
    """Return the colours of a new frame, (h, w, 3) 0 to 1, top row first."""
    window = pl.render_window
    window.Render()
    width, height = window.GetSize()
    pixels = _vtk.vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    rgb = _vtk.vtk_to_numpy(pixels).reshape(height, width, 3)[::-1]
    return rgb / 255.0


def depths(pl):
    """Return distances along the view's axis of what was drawn last, NaN where nothing was."""
    window = pl.render_window
    width, height = window.GetSize()
    values = _vtk.vtkFloatArray()
    window.GetZbufferData(0, 0, width - 1, height - 1, values)
    z = _vtk.vtk_to_numpy(values).reshape(height, width)[::-1].astype(float)
    near, far = pl.camera.clipping_range
    if pl.camera.parallel_projection:
        away = near + z * (far - near)
    else:
        away = near * far / (far - z * (far - near))
    return np.where(z < 1, away, np.nan)


def rgba(pl):
    """Return colours times coverage, and coverage: from a frame on black and one on white."""
    pl.set_background('black')
    dark = grab(pl)
    pl.set_background('white')
    light = grab(pl)
    coverage = 1 - (light - dark).mean(2, keepdims=True)
    return np.concatenate([dark, coverage], 2)


def matrices(poses):
    """Return poses as matrices."""
    poses = np.asarray(poses, float)
    if poses.ndim == 3:
        return poses
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    out[:, :3, 3] = poses
    return out


def reduce(picture, factor):
    """Average squares of pixels."""
    h, w = (n // factor for n in picture.shape[:2])
    return picture.reshape(h, factor, w, factor, -1).mean((1, 3))


def centroid(coverage):
    """Return the middle of what is covered, in pixels: x, y."""
    y, x = np.indices(coverage.shape)
    return np.array([(coverage * x).sum(), (coverage * y).sum()]) / coverage.sum()


class Scenes:
    """Plotters with instances, and with plain actors in the same places."""

    def __init__(self, folder):
        self.folder = folder

    def instances(self, mesh, poses, *, level=None, size=(120, 90), camera=None, **kwargs):
        """Return a plotter with instances and the instances."""
        pl = self.empty(size)
        kwargs.setdefault('show_scalar_bar', False)
        things = pl.ibr.add_instances(mesh, poses, cache=self.folder, force_level=level, **kwargs)
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
        pl = pv.Plotter(window_size=size)
        pl.disable_anti_aliasing()
        return pl

    def pair(self, mesh, poses, *, level, size=(120, 90), camera, **looks):
        """Return RGBA of the instances and of the supersampled actors."""
        pl, _ = self.instances(mesh, poses, level=level, size=size, camera=camera, **looks)
        drawn = rgba(pl)
        pl.close()
        pl = self.actors(mesh, poses, size=size, scale=4, camera=camera, **looks)
        truth = reduce(rgba(pl), 4)
        pl.close()
        return drawn, truth


@pytest.fixture(scope='session')
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
