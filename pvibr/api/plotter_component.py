"""``plotter.ibr``: what users add to a subplot, and what they read of it."""

from __future__ import annotations

import contextlib
import weakref
from operator import attrgetter
from typing import TYPE_CHECKING

import pyvista as pv

from pvibr.api import (
    camera_methods,
    capture_methods,
    export_methods,
    page_methods,
    picking_methods,
    presets,
    setting_costs,
    state_methods,
    waiting,
)
from pvibr.api.add_methods import AddMethod
from pvibr.api.click_picking import ClickPicking
from pvibr.api.mesh_widgets import mesh_widgets
from pvibr.api.pipeline import Pipeline
from pvibr.api.waiting import waiting_pictures
from pvibr.capture.adaptive_quality import AdaptiveQuality
from pvibr.capture.clock import Clock, checked_time
from pvibr.capture.tiled_screenshot import TiledScreenshot
from pvibr.core.errors import ClosedError
from pvibr.core.hooks import Hooks
from pvibr.core.observers import weakly
from pvibr.core.params import Param
from pvibr.core.plotters import heavy_actors, is_closed, renderers_of
from pvibr.core.report import Report
from pvibr.core.spelling import Complete, check_attribute
from pvibr.core.state_files import named
from pvibr.core.threads import DrawingThread
from pvibr.export.exporters import plain_exporters, release_exporters
from pvibr.export.web_report import HandOver, Watch
from pvibr.things.thing import Thing

if TYPE_CHECKING:
    from pvibr.figures.animated_actor import AnimatedActor
    from pvibr.figures.crowd import Crowd
    from pvibr.instances.instances import Instances
    from pvibr.large.large_mesh import LargeMesh
    from pvibr.photos.photo_mesh import PhotoMesh
    from pvibr.points.billboards import Billboards
    from pvibr.points.cylinders import Cylinders
    from pvibr.points.ellipsoids import Ellipsoids
    from pvibr.points.spheres import Spheres
    from pvibr.substitutes.image_layers import ImageLayers
    from pvibr.substitutes.impostor import Impostor

_FRAME_MS = attrgetter('frame_ms')


