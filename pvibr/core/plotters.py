"""Private parts of PyVista's plotters that pvibr uses."""

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
_INNER = 'pvibr'  # prefix of the names of internal props


def is_closed(plotter) -> bool:
    """Return True if a plotter was closed."""
    return getattr(plotter, '_closed', False)


def is_never_shown(plotter) -> bool:
    """Return True if a plotter has not yet set up its camera and window."""
    return getattr(plotter, '_first_time', False)


def is_watched(plotter) -> bool:
    """Return True if frames are shown as they come: in a window, a notebook or a page."""
    is_seen = getattr(plotter, 'notebook', False) or not is_hidden(plotter)
    return is_seen or bool(frame_callbacks(plotter))


def is_hidden(plotter) -> bool:
    """Return True if a plotter, or a renderer without one, has no window on the screen."""
    window = plotter.renderer.GetRenderWindow()
    return window is None or getattr(plotter, 'off_screen', window.GetOffScreenRendering())


def renderers_of(plotter) -> list:
    """Return the renderers of a plotter's subplots, in order."""
    return list(getattr(plotter, 'renderers', [plotter.renderer]))


def names_of(renderer) -> dict:
    """Return the names of a renderer's actors by address."""
    actors = getattr(renderer, 'actors', None)
    return {address(a): n for n, a in actors.items()} if isinstance(actors, dict) else {}


def send_lights_again(renderers):
    """Have renderers send their lights to the programs that they share with others.

    VTK sends lights only if they changed, though another subplot may have sent its own since.
    """
    for renderer in renderers:
        renderer.GetLights().Modified()


def plain_name(name) -> str:
    """Return a name without the address that PyVista gives to what users did not name."""
    return re.sub(r'\(Addr=0x[0-9a-f]+\)$', '', str(name))


def draw_frame(plotter):
    """Draw a frame as the plotter's ``render`` does, even while it suppresses rendering.

    Without its callbacks, which are told of whole frames only: see `frame_callbacks`.
    """
    for renderer in renderers_of(plotter):
        if isinstance(renderer, pv.Renderer):
            renderer.on_plotter_render()  # charts fit their axes to their data
    plotter.renderer.GetRenderWindow().Render()


def frame_callbacks(plotter) -> list:
    """Return what a plotter calls after each frame, such as trame views."""
    return list(getattr(plotter, '_on_render_callbacks', ()))


def subplot_size(plotter) -> tuple[int, int]:
    """Return width and height of the active subplot in pixels, as it will be before any frame."""
    width, height = plotter.renderer.GetSize()
    if width and height:
        return width, height
    left, bottom, right, top = plotter.renderer.GetViewport()
    extent = np.multiply(plotter.window_size, (right - left, top - bottom))
    return tuple(np.maximum(np.rint(extent), 1).astype(int).tolist())


def is_dragged(window) -> bool:
    """Return True if an interactor style or a widget requests an interactive frame rate."""
    interactor = None if window is None else window.GetInteractor()
    if interactor is None:
        return False
    return window.GetDesiredUpdateRate() > interactor.GetStillUpdateRate()


class _UsersProps(_PropCollection):
    """A renderer's props without internal ones, in names, indices and length."""

    def __init__(self, renderer):
        super().__init__(renderer.GetViewProps())
        self.hooks = Hooks(renderer)
        self.hooks.put({'_actors': self, 'GetActors': _users_actors(weakref.ref(renderer))})

    def _user_indices(self):
        props = self._prop_collection
        indices = range(props.GetNumberOfItems())
        return [k for k in indices if not is_inner(props.GetItemAsObject(k))]

    def _validate_index(self, index):
        return self._user_indices()[super()._validate_index(index)]

    def __len__(self):
        return len(self._user_indices())

    def __iter__(self):
        return iter([self._prop_collection.GetItemAsObject(k) for k in self._user_indices()])

    def __getitem__(self, key):
        if isinstance(key, str) and key in (names := self.keys()):
            key = names.index(key)
        return super().__getitem__(key)


def is_inner(prop) -> bool:
    """Return True if a prop is internal."""
    return method(prop, 'GetObjectName')().startswith(_INNER)


def put_inner(renderer, prop):
    """Add an internal prop, which PyVista's ``actors`` and ``meshes`` leave out."""
    if not is_inner(prop):
        prop.SetObjectName(_INNER)
    prop_collection = getattr(renderer, '_actors', None)
    if prop_collection is not None and not isinstance(prop_collection, _UsersProps):
        _UsersProps(renderer)
    renderer.AddViewProp(prop)


def list_all_props(renderer):
    """Give a renderer PyVista's own lists back once all props in it are the user's."""
    listed = getattr(renderer, '_actors', None)
    if isinstance(listed, _UsersProps) and not any(map(is_inner, renderer.GetViewProps())):
        listed.hooks.take_off()


def _users_actors(renderer):
    def actors():
        user_actors = _vtk.vtkActorCollection()
        for actor in type(renderer()).GetActors(renderer()):
            if not is_inner(actor):
                user_actors.AddItem(actor)
        return user_actors

    return actors


