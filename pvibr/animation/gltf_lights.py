"""Cameras and lights that come with a glTF file and move with its nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.io.gltf_file import GltfError, GltfFile, follow
from pvibr.maths.vectors import unit_vectors

_KINDS = ('directional', 'point', 'spot')


@dataclass(frozen=True)
class FigureCamera:
    """A camera that moves with a joint and looks along its -z; y is up."""

    node: int
    name: str = ''
    view_angle: float | None = None
    half_height: float | None = None
    aspect: float | None = None
    clipping: tuple[float, float] = (0.01, math.inf)

    def placed(self, world) -> pv.Camera:
        """Return the camera at the joint, from world matrices (n, 4, 4)."""
        figure_from_joint = np.asarray(world, dtype=np.float64)[self.node]
        _, up, back = unit_vectors(figure_from_joint[:3, :3].T)
        camera = pv.Camera()
        camera.position = tuple(figure_from_joint[:3, 3])
        camera.focal_point = tuple(figure_from_joint[:3, 3] - back)
        camera.up = tuple(up)
        if self.view_angle is not None:
            camera.view_angle = self.view_angle
        if self.half_height is not None:
            camera.enable_parallel_projection()
            camera.parallel_scale = self.half_height
        if math.isfinite(self.clipping[1]):
            camera.clipping_range = self.clipping
        return camera


@dataclass(frozen=True)
class FigureLight:
    """A light that moves with a joint and shines along its -z."""

    node: int
    kind: str
    name: str = ''
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    range: float | None = None
    cone: tuple[float, float] = (0.0, 45.0)

    def placed(self, world, exposure=1.0) -> pv.Light:
        """Return the light at the joint, from world matrices (n, 4, 4)."""
        return self._at(np.asarray(world, dtype=np.float64)[self.node], exposure)

    def held(self, exposure=1.0) -> pv.Light:
        """Return the light in the joint's space: its ``transform_matrix`` moves it."""
        return self._at(np.eye(4), exposure)

    def _at(self, figure_from_light, exposure):
        back = unit_vectors(figure_from_light[:3, 2])
        directional = self.kind == 'directional'
        position = back if directional else figure_from_light[:3, 3]
        light = pv.Light(
            position=tuple(position),
            focal_point=tuple(position - back),
            color=self.color,
            light_type='scene light',
            intensity=self.intensity * exposure,
        )
        light.positional = not directional
        if not directional:
            light.attenuation_values = 0.0, 0.0, 1.0
            # VTK: from 90 degrees on a light is a point light.
            light.cone_angle = self.cone[1] if self.kind == 'spot' else 90.0
        return light


def cameras_of(gltf_file: GltfFile, nodes):
    """Return the cameras of some nodes."""
    cameras = []
    for node in nodes:
        index = gltf_file.document.nodes[node].camera
        if index is not None:
            camera = follow(gltf_file.document.cameras, index, f'nodes[{node}].camera', 'cameras')
            cameras.append(_camera(camera, node, f'cameras[{index}]'))
    return cameras


def lights_of(gltf_file: GltfFile, nodes):
    """Return the lights of some nodes."""
    file_lights = gltf_file.document.extensions.lights.lights
    lights = []
    for node in nodes:
        light_reference = gltf_file.document.nodes[node].extensions.lights
        if light_reference is not None:
            json_path = f'nodes[{node}].extensions.KHR_lights_punctual.light'
            light = follow(file_lights, light_reference.light, json_path, 'lights')
            if light.type in _KINDS:
                lights.append(_light(light, node))
            else:
                gltf_file.leave_out(f'a light of type {light.type[:40]!r}', json_path)
    return lights


def _camera(camera, node, json_path):
    lens = getattr(camera, camera.type)
    if lens is None:
        raise GltfError(f'{json_path} must have {camera.type!r}, its type, got none')
    clipping = lens.znear, math.inf if lens.zfar is None else lens.zfar
    name = camera.name or ''
    if camera.type == 'perspective':
        view_angle = math.degrees(lens.yfov)
        return FigureCamera(node, name, view_angle, None, lens.aspect_ratio, clipping)
    half_height = abs(lens.ymag)
    aspect = abs(lens.xmag) / half_height if half_height else None
    return FigureCamera(node, name, None, half_height, aspect, clipping)


def _light(light, node):
    inner, outer = light.spot.inner_cone_angle, light.spot.outer_cone_angle
    cone = math.degrees(inner), math.degrees(outer)
    name = light.name or ''
    return FigureLight(node, light.type, name, light.color, light.intensity, light.range, cone)