@pv.register_plotter_component('ibr')
class IBRComponent(metaclass=Complete):
    """Image-based rendering of a plotter; it acts on the active subplot.

    Once the plotter is closed, methods that add, draw or export raise a `ClosedError`. In a thread
    other than that which first used ``plotter.ibr`` or drew it, all methods but `close` raise a
    `ThreadError`; others may read `time`, `playing`, `quality` and `buffer_objects`, read and set
    `interactive_frame_ms` and settings of effects.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        The plotter.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add_spheres([[0, 0, 0], [2, 0, 0]])
    >>> pl.ibr
    <plotter.ibr: 1 subplot, 1 thing, 0 effects, time 0 s>
    >>> pl.close()
    """

    interactive_frame_ms = Param(
        100.0,
        'Frame time that is met while the view moves, by lower quality, which is full again at '
        'rest; 0 never lowers it.',
        range='[0, inf)',
        unit='ms',
    )

    def __init__(self, plotter):
        self._plotter = plotter
        self._thread = DrawingThread()
        self._pipelines: list[Pipeline] = []
        self._closed = False
        self._time = 0.0
        self._clock = Clock(plotter, self._show_time)
        self._adaptive_quality = AdaptiveQuality(
            plotter,
            self._frame_ms,
            playing=lambda: self._clock.ticking,
            effects=self._all_effects,
        )
        self._screenshots = TiledScreenshot(
            plotter, self._all_effects, self._every_pipeline, self._adaptive_quality.full
        )
        self._hand_over = HandOver(plotter, self.web_report)
        self._looks: dict[Pipeline, presets.Look] = {}
        self._clicks: ClickPicking | None = None
        self._buffer_objects: list = []
        self._at_close: list = []
        self._last_report = Report([])
        self._costs: dict[Pipeline, setting_costs.Costs] = {}
        self._hooks, self._picture_hooks = Hooks(plotter), Hooks(plotter)

    def _frame_ms(self, effects) -> float:
        """Return the frame time to meet while the view moves: the least that is asked for."""
        asked_times = map(_FRAME_MS, effects)
        return min(filter(None, (self.interactive_frame_ms, *asked_times)), default=0.0)

    def __setattr__(self, name, value):
        check_attribute(self, name)
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        if self._is_closed:
            return '<plotter.ibr: closed>'
        things = sum(len(p.things) for p in self._pipelines)
        effects = len(self._all_effects()) - things
        subplots = len(renderers_of(self._plotter))
        counts = (subplots, 'subplot'), (things, 'thing'), (effects, 'effect')
        parts = [f'{count} {noun}{"" if count == 1 else "s"}' for count, noun in counts]
        playing = ', playing' if self.playing else ''
        return f'<plotter.ibr: {", ".join(parts)}, time {self.time:g} s{playing}>'

    # -- methods by subject: each module says more ----------------------------------------------

    fly_to = camera_methods.fly_to
    play = capture_methods.play
    stop = capture_methods.stop
    screenshot = capture_methods.screenshot
    movie = capture_methods.movie
    wait = waiting.wait
    costs = setting_costs.costs
    web_report = export_methods.web_report
    to_plain_plotter = export_methods.to_plain_plotter
    export_glb = export_methods.export_glb
    export_html = page_methods.export_html
    show_web = page_methods.show_web
    pick = picking_methods.pick
    enable_picking = picking_methods.enable_picking
    disable_picking = picking_methods.disable_picking
    buffer = picking_methods.buffer
    look = presets.look
    state = state_methods.state
    restore = state_methods.restore
    save_state = state_methods.save_state
    load_state = state_methods.load_state
    load_state_text = state_methods.load_state_text

    # -- time and quality ------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Animation time in seconds."""
        return self._time

    @time.setter
    def time(self, seconds):
        self._thread.check()
        self._show_time(checked_time(seconds))
        self._clock.set(self._time)

    def _show_time(self, seconds):
        self._time = seconds
        for pipeline in self._pipelines:
            pipeline.time = seconds
            by_kind: dict[type[Thing], list[Thing]] = {}
            for item in pipeline.things:
                by_kind.setdefault(type(item), []).append(item)
            for kind, items in by_kind.items():
                kind.follow_all(items)

    @property
    def playing(self) -> bool:
        """Whether the animation clock runs."""
        return self._clock.running

    @property
    def quality(self) -> float:
        """Quality of the last frame: below 1 if one exceeded `interactive_frame_ms` in motion."""
        return self._adaptive_quality.latest

    # -- subplots --------------------------------------------------------------------------------

    @property
    def _is_closed(self) -> bool:
        return self._closed or is_closed(self._plotter)

    def _check_open(self):
        self._thread.check()
        if self._is_closed:
            raise ClosedError('the plotter is closed; create a new one and add to its ibr')

    @property
    def pipeline(self) -> Pipeline:
        """The active subplot's pipeline."""
        self._check_open()
        return self._pipeline_of(self._plotter.renderer)

    def _every_pipeline(self) -> list:
        return [self._pipeline_of(renderer) for renderer in renderers_of(self._plotter)]

    def _subplots(self) -> dict:
        """Return the pipelines by subplot index."""
        self._check_open()
        renderers = renderers_of(self._plotter)
        return {renderers.index(p.renderer): p for p in self._pipelines}

    def _all_effects(self) -> list:
        return [effect for pipeline in self._pipelines for effect in pipeline.effects]

    def _show(self, reset_camera=None, render=False):
        """Reset the camera, by default only if it was never set, and optionally render."""
        renderer = self._plotter.renderer
        if reset_camera or (reset_camera is None and not getattr(renderer, 'camera_set', True)):
            self._plotter.reset_camera(render=False)
        if render:
            self._plotter.render()

    def _pipeline_of(self, renderer) -> Pipeline:
        for pipeline in self._pipelines:
            if pipeline.renderer is renderer:
                pipeline.forget_removed()
                return pipeline
        pipeline = Pipeline(renderer, self._adaptive_quality, self._thread)
        pipeline.time = self._time
        pipeline.watch = Watch(renderer, self._hand_over.warn)
        pipeline.changed = weakly(self._hook)
        self._pipelines.append(pipeline)
        return pipeline

    def _hook(self):
        """Replace methods of the plotter while, and only while, anything is in a subplot."""
        holds = any(pipeline.effects for pipeline in self._pipelines)
        if holds and not self._hooks:
            self._hooks.put(mesh_widgets(self._plotter) | plain_exporters(self._plotter, self))
        elif self._hooks and not holds:
            release_exporters(self._plotter)
            self._hooks.take_off()
            self._adaptive_quality.release()
        is_pending = any(effect.pending for effect in self._all_effects())
        if is_pending and not self._picture_hooks:
            self._picture_hooks.put(waiting_pictures(self._plotter, self))
        elif self._picture_hooks and not is_pending:
            self._picture_hooks.take_off()

    @property
    def effects(self) -> tuple:
        """Effects and things in the active subplot, in the order in which they run."""
        return self.pipeline.effects

    @property
    def contents(self) -> dict:
        """Effects and things by subplot index (as text) and by name, as in the state.

        A second one of the same name is called ``'Name 2'``.
        """
        subplots = self._subplots().items()
        return {str(n): named(p.effects) for n, p in subplots if p.effects}

    @property
    def buffer_objects(self) -> list:
        """Actors and things that the ids of the last ``buffer('id')`` refer to."""
        return list(self._buffer_objects)

    def __len__(self) -> int:
        """Return how many effects and things are in the active subplot."""
        return len(self.effects)

    def __bool__(self) -> bool:
        return True

    def __iter__(self):
        return iter(self.effects)

    def __contains__(self, item) -> bool:
        """Return True if an effect, or one of this name, is in the active subplot."""
        return any(e is item or e.name == item for e in self.effects)

    def __getitem__(self, name):
        """Return the effect or thing in the active subplot that has a name."""
        found = [effect for effect in self.effects if effect.name == name]
        if not found:
            names = ', '.join(repr(effect.name) for effect in self.effects) or 'nothing'
            raise KeyError(f'no thing {name!r} is in this subplot; here are: {names}')
        return found[0]

    # -- adding and removing ---------------------------------------------------------------------

    def add(self, effect):
        """Add an effect or a thing to the active subplot.

        It replaces what has the same given name. Effects of which a subplot has only one, such as
        `Bloom`, replace the one that is there; others, such as `Outline`, replace one made of the
        same arguments and not changed since. So a notebook cell may be run twice.

        Parameters
        ----------
        effect : pvibr.Effect
            An effect that is in no subplot yet.

        Returns
        -------
        pvibr.Effect
            The same effect; its settings can be changed at any time.

        Raises
        ------
        TypeError
            If `effect` is not an effect.
        ValueError
            If the effect is already in a subplot.
        """
        pipeline = self.pipeline
        pipeline.check_addable(effect)
        for old in [e for e in pipeline.effects if _replaces(effect, e)]:
            pipeline.remove(old)
        pipeline.add(effect)
        if isinstance(effect, Thing) and effect.bar is not None:  # also of what was removed
            effect.bar.show(effect)
        return effect

    add_instances: AddMethod[Instances] = AddMethod('pvibr.instances.instances.Instances')
    add_animated: AddMethod[AnimatedActor | Crowd] = AddMethod('pvibr.figures.animated.animated')
    add_billboards: AddMethod[Billboards] = AddMethod('pvibr.points.billboards.Billboards')
    add_spheres: AddMethod[Spheres] = AddMethod('pvibr.points.spheres.Spheres')
    add_cylinders: AddMethod[Cylinders] = AddMethod('pvibr.points.cylinders.Cylinders')
    add_ellipsoids: AddMethod[Ellipsoids] = AddMethod('pvibr.points.ellipsoids.Ellipsoids')
    add_impostor: AddMethod[Impostor] = AddMethod('pvibr.substitutes.impostor.Impostor')
    add_image_layers: AddMethod[ImageLayers] = AddMethod(
        'pvibr.substitutes.image_layers.ImageLayers'
    )
    add_large_mesh: AddMethod[LargeMesh] = AddMethod('pvibr.large.large_mesh.LargeMesh')
    add_photos: AddMethod[PhotoMesh] = AddMethod('pvibr.photos.photo_mesh.PhotoMesh')
    distribute: AddMethod[Thing] = AddMethod('pvibr.cluster.distributed.Distributed')

    def remove(self, thing):
        """Remove an effect or a thing from its subplot.

        Parameters
        ----------
        thing : pvibr.Effect or str
            An effect or a thing in one of the plotter's subplots, or the name of one in the
            active subplot.

        Raises
        ------
        KeyError
            If nothing in the active subplot has the name.
        ValueError
            If it is in no subplot of this plotter.
        """
        thing = self[thing] if isinstance(thing, str) else thing
        here = (p for p in self._pipelines if any(e is thing for e in p.effects))
        next(here, self.pipeline).remove(thing)

    def clear(self):
        """Remove all effects and things from the active subplot, and its look."""
        presets.take_off(self, self.pipeline)
        self.pipeline.clear()

    # -- reports ---------------------------------------------------------------------------------

    def inspect(self, on=None, *, levels=True, cells=True, atlas=True, table=True):
        """Show how the active subplot is drawn, or stop showing it.

        Parameters
        ----------
        on : bool, optional
            Whether to show it; by default the call toggles.
        levels : bool
            Whether to colour instances by the level of detail that draws them, with a legend.
        cells : bool
            Whether to show the boxes that are culled as units.
        atlas : bool, Instances or Impostor
            Whether, or of which thing, to show the images, those in use outlined.
        table : bool
            Whether to list the images taken for the last frame and its milliseconds.

        Returns
        -------
        pvibr.inspection.inspection.Inspection or None
            Its settings can be changed, and ``remove()`` ends it; None if it is not shown.

        Raises
        ------
        TypeError
            If an argument is of the wrong type.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> view = pl.ibr.inspect(cells=False)
        >>> view.table = False
        >>> pl.ibr.inspect() is None
        True
        >>> pl.close()
        """
        from pvibr.inspection.inspection import toggle

        return toggle(self.pipeline, on, atlas, levels=levels, cells=cells, table=table)

    def report(self) -> Report:
        """Return a report on which effects ran in the last frame, and why others did not.

        Once the plotter is closed, as ``show()`` leaves it, the report is that of its last frame.
        """
        self._thread.check()
        if self._is_closed:
            return self._last_report
        report, costs = self.pipeline.report(), self._costs.get(self.pipeline)
        report.costs = '' if costs is None else str(costs)
        report.large_meshes = heavy_actors(self.pipeline.renderer)
        return report

    # -- the end ---------------------------------------------------------------------------------

    def on_close(self, function):
        """Call a function when this is closed, for example to close a panel.

        Parameters
        ----------
        function : callable
            Called once, without arguments.

        Raises
        ------
        TypeError
            If `function` is not callable.
        """
        self._thread.check()
        if not callable(function):
            raise TypeError(f'function must be callable, got {function!r:.80}')
        self._at_close.append(function)

    def close(self):
        """Release everything; plotters call it when they close. It may be called again."""
        self._thread.end()  # also for another thread, as when an interpreter ends
        if self._pipelines and not self._is_closed:
            with contextlib.suppress(Exception):  # an effect's report must not keep it open
                self._last_report = self.report()
        self._closed = True
        with contextlib.suppress(Exception):  # the window may be gone
            self.disable_picking()
        self._hand_over.stop()
        self._clock.stop()
        self._adaptive_quality.release()
        self._buffer_objects, self._looks, self._costs = [], {}, {}
        pipelines, self._pipelines = self._pipelines, []
        functions, self._at_close = self._at_close, []
        with contextlib.ExitStack() as steps:  # the last one first, and all where one fails
            for step in (self._let_go, *functions, *(p.release for p in pipelines)):
                steps.callback(step)

    def _let_go(self):
        """Hold the plotter weakly, so that it ends when its last user lets it go."""
        if not isinstance(self._plotter, weakref.ProxyTypes):
            plotter = weakref.proxy(self._plotter)
            parts = self._hand_over, self._clock, self._adaptive_quality, self._screenshots
            for part in (self, *parts):
                vars(part)['_plotter'] = plotter

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def __plotter_close__(self):
        self.close()

    def __plotter_deep_clean__(self):
        self._pipelines.clear()


def _replaces(effect, old) -> bool:
    """Return True if an effect takes the place of another: of its name, its kind, or its like."""
    same_kind = effect.single and type(effect) is type(old)
    same = effect.once and effect.is_like(old)
    return old.name == effect.given_name or same_kind or same
