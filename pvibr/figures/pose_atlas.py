"""Atlases of animated figures: views of many poses of their clips."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from pvibr.animation.clip import Clip
from pvibr.animation.figure import Figure
from pvibr.core.errors import warn
from pvibr.figures.figure_levels import FigureLevel, simplified
from pvibr.figures.pose_sampler import PoseSampler
from pvibr.gl.hidden_window import hidden_window
from pvibr.instances.atlas import Atlas, pyramid
from pvibr.instances.bake import Baker
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.instances.levels import VERSION, LodModel, look_values
from pvibr.instances.measure import measure
from pvibr.instances.mesh_pool import MeshLevel
from pvibr.instances.stored_levels import from_arrays, to_arrays
from pvibr.instances.support import box_of, support_table
from pvibr.maths import octahedral

#: Views along a side of each pose's grid, and tile sizes in texels: the first that fits.
VIEWS = 12
TILES = (64, 32, 16)
#: Memory budget of all poses on the GPU, in bytes.
BUDGET = 192 * 2**20
BINS = 1024  # time steps of a clip in the texture
_SAMPLES = 32  # time steps at which the motion of a clip is sampled
_SIMPLIFIED = 16  # poses of all clips in which lighter levels are accurate, about
_MEASURED = 3  # most clips measured, in one pose each; a single clip in two
_BYTES = 8 * 3 / 2  # per texel with its mipmaps


@dataclass
class PoseAtlas(Atlas):
    """Views of several poses: `geometry` and `albedo` have a leading axis of poses."""

    bins: np.ndarray = field(default_factory=lambda: np.zeros((0, BINS), np.float32))
    animated = True

    @property
    def n_poses(self) -> int:
        """Number of poses of all clips."""
        return len(self.geometry)

    @property
    def pages(self) -> tuple[int, int]:
        """Columns and rows of pages in the texture, one page per pose."""
        page_columns = max(1, round((self.n_poses / 1.5) ** 0.5))
        return page_columns, -(-self.n_poses // page_columns)

    def pose(self, pose_index) -> Atlas:
        """Return the atlas of one pose, without an error table."""
        grid_parameters = self.center, self.radius, self.support, self.views, self.tile
        return Atlas(self.geometry[pose_index], self.albedo[pose_index], *grid_parameters)

    def textures(self):
        """Return geometry and albedo with the mipmaps of all poses, page by page."""
        columns, n_rows = self.pages
        page_textures = []
        for pictures in (self.geometry, self.albedo):
            side = pictures.shape[1]
            texture = np.zeros((n_rows, side, columns, side * 3 // 2, 4), np.uint8)
            for i, picture in enumerate(pictures):
                texture[i // columns, :, i % columns] = pyramid(picture, self.tile)
            page_textures.append(texture.reshape(n_rows * side, -1, 4))
        return page_textures

    def to_arrays(self) -> dict:
        """Return named arrays, for a file."""
        return super().to_arrays() | {'bins': self.bins}

    @classmethod
    def from_arrays(cls, arrays) -> PoseAtlas:
        """Make an atlas from named arrays, which are checked."""
        try:
            pictures = [np.asarray(arrays[k]) for k in ('geometry', 'albedo')]
            bins = np.asarray(arrays['bins'], np.float32)
            first_pictures = {'geometry': pictures[0][0], 'albedo': pictures[1][0]}
            first = Atlas.from_arrays({**arrays, **first_pictures})
        except (KeyError, IndexError) as error:
            raise ValueError(f'not a pose atlas: {error}') from error
        expected_shape = len(pictures[0]), *first.geometry.shape
        valid_bins = bins.ndim == 2 and np.isfinite(bins).all() and 0 <= bins.min() <= bins.max()
        if (
            any(p.shape != expected_shape for p in pictures)
            or not valid_bins
            or bins.max() >= expected_shape[0]
        ):
            raise ValueError(
                f'not a pose atlas: images must be {expected_shape}, bins refer to them'
            )
        all_poses = {'geometry': pictures[0], 'albedo': pictures[1], 'bins': bins}
        return cls(**vars(first) | all_poses)

    def contact_sheet(self, path=None, background=1.0, pose=0) -> np.ndarray:
        """Return all views of a pose side by side, optionally saved."""
        return self.pose(pose).contact_sheet(path, background)


@dataclass(eq=False)
class Motion:
    """A clip, and how far its vertices have travelled at sampled times."""

    figure: Figure
    clip: Clip | None
    times: np.ndarray
    travel: np.ndarray

    @property
    def duration(self) -> float:
        """Duration in seconds."""
        return float(self.times[-1])

    def pose(self, share):
        """Return the pose at a fraction of the distance travelled."""
        time = np.interp(share * self.travel[-1], self.travel, self.times)
        return self.figure.sample(time, self.clip, loop=False)

    def bins(self, n_poses) -> np.ndarray:
        """Return the pose shown at each of equal time steps."""
        bin_times = (np.arange(BINS) + 0.5) / BINS * self.duration
        travel_share = np.interp(bin_times, self.times, self.travel) / max(self.travel[-1], 1e-300)
        return np.minimum((travel_share * n_poses).astype(int), n_poses - 1)


def _reach(sampler, motion):
    """Return the largest distance of a point from the centre over a motion."""
    poses = sampler.figure.sample(motion.times, motion.clip, loop=False)
    largest_distance = 0.0
    for i in range(len(motion.times)):
        for points, *_ in sampler.shapes(poses[i]):
            largest_distance = max(largest_distance, float((points**2).sum(1).max()) ** 0.5)
    return largest_distance + float(np.diff(motion.travel).max(initial=0.0)) / 2


def motion_of(sampler, clip):
    """Return the sampled motion of a clip, and the support of all its poses."""
    duration = 0.0 if clip is None else clip.duration
    sample_times = np.linspace(0.0, duration, _SAMPLES + 1 if duration else 1)
    poses = sampler.figure.sample(sample_times, clip, loop=False)
    before, steps, support_tables = None, [0.0], []
    for i in range(len(sample_times)):
        points = np.concatenate([p for p, *_ in sampler.shapes(poses[i])])
        support_tables.append(support_table(points))
        if before is not None:
            steps.append(float(np.percentile(np.linalg.norm(points - before, axis=1), 99)))
        before = points
    margin = support_table(np.zeros((1, 3)), max(steps) / 2)  # motion between the samples
    motion = Motion(sampler.figure, clip, sample_times, np.cumsum(steps))
    return motion, np.max(support_tables, 0) + margin


def pose_counts(clip_travels, radius, max_error) -> tuple[int, list[int]]:
    """Return the tile size in texels, and the number of poses per clip."""
    for tile in TILES:
        ideal = [max(1, int(np.ceil(w / radius * tile / (4 * max_error)))) for w in clip_travels]
        pose_budget = BUDGET / (_BYTES * (VIEWS * tile) ** 2)
        budget_share = min(1.0, pose_budget / sum(ideal))
        if budget_share > 0.5:
            break
    return tile, [max(1, int(n * budget_share)) for n in ideal]


def bake_pose_atlas(
    figure, mesh_actors, clips, *, skinning='linear', max_error=1.0, cache=True, advance=None
) -> tuple[LodModel, list[Motion]]:
    """Return the levels of an animated figure, baked or from the cache, and its motions."""
    sampler = PoseSampler(figure, mesh_actors, skinning)
    motions, support_reach = zip(*[motion_of(sampler, clip) for clip in clips], strict=True)
    support_reach = np.max(support_reach, 0)
    figure_box = box_of(support_reach)
    sampler.center = figure_box.mean(0)
    radius = max(_reach(sampler, motion) for motion in motions) or 1.0
    support = (support_reach - support_table(sampler.center[None])) / radius
    tile, counts = pose_counts([m.travel[-1] for m in motions], radius, max_error)
    poses = [m.pose((k + 0.5) / n) for m, n in zip(motions, counts, strict=True) for k in range(n)]
    level = FigureLevel.of(sampler)
    store = None if cache is False else AtlasCache(None if cache is True else cache)
    cache_key = '' if store is None else _key(sampler, poses, tile, counts)
    model = None if store is None else store.load(cache_key, partial(_from_arrays, level))
    if model is not None:
        return model, list(motions)
    try:
        model = _baked(sampler, motions, counts, poses, (radius, support, tile), advance)
    except RuntimeError as error:
        warn(
            f'image cards are disabled, and meshes are drawn instead: {error}. Run `pvibr '
            'doctor`, or update the graphics driver.'
        )
        return LodModel([level], Atlas.blank(figure_box)), list(motions)
    if store is not None:
        store.put(cache_key, model.atlas.to_arrays() | to_arrays(model.levels))
    return model, list(motions)


def _from_arrays(level, arrays) -> LodModel:
    """Return the levels of a figure from arrays of the cache, checked."""
    _, *lighter_levels = from_arrays(level.parts, arrays)
    return _model(level, lighter_levels, PoseAtlas.from_arrays(arrays))


def _model(level, lighter_levels, atlas) -> LodModel:
    return LodModel([level, *map(level.lighter, lighter_levels)], atlas)


def _key(sampler, poses, tile, counts):
    key_values: list = ['poses and lighter meshes by distance', VERSION, VIEWS, tile, BINS, counts]
    for mesh_actor in sampler.mesh_actors:
        mesh = mesh_actor.part.mesh
        key_values += [mesh_actor.part.alpha_cutoff, np.asarray(mesh.regular_faces)]
        key_values += look_values(mesh_actor.part.actor)
        for data in (mesh.point_data, mesh.cell_data):
            for name in sorted(data.keys()):
                key_values += [name, np.ascontiguousarray(data[name])]
    for pose in poses:
        key_values += [np.asarray(a, np.float32) for shape in sampler.shapes(pose) for a in shape]
    return key_of(*key_values)


def _baked(sampler, motions, counts_by_clip, poses, grid_parameters, advance):
    start_time = time.perf_counter()
    radius, support, tile_size = grid_parameters
    lighter_levels = simplified(sampler, _posed_at(motions), radius)
    level = FigureLevel.of(sampler)
    parts = sampler.parts(poses[0])
    pictures, view_frames = [], octahedral.frame(octahedral.view_directions(VIEWS))
    with hidden_window() as (_, renderer):
        baker = Baker(renderer, parts, np.zeros(3), radius, (VIEWS, tile_size, 2))
        try:
            for i, pose in enumerate(poses):
                sampler.set_pose(parts, pose)
                pictures.append(baker.pictures(view_frames))
                if advance is not None:
                    advance((i + 1) / len(poses))
        finally:
            baker.release()
    geometry, albedo = (np.stack(p) for p in zip(*pictures, strict=True))
    first_poses = np.cumsum([0, *counts_by_clip])
    bins = [m.bins(n) + f for m, n, f in zip(motions, counts_by_clip, first_poses, strict=False)]
    view_parameters = np.zeros(3), radius, support, VIEWS, tile_size
    atlas = PoseAtlas(geometry, albedo, *view_parameters, bins=np.array(bins, np.float32))
    model = _model(level, lighter_levels, atlas)
    atlas.errors = _measured(sampler, motions, counts_by_clip, model)
    atlas.center = sampler.center
    atlas.seconds = time.perf_counter() - start_time
    return model


def _posed_at(motions) -> list:
    """Return poses in which lighter levels must be accurate, over all clips."""
    count = int(np.clip(_SIMPLIFIED // len(motions), 1, _SAMPLES))
    return [motion.pose((k + 0.5) / count) for motion in motions for k in range(count)]


def _measured(sampler, motions, counts_by_clip, model):
    """Return the worst error table of some poses, measured halfway between two."""
    error_tables = []
    first = 0
    poses_per_clip = 2 if len(motions) == 1 else 1
    samplers = [level.sampler(sampler) for level in model.levels]
    for motion, pose_count in list(zip(motions, counts_by_clip, strict=True))[:_MEASURED]:
        for k in np.unique(np.linspace(0, pose_count - 1, 2 + poses_per_clip).astype(int)[1:-1]):
            between = motion.pose((k + 1) / pose_count)
            levels = [
                MeshLevel(own_sampler.parts(between), level.error)
                for own_sampler, level in zip(samplers, model.levels, strict=True)
            ]
            error_tables.append(measure(LodModel(levels, model.atlas.pose(first + int(k)))))
        first += pose_count
    return {name: np.max([t[name] for t in error_tables], 0) for name in error_tables[0]}
