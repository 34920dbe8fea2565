"""One renderer's chain of effects and things."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, nullcontext, suppress
from difflib import get_close_matches
from functools import partial
from typing import Any

from pvibr.api.turn import Turn
from pvibr.core.counts import TOTAL, difference
from pvibr.core.effect import Effect, put_into
from pvibr.core.errors import ClosedError
from pvibr.core.passes import has_shadows, loses_depth, peels_samples
from pvibr.core.plotters import list_all_props, send_lights_again
from pvibr.core.report import Report, Row
from pvibr.core.threads import DrawingThread
from pvibr.effects import ORDER
from pvibr.gl.annotations import Annotations
from pvibr.gl.driver import renderer_name
from pvibr.gl.fused import Fused
from pvibr.gl.hidden_window import RENDERERS
from pvibr.gl.picture import Picture
from pvibr.gl.refused_shaders import REFUSED
from pvibr.gl.scene_pass import ScenePass
from pvibr.gl.texture import Texture, nbytes_of, release
from pvibr.things.buffers import Buffers, Tap
from pvibr.things.casters import Surfaces
from pvibr.things.draw_order import DrawOrder
from pvibr.things.frame import Frame
from pvibr.things.splats import Splats
from pvibr.things.thing import Thing

_IDLE_FRAMES = 8  # without image effects, after which their pictures are freed
_PEELS_NOTHING = (
    'Translucent things are missing: VTK with depth peeling draws none on this software driver '
    "if windows are multisampled. Call disable_anti_aliasing() or enable_anti_aliasing('ssaa')."
)


class Pipeline:
    """What runs before and after a renderer draws; empty, it does nothing and costs nothing."""

    def __init__(self, renderer, adaptive_quality=None, thread=None):
        self.renderer = renderer
        self._thread = RENDERERS[renderer] = thread or DrawingThread()
        #: Raises an error in other threads than that which draws.
        self.check_thread = self._thread.check
        self.time = 0.0
        self._adaptive_quality = adaptive_quality
        self._entries: list[_Entry] = []
        self._effects: tuple[Effect, ...] = ()
        self._things: list[Thing] = []
        #: The effects that draw on the picture, in running order.
        self.image_effects: list[Effect] = []
        self._observers: list[int] = []
        self._frames = 0
        #: The other subplots of the window, and when its renderers last changed.
        self._neighbours: list = []
        self._time_of_renderers = -1
        self._turn: Turn | None = None
        self.surfaces = Surfaces(renderer)
        self.buffers = Buffers(renderer, self.surfaces.plain_actors)
        self.order = DrawOrder(renderer, self.surfaces.plain_actors)
        self._stage = _Stage(renderer, self.buffers, self.surfaces.plain_actors)
        self.watch: Any = None
        #: Called when effects came or went, or something is made in the background.
        self.changed: Callable[[], None] = lambda: None
        self._time_of_props = -1  # at which no effect was gone
        self._closed = self._peels = False
        self._counts = (TOTAL.so_far(),) * 2  # before and after the last frame

    def __repr__(self) -> str:
        return f'<Pipeline: {self._names() or "no effects"}, {self._frames} frames>'

    @property
    def window(self):
        """The renderer's window, None while it has none."""
        return self.renderer.GetRenderWindow()

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects and things, in running order."""
        return self._effects

    @property
    def things(self) -> list:
        """What draws by actors of its own, such as instances."""
        return self._things

    def buffer(self, name) -> Tap:
        """Draw a frame and read one of its buffers."""
        tap = Tap(name)
        self.add(tap)
        try:
            with (
                nullcontext() if self._adaptive_quality is None else self._adaptive_quality.full()
            ):
                self.window.Render()
            why = next(e.row.why for e in self._entries if e.effect is tap)
        finally:
            self.remove(tap)
        if tap.array is None:
            raise RuntimeError(f'buffer {name!r} could not be read: {why or "no frame was drawn"}')
        return tap

    def exposure(self, frame, picture) -> tuple[float, Texture | None]:
        """Return the stops of later effects, and the texel of further ones or None."""
        exposing = [e.effect for e in self._entries if e.running]
        stops = sum(e.expose(frame, picture) for e in exposing)
        return stops, next((e.metered for e in exposing if e.metered is not None), None)

    def horizon_color(self, frame) -> tuple[float, ...]:
        """Return the colour of what is far away: that of the horizon, else of the background."""
        found = (e.horizon_color(frame) for e in self._effects if e.enabled)
        return next(filter(None, found), None) or frame.renderer.GetBackground()

    def add(self, effect) -> Effect:
        """Add an effect or a thing, from the next frame on."""
        self.check_addable(effect)
        effect.attach(self)
        put_into(effect, self)
        self._enter(sorted([*self._entries, _Entry(effect, Row(effect.name))], key=_place))
        try:
            self._observe()
        except Exception:
            self.remove(effect)
            raise
        return effect

    def _enter(self, entries):
        """Store sorted entries, and what each frame often asks for."""
        self._entries = entries
        self._effects = tuple(entry.effect for entry in entries)
        self._things = [e for e in self._effects if isinstance(e, Thing)]
        self._time_of_props = -1
        self.image_effects = [e for e in self._effects if e.is_image_effect]

    def check_addable(self, effect):
        """Raise an error unless an effect can be added."""
        self.check_thread()
        if self._closed:
            raise ClosedError('the plotter is closed; create a new one and add the effect there')
        if not isinstance(effect, Effect):
            near = get_close_matches(getattr(effect, '__name__', str(effect)), ORDER, 1, 0.8)
            meant = near[0] if near else 'Shadows'
            raise TypeError(
                f'effect must be a pvibr.Effect, such as pvibr.{meant}(), got {effect!r}'
            )
        if effect.before not in (None, *ORDER):
            raise ValueError(
                f'{effect.name}.before must be one of {", ".join(ORDER)}, got {effect.before!r}'
            )
        if effect.pipeline is not None:
            effect.pipeline.forget_removed()
        if effect.pipeline is not None:
            here = 'this subplot' if effect.pipeline is self else 'another subplot'
            raise ValueError(
                f'{effect.name} is in {here} already: remove it first, or add one more of its kind'
            )

    def remove(self, effect):
        """Take an effect or a thing out and free what it holds on the GPU."""
        self.check_thread()
        if not any(e is effect for e in self.effects):
            name = effect.name if isinstance(effect, Effect) else f'thing = {effect!r:.80}'
            raise ValueError(f'{name} is not in this subplot; here are: {self._names() or "none"}')
        put_into(effect, self)  # Python's collector may have cleared it, a weak reference
        self._enter([e for e in self._entries if e.effect is not effect])
        self.make_current()
        try:
            effect.release()
        finally:
            effect.detach()
            put_into(effect, None)
            self._observe()

    def clear(self):
        """Take everything out."""
        with ExitStack() as each:  # the others go, too, where one raises an error
            for effect in reversed(self.effects):
                each.callback(self.remove, effect)

    def release(self):
        """Remove all effects for good, while the context is alive; calling it again is fine."""
        self._closed = True
        try:
            self.clear()
        finally:
            self._stage.release()
            self.buffers.release()
            self.surfaces.release()

    def report(self) -> Report:
        """Return what ran in the last frame, what was skipped and why."""
        return Report(
            [e.reported() for e in self._entries],
            self._frames,
            self._stage.nbytes + self.buffers.nbytes,
            '' if self._adaptive_quality is None else self._adaptive_quality.why,
            difference(*reversed(self._counts)),
        )

    def _names(self):
        return ', '.join(effect.name for effect in self.effects)

    def make_current(self):
        """Make the context of the window current, if it was drawn."""
        self.check_thread()
        window = self.window
        if window is not None and not window.GetNeverRendered():
            window.MakeCurrent()

    def _observe(self):
        """Watch the renderer while, and only while, there is something to run."""
        if self.watch is not None:
            self.watch.set(bool(self._entries))
        self.changed()
        if self._entries and not self._observers:
            # Before and after everyone else's: what others do at these events is in the picture.
            # Things go first, so that the frame has one clipping range.
            self._observers = [
                self.renderer.AddObserver('StartEvent', self._on_first),
                self.renderer.AddObserver('StartEvent', self._on_start, -1.0),
                self.renderer.AddObserver('EndEvent', self._on_end, 1.0),
                self.renderer.AddObserver('ActiveCameraEvent', self._on_camera),
            ]
        elif not self._entries:
            for tag in self._observers:
                self.renderer.RemoveObserver(tag)
            self._observers = []
            self.make_current()
            self._stage.release()
            self.buffers.release()
            self.surfaces.release()
            list_all_props(self.renderer)

    def view(self) -> Frame:
        """Return the view of the camera as it is now, at the quality of the last frame."""
        quality = 1.0 if self._adaptive_quality is None else self._adaptive_quality.latest
        return Frame.of(self.renderer, time=self.time, quality=quality)

    def _on_first(self, _renderer, _event):
        renderers = self.window.GetRenderers()
        if renderers.GetMTime() != self._time_of_renderers:
            self._time_of_renderers = renderers.GetMTime()
            same_layer = [r for r in renderers if r.GetLayer() == self.renderer.GetLayer()]
            self._neighbours = [r for r in same_layer if r is not self.renderer]
        if self._neighbours:
            send_lights_again([self.renderer])
        for thing in self._things:
            thing.begin_frame()

    def _on_start(self, _renderer, _event):
        if self._turn is not None:  # a frame that did not end
            self._turn.put_camera_back()
            self._turn = None
        self.forget_removed()
        quality = self._adaptive_quality.quality(self.renderer) if self._adaptive_quality else 1.0
        frame = Frame.of(self.renderer, index=self._frames, time=self.time, quality=quality)
        self.surfaces.begin()
        self._turn = turn = Turn(frame, self._thread)
        for entry in self._entries if not frame.picking else ():
            if entry.effect.as_sampled is not None and entry.effect.enabled:
                turn.take(turn.guard([entry], entry.effect.as_sampled, turn.begun))
        for entry in self._entries:
            entry.running = False
        for entry in self._entries:
            if turn.frame.astray:
                self._prepare_again(turn)
            entry.begin(turn)
        self._prepare_again(turn)
        if self._entries:
            turn.guard(self._entries, self.order.sort, turn.drawn, self._things)
        images = [e for e in self._entries if e.running and e.is_image_effect]
        if images and not frame.picking:
            turn.images = images
            effects = [e.effect for e in images]
            turn.guard(images, self._stage.begin, turn.frame, effects, self.things)
        elif not frame.picking:
            self._stage.rest()
        turn.camera = self.renderer.GetActiveCamera()

    def _on_camera(self, _renderer, _event):
        """Prepare things for a light of which VTK draws a shadow map, and for the eye again."""
        turn, camera = self._turn, self.renderer.GetActiveCamera()
        if turn is None or turn.camera is None or not has_shadows(self.renderer):
            return
        frame = turn.drawn
        if camera is not turn.camera:
            frame = frame.elsewhere(Frame.of(self.renderer).view, frame.size)
        for entry in self._entries:
            if entry.running and isinstance(entry.effect, Thing):
                turn.guard([entry], entry.effect.prepare, frame)

    def _prepare_again(self, turn):
        """Prepare things again that an effect has drawn in other views."""
        astray = turn.frame.astray
        for entry in self._entries if astray else ():
            if entry.effect in astray and entry.running:
                turn.guard([entry], entry.effect.prepare, turn.drawn)
        astray.clear()

    def _on_end(self, _renderer, _event):
        turn, self._turn = self._turn, None
        if turn is not None:
            self._end(turn)
        if self._neighbours:
            send_lights_again(self._neighbours)
        for thing in self._things:
            thing.end_frame()
        if turn is not None:
            turn.warn()

    def _end(self, turn):
        self._frames += not turn.frame.picking
        refused = [*REFUSED.items()] if REFUSED else ()  # as the scene was drawn
        REFUSED.clear()
        for entry in self._entries:
            if entry.running:
                frame = turn.frame if entry.is_image_effect else turn.drawn
                turn.guard([entry], entry.effect.finish, frame)
        turn.put_camera_back()
        self.order.finish()
        self._stage.end(turn)
        if refused:
            turn.blame(refused, self._entries)
        if not self._peels and peels_samples(self.renderer):
            self._peels = True
            if 'llvmpipe' in renderer_name(self.window):
                turn.failures.append(_PEELS_NOTHING)
        self._counts = turn.counts, TOTAL.so_far()

    def forget_removed(self):
        """Forget things whose props were removed by the plotter's own means, between frames."""
        time = self.renderer.GetViewProps().GetMTime()
        if self._turn is not None or time == self._time_of_props:
            return
        self._time_of_props = time
        for effect in self._effects:
            with suppress(Exception):  # of users' own effects, within VTK's loop
                if effect.is_gone(self.renderer):
                    self.remove(effect)


