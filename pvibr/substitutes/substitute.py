"""Things drawn in place of actors, which are hidden during the frame."""

from __future__ import annotations

from pyvista.plotting.plotter import _ALL_PLOTTERS

from pvibr.core._vtk import address, method
from pvibr.core.determinism import is_deterministic
from pvibr.core.params import Param
from pvibr.core.passes import has_shadows
from pvibr.core.plotters import put_inner
from pvibr.maths.views import may_see
from pvibr.things.frame import Frame
from pvibr.things.picking import Hit, nearest_actor
from pvibr.things.thing import Thing, joined_bounds


class Substitute(Thing):
    """A thing drawn in place of actors; other things see the actors unchanged.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ()
    web = 'shown', 'its actors, as meshes'
    max_error = Param(
        1.0,
        'Largest displacement of an image on the screen; raise it to reuse images for longer.',
        range='(0, inf)',
        unit='px',
    )
    budget_ms = Param(
        None,
        'Time per frame for rendering new images; set it where they make motion stutter.',
        range='[0, inf)',
        unit='ms',
        kind=float,
    )
    only_if_faster = Param(True, 'Replace only actors that measure slower than their image.')
    counts_bounds = False  # its actors' bounds count
    clipped_by = 'set the clipping planes of the mappers of its actors'
    moved_by = 'move its actors'
    _argument = 'actors'
    _version = 0
    _frame: Frame | None = None

    def _cards(self) -> list:
        """Return the draws that show the images."""
        raise NotImplementedError

    def shader_actors(self) -> list:
        """Return the actors of its images."""
        return [actor for card in self._cards() for actor in card.actors]

    def _stood_for(self) -> list:
        """Return the actors that it replaces."""
        raise NotImplementedError

    def _update(self):
        """Update the state of the actors while none is hidden."""
        raise NotImplementedError

    def _give_back(self):
        """Hide the images and show the actors."""
        raise NotImplementedError

    def _prepare(self, frame):
        """Show images in place of actors."""
        raise NotImplementedError

    def _conflicts(self, other, props) -> bool:
        """Return True if another effect replaces some of these props."""
        raise NotImplementedError

    def _materials_of_all(self) -> list:
        return [actor.GetProperty() for actor in self._stood_for()]

    # -- as other things see it -------------------------------------------------------------------

    def drawn(self) -> list:
        """Return the actors that draw it in the frame it was prepared for."""
        own_actors = *self.shader_actors(), *self._stood_for()
        return [actor for actor in own_actors if actor.GetVisibility()]

    def stands_for(self) -> list:
        """Return the user's visible actors that it replaces."""
        return self.solids()

    def content_key(self) -> tuple:
        """Return a value that changes with the drawn content, but not with the camera."""
        if self._frame is None:
            self._update()
        return self._version, self.revision

    def _boxes(self) -> list:
        """Return the bounds of its visible actors."""
        return [actor.GetBounds() for actor in self.solids()]

    @property
    def bounds(self):
        """World bounds of its visible actors."""
        self._set_bounds(joined_bounds(self._boxes()))
        return super().bounds

    def draws(self, frame, *, depth=False) -> list:
        """Return its actors that may be visible in a frame of another view."""
        actor_boxes = [(a, a.GetBounds()) for a in self.solids()]
        actor_boxes = [(a, box) for a, box in actor_boxes if box and box[0] <= box[1]]
        if not actor_boxes:
            return []
        in_view = may_see(frame.view, [box for _, box in actor_boxes])
        return [a for (a, _), s in zip(actor_boxes, in_view, strict=True) if s]

    def pick(self, x, y) -> Hit | None:
        """Return the nearest of its visible actors under a pixel, also as ``actor``."""
        if not self.pickable or self.pipeline is None:
            return None
        actors = [actor for actor in self.solids() if actor.GetPickable()]
        return nearest_actor(actors, self.pipeline.renderer, x, y)

    def GetPickable(self) -> bool:
        """Return False: the actors themselves are picked."""
        return False

    # -- the life of an effect -------------------------------------------------------------------

    def attach(self, pipeline):
        """Add its images to the scene."""
        self._claim(pipeline, self._claimed())
        super().attach(pipeline)

    def _claim(self, pipeline, props):
        """Raise an error unless it may replace these props in a subplot."""
        for actor in props:
            if not pipeline.renderer.HasViewProp(actor):
                raise ValueError(
                    f'{self._argument}: {actor!r} is not in this subplot; add it there first'
                )
        self._refuse_shared(pipeline.window, props)
        for other in pipeline.things:
            if other is not self and self._conflicts(other, props):
                raise ValueError(
                    f'{self._argument}: {other.name} already replaces some of them; '
                    'remove it first'
                )

    def _refuse_shared(self, window, props):
        other_mappers = _mappers_elsewhere(window)
        for actor in props if other_mappers else ():
            if address(actor.GetMapper()) in other_mappers:
                raise ValueError(
                    f'{self._argument}: {actor!r} shares its mapper with an actor of another '
                    'window, where VTK crashes: give each its own, such as '
                    'pyvista.DataSetMapper(actor.mapper.dataset)'
                )

    def _claimed(self) -> list:
        """Return the props that must be in the subplot."""
        return list(self.props)

    def _put_in(self, renderer):
        for actor in self.shader_actors():
            put_inner(renderer, actor)

    def _take_out(self, renderer):
        self.deactivate()
        for actor in self.shader_actors():
            renderer.RemoveViewProp(actor)

    def deactivate(self):
        """Show the actors themselves."""
        self._give_back()
        self._frame = None

    def needed(self, frame) -> bool | str:
        """Return True if images may replace actors in a frame, else the reason."""
        if has_shadows(frame.renderer):
            return "enable_shadows() is on, and VTK's shadows need the actors themselves"
        return super().needed(frame)

    def prepare(self, frame):
        """Choose what is drawn as an image, and renew stale images."""
        if frame is self._frame:
            return
        self._give_back()
        self._update()
        failure = next((card.failure for card in self._cards() if card.failure), None)
        try:
            if failure:
                raise RuntimeError(failure)
            self._prepare(frame)
        except Exception:
            self.deactivate()
            raise
        self._frame = frame

    def finish(self, frame):
        """Show the actors to everything else again."""
        if frame is self._frame:
            self._give_back()
            self._frame = None

    def _budget(self) -> float:
        """Return the time budget for new images per frame, seconds."""
        is_unlimited = self.budget_ms is None or is_deterministic()
        return float('inf') if is_unlimited else self.budget_ms / 1e3


def addresses(actors) -> set[str]:
    """Return the addresses of actors, equal for all wrappers of a VTK object."""
    return {address(actor) for actor in actors}


def _mappers_elsewhere(window) -> set[str]:
    """Return the addresses of the mappers in the windows of other plotters."""
    plotter_windows = [plotter.render_window for plotter in _ALL_PLOTTERS.values()]
    renderers = [r for w in plotter_windows if w not in (None, window) for r in w.GetRenderers()]
    actors = [p for r in renderers for p in r.GetViewProps() if p.IsA('vtkActor')]
    return {address(m) for m in (method(a, 'GetMapper')() for a in actors) if m is not None}
