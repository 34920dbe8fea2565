"""An off-screen stage on which a scene is drawn by VTK and by pvibr, read back and timed."""

from __future__ import annotations

import time

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl.driver import capabilities_of
from pvibr.gl.hidden_window import read_pixels
from pvibr.instances.atlas import bounding_sphere
from pvibr.maths.image_error import box_reduce
from pvibr.things.frame import Frame

#: Samples along a pixel's side in reference pictures.
SAMPLES = 4
#: Multisamples to measure: PyVista's default, and none.
MULTI_SAMPLES = 8, 0
SKY = '#dfe9f0'


class Stage:
    """An off-screen ``pv.Plotter``, or one of `samples` squared pixels per pixel."""

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
        # Depths, coverage and comparisons with rays through pixel centres need one sample per
        # pixel: multi_samples=0.
        self.samples = samples
        pixel_size = [int(n) * samples for n in size]
        self.plotter = pv.Plotter(
            off_screen=True, window_size=pixel_size, lighting='none' if lights else 'light kit'
        )
        for light in lights:
            self.plotter.add_light(light)
        self.plotter.set_background(background)
        self.plotter.camera.view_angle = view_angle
        if samples > 1:  # supersampled instead
            multi_samples = 0
        if multi_samples is not None:  # otherwise PyVista's theme decides
            self.window.SetMultiSamples(multi_samples)
        self.ground = None
        if ground is not None:
            self.ground = add_ground(self.plotter, ground)
        self.bounds: tuple[float, ...] | None = None
        self._is_shown = False

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
        """Add actors unchanged."""
        for actor in actors:
            self.renderer.AddViewProp(actor)

    def look(self, camera):
        """Set the camera; :attr:`bounds`, if set, define near and far planes."""
        self.plotter.camera_position = camera
        if not self._is_shown:
            self.plotter.show(auto_close=False)
            self._is_shown = True
        # Equal clipping planes for all scenes make depths comparable.
        self.renderer.ResetCameraClippingRange(*([self.bounds] if self.bounds else []))

    def draw(self) -> float:
        """Draw a frame to completion, and return its seconds."""
        start_time = time.perf_counter()
        self.window.Render()
        self.window.WaitForCompletion()
        return time.perf_counter() - start_time

    def seconds(self, cameras, limit=np.inf) -> np.ndarray:
        """Return the seconds of a frame per camera, after a warm-up frame."""
        self.look(cameras[0])
        self.draw()
        frame_seconds: list[float] = []
        for camera in cameras:
            if sum(frame_seconds) < limit:
                self.look(camera)
                frame_seconds.append(self.draw())
        return np.array(frame_seconds)

    def driver(self) -> str:
        """Return the name of the OpenGL renderer."""
        self.look([(0, 0, 1), (0, 1, 1), (0, 0, 1)])
        self.draw()
        return capabilities_of(self.window).get('renderer', 'unknown')

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
        depth_array = _vtk.vtkFloatArray()
        width, height = self.window.GetSize()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, depth_array)
        return _vtk.vtk_to_numpy(depth_array).reshape(height, width)[::-1].copy()

    def coverage(self) -> np.ndarray:
        """Return each pixel's coverage by all but ground and background, (h, w), 0 to 1.

        Without multisamples, which VTK averages as light.
        """
        white, black = (self._on_background(color) for color in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
        return np.clip(1 - (white - black).mean(-1), 0, 1)

    def _on_background(self, color):
        renderer, ground = self.renderer, self.ground
        old_background = renderer.GetBackground()
        renderer.SetBackground(color)
        if ground is not None:
            ground.mapper.SetScalarVisibility(False)
            ground.prop.lighting, ground.prop.color = False, color
        picture = self.picture()
        renderer.SetBackground(old_background)
        if ground is not None:
            ground.mapper.SetScalarVisibility(True)
            ground.prop.lighting = True
        return picture


def add_ground(plotter, ground):
    """Add a ground to a plotter and return its actor."""
    actor = plotter.add_mesh(ground, scalars='color_rgb', rgb=True)
    if ground.point_data.active_normals is not None:
        actor.prop.interpolation = 'Phong'  # smooth_shading would recompute normals
    return actor


def covered(depth, ground_depth, samples) -> np.ndarray:
    """Return coverage from depth buffers with and without objects."""
    return box_reduce(depth != ground_depth, samples)


def mesh_actors(meshes, poses, index) -> list:
    """Return actors of the full meshes, one per part and pose."""
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
    points = [np.concatenate([p.mesh.points for p in parts]) for parts in meshes]
    center, radius = (np.array(a)[index] for a in zip(*map(bounding_sphere, points), strict=True))
    axes, origins = poses[:, :3, :3], poses[:, :3, 3]
    largest_scale = np.linalg.norm(axes, axis=1).max(1)
    return np.einsum('nij,nj->ni', axes, center) + origins, radius * largest_scale


def in_view(frame, centers, radii):
    """Return the indices of spheres in a perspective view, nearest first."""
    view_from_world, clip_from_view = frame.view_from_world, frame.clip_from_view
    x, y, z = (centers @ view_from_world[:3, :3].T + view_from_world[:3, 3]).T
    x_tangent, y_tangent = 1 / clip_from_view[0, 0], 1 / clip_from_view[1, 1]
    is_visible = -z > -radii
    for across, tangent in ((x, x_tangent), (y, y_tangent)):
        is_visible &= np.abs(across) < -z * tangent + radii * np.hypot(1, tangent)
    visible_rows = np.flatnonzero(is_visible)
    eye_distances = np.linalg.norm(centers[visible_rows] - frame.eye, axis=1)
    return visible_rows[np.argsort(eye_distances)]


def stage(scene, size, **samples) -> Stage:
    """Return an off-screen stage of a landscape without its trees."""
    stage = Stage(size, scene.terrain, scene.view_angle, **samples)
    stage.bounds = scene.terrain.bounds
    return stage


def scenery(scene, max_error, size, *, off_screen):
    """Return a plotter with a landscape and its trees."""
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size))
    plotter.set_background(SKY)  # type: ignore[arg-type]
    plotter.camera.view_angle = scene.view_angle
    add_ground(plotter, scene.terrain)
    plant(plotter, scene, max_error)
    plotter.camera_position = scene.path(1)[0]
    return plotter


def plant(plotter, scene, max_error):
    """Add the trees of a landscape as instances."""
    return plotter.ibr.add_instances(
        scene.parts(), scene.matrices, index=scene.index, max_error=max_error, name='trees'
    )