class _Entry:
    """An effect in a pipeline, with what it did last."""

    def __init__(self, effect, row):
        self.effect, self.row, self.is_image_effect = effect, row, effect.is_image_effect
        self.running = self._awake = False

    def begin(self, turn):
        """Ask whether the frame needs the effect, and prepare it."""
        effect, row, self.running = self.effect, self.row, False
        if 0 in turn.frame.size or (turn.frame.picking and not effect.picks):
            return
        row.ms = 0.0
        try:
            is_prepared = self._awake and effect.enabled and effect.is_prepared(turn.drawn)
        except Exception as error:
            turn.fail(self, error)
            is_prepared = False
        if is_prepared:
            self.running = True
        elif not effect.enabled:
            self.stop('off', row.why if row.state == 'off' else 'enabled is False')
        else:
            self._ask(turn)
        if self._awake and not self.running:
            turn.guard([self], effect.deactivate)
        self._awake = self.running

    def _ask(self, turn):
        frame = turn.frame if self.is_image_effect else turn.drawn
        needed = turn.guard([self], self._prepare, frame)
        if needed is not True and self.effect.enabled:
            self.stop('skipped', needed or 'not needed')

    def _prepare(self, frame):
        if (needed := self.effect.needed(frame)) is True:
            self.running = self._awake = True
            self.row.state, self.row.why = 'ran', ''
            self.effect.prepare(frame)
        return needed

    def stop(self, state, why):
        self.running = False
        self.row.state, self.row.why = state, str(why)

    def reported(self):
        """Return the row with what the effect itself says."""
        details = dict(self.effect.report())
        self.row.effect = self.effect.name
        self.row.bytes = int(details.pop('bytes', 0))
        self.row.details = details
        return self.row


