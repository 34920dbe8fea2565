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
    """A thing drawn in place of actors, which other things see unchanged.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ()
    web = 'shown', 'its actors, as meshes'
    max_error = Param(1.0, 'Maximum screen-space displacement.', range='(0, inf)', unit='px')
    budget_ms = Param(
        None, 'Time for new images in a frame.', range='[0, inf)', unit='ms', kind=float
    )
    only_if_faster = Param(True, 'Replace only actors that are measured to be slower themselves.')
    counts_bounds = False  # its actors have theirs
    clipped_by = 'set the clipping planes of the mappers of its actors'
    moved_by = 'move its actors'
    _argument = 'actors'
    _version = 0
    _frame: Frame | None = None

    def _cards(self) -> list:
        """Return the draws that show the images."""
        raise NotImplementedError

    def _card_actors(self) -> list:
        return [actor for card in self._cards() for actor in card.actors]

    def _stood_for(self) -> list:
        """Return the actors that it stands for."""
        raise NotImplementedError

    def _update(self):
        """Update the state of the actors, none of them hidden."""
        raise NotImplementedError

    def _give_back(self):
        """Hide the images, and show the actors."""
        raise NotImplementedError

    def _prepare(self, frame):
        """Show images in place of actors."""
        raise NotImplementedError

    def _conflicts(self, other, props) -> bool:
        """Return True if another effect stands for some of these props."""
        raise NotImplementedError

    def _materials_of_all(self) -> list:
        return [actor.GetProperty() for actor in self._stood_for()]

    # -- what it is to others --------------------------------------------------------------------

    def drawn(self) -> list:
        """Return the actors that draw it in the frame that it was prepared for."""
        mine = *self._card_actors(), *self._stood_for()
        return [actor for actor in mine if actor.GetVisibility()]

    def stands_for(self) -> list:
        """Return the visible actors of the user that it is drawn in place of."""
        return self.solids()

    def content_key(self) -> tuple:
        """Return a value that changes whenever the drawn content does, the camera left out."""
        if self._frame is None:
            self._update()
        return self._version, self.revision

    def _boxes(self) -> list:
        """Return the bounds of what it stands for."""
        return [actor.GetBounds() for actor in self.solids()]

    @property
    def bounds(self):
        """World bounds of all actors that are visible."""
        self._set_bounds(joined_bounds(self._boxes()))
        return super().bounds

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors themselves that may be seen in a frame that is not its own."""
        boxes = [(a, a.GetBounds()) for a in self.solids()]
        boxes = [(a, box) for a, box in boxes if box and box[0] <= box[1]]
        if not boxes:
            return []
        seen = may_see(frame.view, [box for _, box in boxes])
        return [a for (a, _), s in zip(boxes, seen, strict=True) if s]

    def pick(self, x, y) -> Hit | None:
        """Return the nearest of its visible actors under a pixel, also as ``actor``."""
        if not self.pickable or self.pipeline is None:
            return None
        actors = [actor for actor in self.solids() if actor.GetPickable()]
        return nearest_actor(actors, self.pipeline.renderer, x, y)

    def GetPickable(self) -> bool:
        """Return False: its actors are picked."""
        return False

    # -- the life of an effect -------------------------------------------------------------------

    def attach(self, pipeline):
        """Add its images to the scene."""
        self._claim(pipeline, self._claimed())
        super().attach(pipeline)

    def _claim(self, pipeline, props):
        """Raise an error unless it may stand for props in a subplot."""
        for actor in props:
            if not pipeline.renderer.HasViewProp(actor):
                raise ValueError(
                    f'{self._argument}: {actor!r} is not in this subplot; add it there first'
                )
        self._refuse_shared(pipeline.window, props)
        for other in pipeline.things:
            if other is not self and self._conflicts(other, props):
                raise ValueError(
                    f'{self._argument}: {other.name} stands for some of them already; '
                    'remove it first'
                )

    def _refuse_shared(self, window, props):
        elsewhere = _mappers_elsewhere(window)
        for actor in props if elsewhere else ():
            if address(actor.GetMapper()) in elsewhere:
                raise ValueError(
                    f'{self._argument}: {actor!r} shares its mapper with an actor of another '
                    'window, where VTK crashes: give each its own, such as '
                    'pyvista.DataSetMapper(actor.mapper.dataset)'
                )

    def _claimed(self) -> list:
        """Return the props that must be in the subplot."""
        return list(self.props)

    def _put_in(self, renderer):
        for actor in self._card_actors():
            put_inner(renderer, actor)

    def _take_out(self, renderer):
        self.deactivate()
        for actor in self._card_actors():
            renderer.RemoveViewProp(actor)

    def deactivate(self):
        """Show the actors themselves."""
        self._give_back()
        self._frame = None

    def needed(self, frame) -> bool | str:
        """Return True if images may stand for actors in a frame, else why not."""
        if has_shadows(frame.renderer):
            return 'enable_shadows() has VTK draw shadows, which only actors themselves cast'
        return super().needed(frame)

    def prepare(self, frame):
        """Choose what is drawn as an image, and renew images that are wrong."""
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
        """Give everyone their actors back."""
        if frame is self._frame:
            self._give_back()
            self._frame = None

    def _budget(self) -> float:
        """Return the seconds for new images in a frame."""
        unlimited = self.budget_ms is None or is_deterministic()
        return float('inf') if unlimited else self.budget_ms / 1e3


def addresses(actors) -> set[str]:
    """Return the addresses of actors, equal for all wrappers of one VTK object."""
    return {address(actor) for actor in actors}


def _mappers_elsewhere(window) -> set[str]:
    """Return the addresses of the mappers of actors in the windows of other plotters."""
    windows = [plotter.render_window for plotter in _ALL_PLOTTERS.values()]
    renderers = [r for w in windows if w not in (None, window) for r in w.GetRenderers()]
    actors = [p for r in renderers for p in r.GetViewProps() if p.IsA('vtkActor')]
    return {address(m) for m in (method(a, 'GetMapper')() for a in actors) if m is not None}