def widgets_of(renderer) -> list:
    """Return the widgets of a renderer's plotter, in all of its subplots."""
    plotter = getattr(renderer, 'parent', None)
    try:
        plotter_vars = vars(getattr(plotter, 'widgets', plotter))
    except (ReferenceError, TypeError):  # a deleted plotter, or none
        return []
    return [w for name in plotter_vars if name.endswith('_widgets') for w in plotter_vars[name]]


def parts_of_widgets(widgets) -> set[str]:
    """Return the addresses of the properties of the actors that widgets consist of."""
    widgets_3d = [w for w in widgets if w.IsA('vtk3DWidget')]
    return {address(getattr(w, n)()) for w in widgets_3d for n in dir(w) if _PROPERTY.fullmatch(n)}


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
    """Return True if a thing is in a renderer, or being added to it."""
    pipeline = thing.pipeline
    is_member = pipeline is not None and pipeline.renderer is renderer
    return is_member and (thing not in pipeline.effects or renderer.HasViewProp(thing))


def border_of(renderer):
    """Return the actor of a subplot's border, or None."""
    return getattr(renderer, '_border_actor', None)


def seams_of(plotter) -> list:
    """Return the actors of lines between subplots, which PyVista 0.49 draws over all of them."""
    layout = getattr(plotter, 'renderers', None)
    overlay = getattr(layout, '_border_overlay_renderer', None)
    return [] if overlay is None else list(overlay.GetViewProps())


def trame_viewer(plotter):
    """Return a plotter's trame viewer that can switch between server and client, or None."""
    ui_module = sys.modules.get('trame_pyvista.ui') or sys.modules.get('pyvista.trame.ui')
    viewer = getattr(ui_module, '_VIEWERS', {}).get(getattr(plotter, '_id_name', None))
    return viewer if hasattr(viewer, 'SERVER_RENDERING') else None


#: Cells from which a mesh is heavy.
_HEAVY = 1_000_000


def heavy_actors(renderer) -> dict[str, int]:
    """Return the cells of visible actors of users that are single heavy meshes, by name."""
    found: dict[str, int] = {}
    actors = getattr(renderer, 'actors', None)
    for name, actor in actors.items() if isinstance(actors, dict) else ():
        if hasattr(actor, 'pipeline'):  # a thing
            continue
        mapper = getattr(actor, 'GetMapper', _no_mapper)()
        data = mapper.GetInput() if mapper is not None and mapper.IsA('vtkMapper') else None
        if data is not None and data.IsA('vtkDataSet') and actor.GetVisibility():
            cells = data.GetNumberOfPolys() if data.IsA('vtkPolyData') else data.GetNumberOfCells()
            if cells > _HEAVY:
                found[name] = cells
    return found


def _no_mapper():
    return None


@contextmanager
def in_subplot(plotter, renderer):
    """Make a renderer's subplot the active one within the block."""
    renderers, ordered = plotter.renderers, renderers_of(plotter)
    active_index = renderers.active_index
    try:
        _activate(renderers, ordered.index(renderer) if renderer in ordered else active_index)
        yield
    finally:
        _activate(renderers, active_index)


def _activate(renderers, index):
    renderers.set_active_renderer(*np.atleast_1d(renderers.index_to_loc(index)).tolist())


def bar_mappers(plotter) -> dict[str, list]:
    """Return the mappers of each scalar bar by title."""
    return getattr(plotter.scalar_bars, '_scalar_bar_mappers', {})


def set_bar_range(plotter, title, limits):
    """Set the range that a scalar bar assumes of its mappers."""
    bar_ranges = getattr(plotter.scalar_bars, '_scalar_bar_ranges', {})
    bar_ranges[title] = tuple(limits)


def remove_from_bars(plotter, actor):
    """Remove an actor's mapper from the scalar bars; a bar without mappers goes."""
    remove_mapper = getattr(plotter.scalar_bars, '_remove_mapper_from_plotter', None)
    if remove_mapper is not None:
        remove_mapper(actor)


def bar_places(plotter) -> set:
    """Return the free slots of scalar bars."""
    return getattr(plotter, '_scalar_bar_slots', set())


def set_legend_label(renderer, actor, label, has_scalars):
    """Set an actor's entry in the renderer's legends as ``add_mesh`` does, or remove it."""
    from pyvista.plotting.renderer import make_legend_face  # plotting modules are imported on use

    legend_entries = getattr(renderer, '_labels', {})
    legend_entries.pop(address(actor), None)
    if label:
        face = make_legend_face('rectangle' if has_scalars else 'triangle')
        color = pv.Color(actor.GetProperty().GetColor())
        legend_entries[address(actor)] = face, label, color


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
    cycled_theme = pv.themes.Theme()
    cycled_theme.load_theme(theme)
    cycled_theme.color, cycled_theme.color_cycler = color, None
    return cycled_theme


def check_bar(plotter, mapper, options):
    """Raise the error that adding a scalar bar would raise; nothing is added."""
    free_places = set(bar_places(plotter)) | (
        {0} if options['title'] in bar_mappers(plotter) else set()
    )
    trial_plotter = _Trial(theme=plotter.theme, lighting='none')
    try:
        bar_places(trial_plotter).intersection_update(free_places)
        with naming('scalar_bar_args', options):
            trial_plotter.add_scalar_bar(
                mapper=mapper, **options | {'interactive': False, 'render': False}
            )
    finally:
        trial_plotter.close()
