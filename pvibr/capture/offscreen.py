"""An off-screen stage: the same scene drawn by VTK and by pvibr, read back and timed."""

from __future__ import annotations

import time

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.frame import Frame
from pvibr.gl.offscreen import read_pixels
from pvibr.instances.atlas import bounding_sphere
from pvibr.maths.image_error import box_reduce

#: Samples of a reference along a side of a pixel.
SAMPLES = 4
#: Multisamples that are measured: what PyVista asks of the driver by default, and none.
MULTI_SAMPLES = 8, 0
SKY = '#dfe9f0'


class Stage:
    """An off-screen window that draws as ``pv.Plotter`` does, or `samples` squared per pixel."""

    def __init__(
        self,
        size,
        ground=None,
        view_angle=30.0,
        samples=1,
        background=SKY,
        lights=(),
        multi_samples=None,
    ):
        # Depths, coverage, and what is compared with rays through the middles of pixels, need
        # one sample per pixel: multi_samples=0.
        self.samples = samples
        pixels = [int(n) * samples for n in size]
        self.plotter = pv.Plotter(
            off_screen=True, window_size=pixels, lighting='none' if lights else 'light kit'
        )
        for light in lights:
            self.plotter.add_light(light)
        self.plotter.set_background(background)
        self.plotter.camera.view_angle = view_angle
        if samples > 1:  # averaged already
            multi_samples = 0
        if multi_samples is not None:  # else as PyVista's theme has it
            self.window.SetMultiSamples(multi_samples)
        self.ground = None
        if ground is not None:
            self.ground = add_ground(self.plotter, ground)
        self.bounds: tuple[float, ...] | None = None
        self._shown = False

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def close(self):
        """Release everything."""
        self.plotter.close()

    @property
    def window(self):
        """The VTK window."""
        return self.plotter.ren_win

    @property
    def renderer(self):
        """The only renderer."""
        return self.plotter.renderer

    def add(self, actors):
        """Put actors in, as they are."""
        for actor in actors:
            self.renderer.AddViewProp(actor)

    def look(self, camera):
        """Take a camera; near and far follow :attr:`bounds` where it is set."""
        self.plotter.camera_position = camera
        if not self._shown:
            self.plotter.show(auto_close=False)
            self._shown = True
        # Equal clipping planes for all scenes, so that depths can be compared.
        self.renderer.ResetCameraClippingRange(*([self.bounds] if self.bounds else []))

    def draw(self) -> float:
        """Draw a frame, wait for completion, and return its seconds."""
        start = time.perf_counter()
        self.window.Render()
        self.window.WaitForCompletion()
        return time.perf_counter() - start

    def seconds(self, cameras, limit=np.inf) -> np.ndarray:
        """Return the seconds of a frame per camera, after a warm-up frame."""
        self.look(cameras[0])
        self.draw()
        found: list[float] = []
        for camera in cameras:
            if sum(found) < limit:
                self.look(camera)
                found.append(self.draw())
        return np.array(found)

    def driver(self) -> str:
        """Return the name of the OpenGL renderer."""
        self.look([(0, 0, 1), (0, 1, 1), (0, 0, 1)])
        self.draw()
        lines = self.window.ReportCapabilities().splitlines()
        names = [line.split(':', 1)[1].strip() for line in lines if 'renderer string' in line]
        return (names or ['unknown'])[0]

    def frame(self) -> Frame:
        """Return the next frame's size, camera and clipping range."""
        return Frame.of(self.renderer)

    def picture(self) -> np.ndarray:
        """Draw a frame and return its colours, (h, w, 3), 0 to 1, top row first."""
        self.draw()
        return self.read()

    def read(self) -> np.ndarray:
        """Return the colours of the last frame, (h, w, 3), 0 to 1, top row first."""
        return box_reduce(self.pixels(), self.samples) / 255

    def pixels(self) -> np.ndarray:
        """Return the pixels of the last frame as shown, (h * samples, w * samples, 3), uint8."""
        return read_pixels(self.window)[::-1]

    def depth(self) -> np.ndarray:
        """Return the depth buffer of the last frame, (h * samples, w * samples)."""
        data = _vtk.vtkFloatArray()
        width, height = self.window.GetSize()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, data)
        return _vtk.vtk_to_numpy(data).reshape(height, width)[::-1].copy()

    def coverage(self) -> np.ndarray:
        """Return the coverage of each pixel by all but ground and background, (h, w), 0 to 1.

        VTK averages multisamples as light, so that differences of colours are no shares of them.
        """
        white, black = (self._before(color) for color in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
        return np.clip(1 - (white - black).mean(-1), 0, 1)

    def _before(self, color):
        renderer, ground = self.renderer, self.ground
        kept = renderer.GetBackground()
        renderer.SetBackground(color)
        if ground is not None:
            ground.mapper.SetScalarVisibility(False)
            ground.prop.lighting, ground.prop.color = False, color
        picture = self.picture()
        renderer.SetBackground(kept)
        if ground is not None:
            ground.mapper.SetScalarVisibility(True)
            ground.prop.lighting = True
        return picture


def add_ground(plotter, ground):
    """Add a ground to a plotter and return its actor."""
    actor = plotter.add_mesh(ground, scalars='color_rgb', rgb=True)
    if ground.point_data.active_normals is not None:
        actor.prop.interpolation = 'Phong'  # not smooth_shading, which computes them anew
    return actor


def covered(depth, ground_depth, samples) -> np.ndarray:
    """Return coverage from depth buffers with and without objects."""
    return box_reduce(depth != ground_depth, samples)


def mesh_actors(meshes, poses, index) -> list:
    """Return VTK actors of the full meshes, one per part and pose."""
    return [
        _mesh_actor(part, pose) for pose, k in zip(poses, index, strict=True) for part in meshes[k]
    ]


def _mesh_actor(part, pose):
    matrix = _vtk.vtkMatrix4x4()
    matrix.DeepCopy(pose.ravel().tolist())
    actor = part.new_actor(part.actor.GetMapper())
    actor.SetUserMatrix(matrix)
    return actor


def spheres(meshes, poses, index):
    """Return the bounding spheres of instances: centres (n, 3) and radii (n,)."""
    own = [bounding_sphere(np.concatenate([p.mesh.points for p in parts])) for parts in meshes]
    center, radius = (np.array(a)[index] for a in zip(*own, strict=True))
    stretch = np.linalg.norm(poses[:, :3, :3], axis=1).max(1)
    return np.einsum('nij,nj->ni', poses[:, :3, :3], center) + poses[:, :3, 3], radius * stretch


def in_view(frame, centers, radii):
    """Return the numbers of the spheres in a perspective view, nearest first."""
    view, clip = frame.view_from_world, frame.clip_from_view
    x, y, z = (centers @ view[:3, :3].T + view[:3, 3]).T
    wide, high = 1 / clip[0, 0], 1 / clip[1, 1]
    seen = -z > -radii
    for across, tangent in ((x, wide), (y, high)):
        seen &= np.abs(across) < -z * tangent + radii * np.hypot(1, tangent)
    rows = np.flatnonzero(seen)
    away = np.linalg.norm(centers[rows] - frame.eye, axis=1)
    return rows[np.argsort(away)]
