"""The patches that draw a mesh in a view, within an error on the screen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pvibr.large.hierarchy import NO_CELL


@dataclass(frozen=True)
class ModelView:
    """A view in the space of a hierarchy, about its origin."""

    #: Position of the eye.
    eye: np.ndarray
    #: Clip space from the hierarchy's, (4, 4).
    clip_from_model: np.ndarray
    #: Pixels of a unit of the model, at distance 1 in perspective.
    pixels_per_unit: float
    #: Distance of the near plane, in units of the model.
    near: float
    is_parallel: bool

    @classmethod
    def of(cls, frame, world_from_model) -> ModelView:
        """Return the view of a frame, the same object for equal ones; matrices have inverses."""
        return _model_view(frame.view, frame.pixel_scale, world_from_model.tobytes())


@lru_cache(maxsize=16)
def _model_view(view, pixel_scale, matrix_bytes) -> ModelView:
    """Return the view in the space of a model whose matrix is given as bytes."""
    world_from_model = np.frombuffer(matrix_bytes).reshape(4, 4)
    stretches = np.linalg.svd(world_from_model[:3, :3], compute_uv=False)
    model_from_world = np.linalg.inv(world_from_model)
    eye = model_from_world[:3, :3] @ view.eye + model_from_world[:3, 3]
    # Where a model is stretched, distances are at least these, and errors at most.
    scale = stretches[0] if view.parallel else stretches[0] / stretches[-1]
    return ModelView(
        eye,
        view.clip_from_view @ view.view_from_world @ world_from_model,
        float(pixel_scale * scale),
        float(view.near / stretches[0]),
        view.parallel,
    )


def cell_pixels(hierarchy, view) -> np.ndarray:
    """Return the largest error of each cell in pixels.

    That of a cell is never less than that of a cell that it replaces, whose box is in its own.
    """
    return pixels_of(hierarchy.errors, hierarchy.boxes, view)


def pixels_of(lengths, boxes, view) -> np.ndarray:
    """Return lengths in boxes as pixels, at most."""
    if view.is_parallel:
        return lengths * view.pixels_per_unit
    distances = np.maximum(_distances(view.eye, boxes[:, 0], boxes[:, 1]), view.near)
    return lengths * view.pixels_per_unit / distances


def patches_within(hierarchy, pixels, max_error) -> np.ndarray:
    """Return the patches of the coarsest cut whose cells keep an error, in pixels."""
    is_allowed = np.r_[pixels <= max_error, False]  # the last is `NO_CELL`
    made_by, replaced_by = hierarchy.patch_cells.T
    is_made = is_allowed[made_by] | (made_by == NO_CELL)
    return np.flatnonzero(is_made & ~is_allowed[replaced_by])


def patches_in_view(hierarchy, patches, view) -> np.ndarray:
    """Return those of some patches that the view's frustum may contain."""
    boxes = hierarchy.patch_boxes[patches]
    centers, halves = boxes.mean(1), (boxes[:, 1] - boxes[:, 0]) / 2
    clip = view.clip_from_model
    # Front and back planes are left out: the clipping range follows the bounds.
    planes = np.stack([clip[3] + s * clip[axis] for axis in (0, 1) for s in (1, -1)])
    if not view.is_parallel:
        planes = np.concatenate([planes, clip[3:]])
    reaches = halves @ np.abs(planes[:, :3]).T
    heights = centers @ planes[:, :3].T + planes[:, 3]
    return patches[(heights + reaches >= 0).all(1)]


def front_to_back(hierarchy, patches, view) -> np.ndarray:
    """Return patches in the order of their distances: what is behind is not shaded."""
    boxes = hierarchy.patch_boxes[patches]
    if view.is_parallel:
        distances = boxes.mean(1) @ view.clip_from_model[2, :3]
    else:
        distances = _distances(view.eye, boxes[:, 0], boxes[:, 1])
    return patches[np.argsort(distances, kind='stable')]


def _distances(eye, low, high) -> np.ndarray:
    gaps = np.maximum(np.maximum(low - eye, eye - high), 0)
    return np.sqrt(np.einsum('ij,ij->i', gaps, gaps))


def cut_of(hierarchy, view, max_error) -> tuple[np.ndarray, np.ndarray]:
    """Return the patches of a cut, and those of them that are in view, front to back."""
    patches = patches_within(hierarchy, cell_pixels(hierarchy, view), max_error)
    return patches, front_to_back(hierarchy, patches_in_view(hierarchy, patches, view), view)


def gathered(hierarchy, patches) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of patches and their triangles among these, (n, 3) int32."""
    starts, ends = hierarchy.vertex_starts[patches], hierarchy.vertex_starts[patches + 1]
    vertices = _slices(hierarchy.vertices, starts, ends)
    first = np.cumsum([0, *(ends - starts)[:-1]]) if len(patches) else np.zeros(0, int)
    starts, ends = hierarchy.triangle_starts[patches], hierarchy.triangle_starts[patches + 1]
    triangles = _slices(hierarchy.triangles, starts, ends).astype(np.int32)
    triangles += np.repeat(first, ends - starts).astype(np.int32)[:, None]
    return vertices, triangles


def gathered_coordinates(hierarchy, patches) -> np.ndarray:
    """Return the texture coordinates of the vertices of patches, (n, 2)."""
    starts, ends = hierarchy.vertex_starts[patches], hierarchy.vertex_starts[patches + 1]
    return _slices(hierarchy.texture_coordinates, starts, ends)


def _slices(array, starts, ends) -> np.ndarray:
    parts = [array[a:b] for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]
    return np.concatenate(parts) if parts else array[:0]
