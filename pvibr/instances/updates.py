"""Updates of instances: their poses, meshes and looks, all at once or some."""

from __future__ import annotations

import numpy as np

from pvibr.instances.instance_arguments import index_of_phase, repeated
from pvibr.things import appearance as look
from pvibr.things.scalar_bars import name_of
from pvibr.things.some_items import checked_ids, with_looks

# What an update replaces, restored if a check or a bake fails.
_REPLACED = '_items', '_scalars', '_colors', '_visible', 'covered', '_applied_cover'


def update(
    self,
    ids=None,
    *,
    poses=None,
    index=None,
    phase=None,
    scalars=None,
    colors=None,
    visible=None,
):
    """Change all instances, or the given ones; baked images are reused.

    Parameters
    ----------
    ids : array_like of int or bool, or slice, optional
        Instances to change; by default all are replaced, by any number of new ones.
    poses : array_like, shape (k, 3) or (k, 4, 4), optional
        New points or matrices, or one for all `ids`.
    index : array_like of int, shape (k,), or int, optional
        Meshes to show, each baked when first shown. Required with several meshes if the
        number of instances changes.
    phase : array_like of float, shape (k,), or float, optional
        Meshes to show as a fraction of all meshes, modulo 1.
    scalars, colors, visible : optional
        New values. If the number of instances changes, omitted ones are reset.

    Raises
    ------
    IndexError
        If an instance does not exist.
    ValueError
        If the number of values is wrong.
    """
    previous = {name: getattr(self, name) for name in _REPLACED}
    previous_models = self._models.state()
    try:
        if phase is not None:
            index = index_of_phase(phase, self._items.mesh_count)
            self._models.require_all()
        if ids is None:
            is_posed = poses is not None or index is not None
            items = self._items.replaced(poses, index) if is_posed else self._items
            looks = _checked_looks(self, len(items), scalars, colors, visible)
            if is_posed:  # even if it is the same array: its values may have changed
                show_items(self, items)
        else:
            ids = checked_ids(ids, len(self))
            looks = with_looks(self, ids, scalars, colors, visible)
            _update_some(self, ids, poses, index)
    except BaseException:  # a bake may be interrupted
        vars(self).update(previous)
        self._models.restore(previous_models)
        raise
    bar_title = name_of(scalars) if ids is None else self._scalar_name
    for name, values in looks.items():
        if name == 'scalars':
            self._set_scalars(values, bar_title)
        else:
            setattr(self, name, values)
    self._show_bar()  # also if a new number of instances has dropped the scalars


def _update_some(self, ids, poses, index):
    items, moves_in_place = self._items, False
    if index is not None:
        items = items.with_index(ids, index)
    if poses is not None:
        poses, nan_rows = items.checked(poses)
        poses = repeated('poses', poses, len(ids))
        moves_in_place = index is None and items.can_move(poses)
        moves_in_place = moves_in_place and self._models.can_move(items.in_world(poses))
        items = items.with_poses(ids, poses, nan_rows, in_place=moves_in_place)
    if moves_in_place:
        _move_items(self, items, ids)
    elif items is not self._items:
        show_items(self, items)


def show_items(self, items, *, keeps_bounds=False):
    """Show any number of items, in new groups if models or room are missing."""
    count = len(items)
    if count != len(self):
        if not self._can_grow:
            raise ValueError(f'poses must have {len(self)} rows, got {count}')
        self._scalars = self._colors = self._visible = None
        self.covered = self._applied_cover = None
    self._items = items
    has_new_models = self._models.follow_poses(items.poses, items.index)
    if has_new_models or not self.groups.have_room(count):
        self._rebuild(keeps_bounds=keeps_bounds)
        if has_new_models and self.pipeline is not None:
            self.pipeline.changed()
        return
    self.groups.put(items.poses, items.index)
    if not keeps_bounds:
        self._bound()
    self._repaint()


def _move_items(self, items, ids):
    """Move some items within their groups."""
    has_new_looks = items.nan_rows is not self._items.nan_rows
    self._items = items
    has_new_slots = self.groups.move(items.poses, ids)
    self._bound()
    self._touch()
    if has_new_slots or has_new_looks:
        self._repaint()


def _checked_looks(self, count, scalars, colors, visible) -> dict:
    """Return the looks of all instances that are not None."""
    looks: dict = {}
    if scalars is not None:
        looks['scalars'] = look.as_scalars(scalars, count)
    if colors is not None:
        looks['colors'] = self._as_colors(colors, count)
    if visible is not None:
        look.as_mask(visible, count)
        looks['visible'] = visible
    return looks


def base_colors(self) -> np.ndarray:
    """Return the colours that instances have without their own, shape (n, 3)."""
    colors = np.full((len(self), 3), 255, np.uint8)
    for k, model in self._models.by_mesh.items() if not self.multiplies else ():
        prop = model.levels[0].parts[0].actor.GetProperty()
        colors[self._items.index == k] = np.rint(np.array(prop.GetColor()) * 255)
    return colors