class _Stage:
    """Where image effects work: the scene's pass, the picture, the annotations."""

    def __init__(self, renderer, buffers, plain_actors):
        self.renderer, self.buffers = renderer, buffers
        self._things: list = []
        self._annotations = Annotations(renderer)
        self._begun = False
        self._idle = 0
        self._picture: Picture | None = None
        self._scene: ScenePass | None = None
        self._fused: Fused | None = None
        self._splats = Splats(renderer, plain_actors)

    @property
    def nbytes(self) -> int:
        return nbytes_of(self._picture, self._scene, self._annotations)

    def begin(self, frame, effects, things):
        """Hide flat props, and provide what effects need besides colours, before drawing."""
        self._things = things
        self._begun, self._idle = True, 0
        self._splats.look()
        self._annotations.hide(frame.size)
        self._scene = scene = self._scene or ScenePass(self.renderer.GetRenderWindow())
        # A renderer that draws over others' pixels has no picture of its own in floats.
        own = not self.renderer.GetPreserveColorBuffer()
        single = own and any(e.one_sample for e in effects)
        floats = own and (
            any(e.needs_hdr for e in effects)
            or (any(e.draws_background for e in effects) and self._splats.shine())
        )
        self._splats.match(floats)
        scene.begin(frame, floats, single=single)
        if any(e.surfaces for e in effects):
            self.buffers.attach(frame, scene, things)

    def end(self, turn):
        """After the renderer drew: all back in its place, then effects, then flat props."""
        begun, self._begun, scene = self._begun, False, self._scene
        if not begun or scene is None:
            return
        scene.end()
        self.buffers.detach()
        self._annotations.show()
        self._splats.settle()
        place = turn.frame.origin, turn.frame.size
        running = [e for e in turn.images if e.running]
        if running or scene.is_apart:
            turn.guard(turn.images, self._run, turn, scene, running, place)
        self._annotations.draw(*place)

    def _run(self, turn, scene, entries, place):
        picture = self._picture_of(place, scene.needs_hdr)
        on_black = any(e.effect.draws_background for e in entries)
        picture.take(scene.target, on_black=on_black)
        if loses_depth(self.renderer):
            picture.find_depth = partial(self.buffers.depth, turn.frame, self._things)
        for entry in entries:
            picture.last = entry is entries[-1]
            turn.guard([entry], entry.effect.render, turn.frame, picture)
        picture.present()

    def _picture_of(self, place, needs_hdr):
        old = self._picture
        if old is None or (old.origin, old.size, old.needs_hdr) != (*place, needs_hdr):
            if old is not None:
                old.release()
            window, (origin, size) = self.renderer.GetRenderWindow(), place
            self._fused = self._fused or Fused(window)
            self._picture = Picture(window, origin, size, self._fused, needs_hdr)
        return self._picture

    def rest(self):
        """Free the pictures after some frames without image effects; making them takes long."""
        self._idle += 1
        if self._idle >= _IDLE_FRAMES:
            self._free()

    def _free(self):
        release(self._picture, self._scene)
        self._picture = self._scene = None

    def release(self):
        self._free()
        release(self._fused, self._annotations)
        self._fused = None


def _place(entry):
    """Return a number to sort by: of the class or the nearest of its bases that has a place."""
    if entry.effect.before is not None:
        return ORDER.index(entry.effect.before) - 0.5
    names = [c.__name__ for c in type(entry.effect).__mro__]
    return next((ORDER.index(n) for n in names if n in ORDER), -1)
