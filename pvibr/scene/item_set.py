"""Sets of many items that a few actors draw."""

from __future__ import annotations

from pvibr.gl import Texture
from pvibr.gl.binder import Binder
from pvibr.scene.painted import Painted
from pvibr.scene.translucent import DepthSortedDraws


class ItemSet(Painted):
    """Items with looks of their own.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ()
    #: Frames that are drawn to pick need them too.
    picks = True
    _noun = 'items'
    _changes = 0
    _content_key: tuple | None = None

    def _contents(self) -> str:
        return f'{len(self):,} {self._noun}'

    def _can_pick(self) -> bool:
        return self.pickable and self.pipeline is not None and self.needed(None) is True

    def content_key(self) -> tuple:
        """Return a value that changes with the content, camera excluded."""
        return self._changes, self.revision, self.visibility

    def needed(self, frame) -> bool | str:
        """Return True if there is anything to draw, else why not."""
        if not self.visibility:
            return super().needed(frame)
        return bool(len(self)) or f'no {self._noun}'

    def deactivate(self):
        """Hide all actors."""
        for actor in self.actors():
            actor.VisibilityOff()
        self._content_key = None

    def _take_out(self, renderer):
        self.deactivate()
        super()._take_out(renderer)

    def _touch(self):
        """Choose the items again for the next frame."""
        self._content_key = None
        self._changes += 1


class CardSet(ItemSet):
    """Items on cards, sorted among other translucent props where they blend.

    Parameters are those of :class:`pvibr.Effect`.
    """

    FOR_USERS: tuple[str, ...] = ('blends',)

    def _begin_drawing(self, *stale):
        """Start without anything on the GPU; name the textures to be made."""
        self.binder, self._sorted_draws = Binder(), DepthSortedDraws()
        self.textures: dict[str, Texture] = {}
        self._stale = set(stale)

    @property
    def blends(self) -> bool:
        """Whether items are translucent, and so drawn from far to near."""
        return self.prop.GetOpacity() < 1

    # -- the life of an effect ----------------------------------------------------------------

    def content_key(self) -> tuple:
        """Return a value that changes with the content, camera excluded."""
        return *super().content_key(), self.blends

    def prepare(self, frame):
        """Choose which items are drawn, and in which order."""
        self._upload(frame.window)
        props, others = frame.renderer.GetViewProps(), []
        camera = frame.view_from_world.tobytes(), frame.clip_from_view.tobytes(), frame.size
        key: tuple = (*camera, frame.casting, *self._choice_key())
        if self.blends and not frame.casting:
            others = self._sorted_draws.others(frame, self.actors())
            key += (self._sorted_draws.key(others), props.GetMTime())
        if key != self._content_key:
            self._choose(frame, others)
            self._content_key = (*key[:-1], props.GetMTime()) if others else key

    def _choice_key(self) -> tuple:
        """Return what changes with the choice of items, camera excluded."""
        return self.blends, self._changes, self.revision

    def _choose(self, frame, others):
        raise NotImplementedError

    def finish(self, frame):
        """Release the texture units and restore the renderer's blending."""
        self.binder.unbind()
        self._sorted_draws.finish(frame.renderer)

    # -- the GPU ------------------------------------------------------------------------------

    def _upload(self, window):
        raise NotImplementedError

    def _repaint(self):
        self._drop('ibr_looks')

    def _drop(self, *names):
        """Upload textures again for the next frame."""
        self._stale |= set(names)
        self._touch()
