"""Changes of what instances are drawn as: bakes, meshes, materials, and shaders that fail."""

from __future__ import annotations

import time

import numpy as np

from pvibr.core.arguments import checked_number
from pvibr.core.errors import warn
from pvibr.core.progress import baking
from pvibr.things.item_set import ItemSet

_POLL_SECONDS = 0.02
_RANKED_ITEMS = 10_000  # of all, evenly, by which meshes are ranked


def wait(self, timeout=None) -> bool:
    """Wait until all images of the set are baked."""
    deadline = np.inf
    if timeout is not None:
        deadline = time.monotonic() + checked_number('timeout', timeout, 0)
    models = self._models
    models.resume()
    if not models.pending:
        return True
    try:
        with baking(models.shows_progress) as advance:
            while models.pending:
                advance(models.fraction)
                self._follow_meshes()
                if models.pending and time.monotonic() >= deadline:
                    return False
                time.sleep(_POLL_SECONDS * models.pending)
    except KeyboardInterrupt:
        models.pause()
        raise
    return True


def follow_meshes(self):
    """Follow changes of meshes and materials, and bakes that end."""
    relit_meshes, has_new_models = self._models.follow_meshes(self._items.index)
    if relit_meshes:
        self.groups.follow_materials(relit_meshes)
        self._touch()
    # Afterwards: what has changed is being baked again.
    if self._models.has_drafts:
        has_new_models |= self._models.adopt_bakes(self._items.index)
    if has_new_models:
        self._show_models()
        self._show_bar()


def is_prepared(self, frame) -> bool:
    """Return True if the last preparation holds; not once a shader has failed."""
    if self.covered is not self._applied_cover or self.groups.has_failed:
        return False
    return ItemSet.is_prepared(self, frame)


def time_getters(self) -> list | None:
    """Return what returns the times of meshes and materials; None while bakes are under way."""
    return None if self._models.has_drafts else self._models.time_getters()


def bake(self):
    """Bake images of the meshes that have none and that images can show."""
    self._models.resume()
    if self._models.bake(self._items.index):
        self._rebuild()


def remake(self):
    """Adopt changed colours of all meshes."""
    self._models.remake(self._items.index)
    self._rebuild()


def adopt_material(self):
    """Share the material of the only part, or pass changes of the first on to all."""
    parts = self._models.parts()
    self._dressed = (parts[0].actor,) if len(parts) == 1 else ()
    for actor in self._dressed:
        self.SetProperty(actor.GetProperty())
    if len(parts) > 1:
        self._share_material()


def show_models(self):
    """Draw new models."""
    self._adopt_material()
    self._rebuild()
    if self.pipeline is not None:
        self.pipeline.changed()


def check_shaders(self):
    """On failure of a shader, warn and draw without it from then on."""
    if failure := self.groups.mesh_failure():
        self._rebuild()
        _warn(self, failure, 'each instance is drawn by an actor')
    failure = self.groups.card_failure
    if failure and not self._failure:
        self._failure = failure
        self._touch()
        _warn(self, failure, 'instances are drawn as meshes')


def _warn(self, failure, instead):
    warn(f'{self.name}: {failure}: {instead} instead. Run `pvibr doctor`.')


def rank_bakes(self, frame):
    """Let meshes that are large in view be baked first."""
    if not self._models.has_choice:
        return
    centers, radii = self.groups.spheres()
    items = slice(None, None, max(len(centers) // _RANKED_ITEMS, 1))
    eye_centers = centers[items] @ frame.view_from_world[:3, :3].T + frame.view_from_world[:3, 3]
    planes = frame.view.side_planes
    is_inside = (eye_centers @ planes[:, :3].T + planes[:, 3]).min(1) > -radii[items]
    distances = 1.0 if frame.parallel else np.linalg.norm(eye_centers, axis=1)
    sizes = is_inside * radii[items] * frame.pixel_scale / np.maximum(distances, 1e-30)
    largest = np.zeros(self._items.mesh_count)
    np.maximum.at(largest, self._items.index[items], 2 * sizes)
    self._models.rank(dict(enumerate(largest.tolist())))
