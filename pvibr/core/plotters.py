"""What pvibr asks of PyVista's plotters that has no public name."""

from __future__ import annotations

import re
import sys
import weakref
from contextlib import contextmanager
from functools import wraps
from inspect import signature

import numpy as np
import pyvista as pv
from pyvista.plotting.prop_collection import _PropCollection

from pvibr.core import _vtk
from pvibr.core._vtk import address, method
from pvibr.core.arguments import naming
from pvibr.core.hooks import Hooks

_PROPERTY = re.compile(r'Get\w*Property')
_INNER = 'pvibr'  # begins the names of props that are none of the user's


def is_closed(plotter) -> bool:
    """Return True if a plotter was closed."""
    return getattr(plotter, '_closed', False)


def is_never_shown(plotter) -> bool:
    """Return True if a plotter still has to set up its camera and window."""
    return getattr(plotter, '_first_time', False)


def renderers_of(plotter) -> list:
    """Return the renderers of a plotter's subplots, in order."""
    return list(getattr(plotter, 'renderers', [plotter.renderer]))


def frame_callbacks(plotter) -> list:
    """Return what a plotter calls after each frame, such as trame views."""
    return list(getattr(plotter, '_on_render_callbacks', ()))


def is_dragged(window) -> bool:
    """Return True if an interactor style or a widget requests interactive frame rates."""
    interactor = None if window is None else window.GetInteractor()
    if interactor is None:
        return False
    return window.GetDesiredUpdateRate() > interactor.GetStillUpdateRate()


class _UsersProps(_PropCollection):
    """The props of a renderer that users added: names, indices and length leave out the others."""

    def __init__(self, renderer):
        super().__init__(renderer.GetViewProps())
        self.hooks = Hooks(renderer)
        self.hooks.put({'_actors': self, 'GetActors': _users_actors(weakref.ref(renderer))})

    def _places(self):
        props = self._prop_collection
        found = range(props.GetNumberOfItems())
        return [k for k in found if not is_inner(props.GetItemAsObject(k))]

    def _validate_index(self, index):
        return self._places()[super()._validate_index(index)]

    def __len__(self):
        return len(self._places())

    def __iter__(self):
        return iter([self._prop_collection.GetItemAsObject(k) for k in self._places()])

    def __getitem__(self, key):
        if isinstance(key, str) and key in (names := self.keys()):
            key = names.index(key)
        return super().__getitem__(key)


def is_inner(prop) -> bool:
    """Return True if a prop is none of the user's."""
    return method(prop, 'GetObjectName')().startswith(_INNER)


def put_inner(renderer, prop):
    """Add a prop that is none of the user's: ``actors`` and ``meshes`` of PyVista leave it out."""
    if not is_inner(prop):
        prop.SetObjectName(_INNER)
    listed = getattr(renderer, '_actors', None)
    if listed is not None and not isinstance(listed, _UsersProps):
        _UsersProps(renderer)
    renderer.AddViewProp(prop)


def list_all_props(renderer):
    """Give a renderer PyVista's own lists back once all props in it are the user's."""
    listed = getattr(renderer, '_actors', None)
    if isinstance(listed, _UsersProps) and not any(map(is_inner, renderer.GetViewProps())):
        listed.hooks.take_off()


def _users_actors(renderer):
    def actors():
        found = _vtk.vtkActorCollection()
        for actor in type(renderer()).GetActors(renderer()):
            if not is_inner(actor):
                found.AddItem(actor)
        return found

    return actors


def widgets_of(renderer) -> list:
    """Return the widgets of the plotter that a renderer is of, those of its other subplots too."""
    plotter = getattr(renderer, 'parent', None)
    try:
        lists = vars(getattr(plotter, 'widgets', plotter))
    except (ReferenceError, TypeError):  # a plotter that is no more, or none
        return []
    return [w for name, some in lists.items() if name.endswith('_widgets') for w in some]


def parts_of_widgets(widgets) -> set[str]:
    """Return the addresses of the properties that widgets give to the actors they consist of."""
    solid = [w for w in widgets if w.IsA('vtk3DWidget')]
    return {address(getattr(w, n)()) for w in solid for n in dir(w) if _PROPERTY.fullmatch(n)}


