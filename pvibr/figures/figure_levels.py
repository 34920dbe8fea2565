"""Lighter levels of a figure: simplified meshes that joints, morph targets and key frames move."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pyvista as pv

from pvibr.animation.figure import Figure
from pvibr.animation.splitting import with_points
from pvibr.figures.mesh_actors import PosedMeshActor, RigidMeshActor
from pvibr.figures.pose_sampler import PoseSampler
from pvibr.figures.posing import PosedDraws
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.meshes.collapse import collapsed
from pvibr.meshes.decimate import Weldings, is_surface, take_arrays
from pvibr.meshes.parts import Part
from pvibr.meshes.surface_distance import Surface, hausdorff

#: Triangles of a mesh relative to the next heavier one of which levels are chosen.
_STEP = 0.8
#: Triangles of a level relative to the next heavier one, at most; and fewest triangles.
_SHARE, _LIGHTEST = 0.7, 150
#: Errors of levels in radii: a pixel at diameters of 1024 px to 45 px, below which images serve.
_ERRORS = 2.0 ** -np.arange(9.0, 4.0, -0.5)
#: Points at which errors of a mesh are measured in each pose, about, and as many between them.
_SAMPLES = 1000
#: Most poses in which distances count, and errors are measured.
_POSES = 4
_FLAT = 0  # VTK's interpolation
#: Point array of a lighter mesh: the number of each point in the mesh.
_POINT_IDS = 'pvibr_points'


@dataclass
class FigureLevel(MeshLevel):
    """Meshes of a figure at rest, the figure, and its meshes as actors."""

    figure: Figure = field(default_factory=lambda: Figure([]))
    mesh_actors: list = field(default_factory=list)

    @classmethod
    def of(cls, sampler) -> FigureLevel:
        """Return the level of the figure itself."""
        parts = [mesh_actor.part for mesh_actor in sampler.mesh_actors]
        return cls(parts, None, sampler.figure, sampler.mesh_actors)

    def lighter(self, level) -> FigureLevel:
        """Return the level of simplified meshes, which deform as this one's."""
        both_parts = zip(self.parts, level.parts, strict=True)
        meshes = {i: q.mesh for i, (p, q) in enumerate(both_parts) if q.mesh is not p.mesh}
        origins = {i: np.asarray(mesh.point_data[_POINT_IDS]) for i, mesh in meshes.items()}
        figure = with_points(self.figure, {i: (meshes[i], origins[i]) for i in meshes})
        draws = PosedDraws()
        pairs = enumerate(zip(self.mesh_actors, level.parts, strict=True))
        mesh_actors = [_mesh_actor(a, figure, i, light, draws) for i, (a, light) in pairs]
        return FigureLevel(level.parts, level.error, figure, mesh_actors)

    def sampler(self, sampler) -> PoseSampler:
        """Return a sampler of its poses, relative to the same centre as another one."""
        own_sampler = PoseSampler(self.figure, self.mesh_actors, sampler.skinning)
        own_sampler.center = sampler.center
        return own_sampler


def _mesh_actor(mesh_actor, figure, index, light, draws):
    """Return a lighter mesh as an actor that moves as that of the mesh."""
    if isinstance(mesh_actor, PosedMeshActor):
        return PosedMeshActor(figure, index, light, draws)
    if light is mesh_actor.part:
        return mesh_actor
    return RigidMeshActor(light, mesh_actor.node)


@dataclass
class _Rung:
    """A mesh of a figure, or a lighter one, and how far it is off in the poses, in radii."""

    part: Part
    error: float


def simplified(sampler, poses, radius) -> list[MeshLevel]:
    """Return lighter levels of a figure, heaviest first, whose errors hold in some poses."""
    weld = Weldings()
    indices = range(len(sampler.mesh_actors))
    ladders = [_ladder(sampler, i, poses, radius, weld) for i in indices]
    levels, triangles = [], sum(ladder[0].part.mesh.n_cells for ladder in ladders)
    for error in _ERRORS:
        rungs = [[r for r in ladder if r.error <= error][-1] for ladder in ladders]
        count = sum(rung.part.mesh.n_cells for rung in rungs)
        if _LIGHTEST <= count <= _SHARE * triangles:
            levels.append(MeshLevel([r.part for r in rungs], max(r.error for r in rungs)))
            triangles = count
    return levels


def _ladder(sampler, index, poses, radius, weld) -> list[_Rung]:
    """Return a mesh and ever lighter ones."""
    part = sampler.mesh_actors[index].part
    rungs = [_Rung(part, 0.0)]
    if not part.mesh.n_cells or not is_surface(part, weld):
        return rungs
    posed_points = [np.asarray(sampler.points(index, pose), float) for pose in poses]
    is_smooth = part.actor.GetProperty().GetInterpolation() > _FLAT
    chosen_points = _most_different(posed_points)
    faces = np.asarray(part.mesh.regular_faces)
    posed_surfaces = [Surface(points, faces) for points in chosen_points]
    left = collapsed(part.mesh, weld(part), chosen_points, _STEP, smooth=is_smooth)
    for corners, cells in left:
        error = max(_error(posed_surfaces, corners) / radius, rungs[-1].error)
        if error > _ERRORS[-1]:
            break
        rungs.append(_Rung(part.with_mesh(_subset(part.mesh, corners, cells)), error))
    return rungs


def _most_different(posed_points) -> list:
    """Return the points in up to four poses that differ most, less what moves them all."""
    centred = np.array([points - points.mean(0) for points in posed_points])
    distances, chosen = np.full(len(centred), np.inf), [0]
    while len(chosen) < min(_POSES, len(centred)):
        differences = np.square(centred - centred[chosen[-1]]).sum((1, 2))
        distances = np.minimum(distances, differences)
        chosen.append(int(distances.argmax()))
    return [centred[k] for k in chosen]


def _subset(mesh, corners, cells) -> pv.PolyData:
    """Return a mesh of triangles between some of a mesh's points."""
    point_ids, place = np.unique(corners, return_inverse=True)
    faces: np.ndarray = place.reshape(-1, 3)
    light = pv.PolyData.from_regular_faces(mesh.points[point_ids], faces)
    take_arrays(mesh, light, point_ids, cells)
    light.point_data.set_array(point_ids, _POINT_IDS)
    return light


def _error(posed_surfaces, corners) -> float:
    """Return how far a mesh of some of the points is off in the worst pose, in their units."""
    # The distance of the surfaces: where joints bend, places that correspond are farther apart.
    point_ids, place = np.unique(corners, return_inverse=True)
    faces = place.reshape(-1, 3)
    return max(hausdorff(s, Surface(s.points[point_ids], faces), _SAMPLES) for s in posed_surfaces)