def adding_by_component(kind):
    """Return what wraps PyVista's ``add_actor``: a kind of actors draw nothing by themselves."""

    def wrap(method):
        arguments = signature(method)

        @wraps(method)
        def add_actor(renderer, actor, *args, **kwargs):
            if not isinstance(actor, kind) or _is_here(actor, renderer):
                return method(renderer, actor, *args, **kwargs)
            call = arguments.bind(renderer, actor, *args, **kwargs).arguments
            call |= {'remove_existing_actor': False}
            with in_subplot(renderer.parent, renderer):
                ibr = renderer.parent.ibr
                ibr.pipeline.check_addable(actor)
                actor.name = given_name = call.get('name') or actor.given_name
                ibr.add(actor)
            try:
                return method(**call | {'name': actor.name})
            finally:
                actor.name = given_name  # not the one that PyVista makes up for what has none

        return add_actor

    return wrap


def _is_here(thing, renderer) -> bool:
    """Return True if a thing is in a renderer, or on its way in."""
    pipeline = thing.pipeline
    here = pipeline is not None and pipeline.renderer is renderer
    return here and (thing not in pipeline.effects or renderer.HasViewProp(thing))


def border_of(renderer):
    """Return the actor of a subplot's border, or None."""
    return getattr(renderer, '_border_actor', None)


def trame_viewer(plotter):
    """Return the trame viewer of a plotter that can switch between server and client, or None."""
    ui = sys.modules.get('trame_pyvista.ui') or sys.modules.get('pyvista.trame.ui')
    viewer = getattr(ui, '_VIEWERS', {}).get(getattr(plotter, '_id_name', None))
    return viewer if hasattr(viewer, 'SERVER_RENDERING') else None


@contextmanager
def in_subplot(plotter, renderer):
    """Have the subplot of a renderer be the active one."""
    renderers = plotter.renderers
    before = renderers.active_index
    where = renderers_of(plotter)
    try:
        _activate(renderers, where.index(renderer) if renderer in where else before)
        yield
    finally:
        _activate(renderers, before)


def _activate(renderers, index):
    renderers.set_active_renderer(*np.atleast_1d(renderers.index_to_loc(index)).tolist())


def bar_mappers(plotter) -> dict[str, list]:
    """Return the mappers of each scalar bar by its title."""
    return getattr(plotter.scalar_bars, '_scalar_bar_mappers', {})


def set_bar_range(plotter, title, limits):
    """Set what a scalar bar believes to be the range of its mappers."""
    ranges = getattr(plotter.scalar_bars, '_scalar_bar_ranges', {})
    ranges[title] = tuple(limits)


def remove_from_bars(plotter, actor):
    """Take the mapper of an actor from the scalar bars, which go with their last one."""
    remove = getattr(plotter.scalar_bars, '_remove_mapper_from_plotter', None)
    if remove is not None:
        remove(actor)


def bar_places(plotter) -> set:
    """Return the numbers of the free places of scalar bars."""
    return getattr(plotter, '_scalar_bar_slots', set())


def set_legend_label(renderer, actor, label, has_scalars):
    """Let legends of a renderer have an entry of an actor, as ``add_mesh`` does, or none."""
    from pyvista.plotting.renderer import make_legend_face  # what plots is imported when used

    labels = getattr(renderer, '_labels', {})
    labels.pop(address(actor), None)
    if label:
        face = make_legend_face('rectangle' if has_scalars else 'triangle')
        labels[address(actor)] = face, label, pv.Color(actor.GetProperty().GetColor())


class _Trial(pv.BasePlotter):
    """A plotter without a window."""


def next_theme(plotter, color):
    """Return the theme of a new thing, with the next colour of the cycle if none is given."""
    theme = getattr(plotter, 'theme', None)
    if theme is None or color is not None:
        return theme
    color = plotter.renderer.next_color
    if color == theme.color:
        return theme
    cycled = pv.themes.Theme()
    cycled.load_theme(theme)
    cycled.color, cycled.color_cycler = color, None
    return cycled


def check_bar(plotter, mapper, options):
    """Raise what adding a scalar bar would raise; nothing is added."""
    places = set(bar_places(plotter)) | (
        {0} if options['title'] in bar_mappers(plotter) else set()
    )
    trial = _Trial(theme=plotter.theme, lighting='none')
    try:
        bar_places(trial).intersection_update(places)
        with naming('scalar_bar_args', options):
            trial.add_scalar_bar(
                mapper=mapper, **options | {'interactive': False, 'render': False}
            )
    finally:
        trial.close()
