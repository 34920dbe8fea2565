"""The surfaces of a renderer, and those that cast shadows."""

from __future__ import annotations

import weakref
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.arguments import checked_each
from pvibr.core.plotters import parts_of_widgets, widgets_of
from pvibr.gl.feature import Feature
from pvibr.gl.scene_pass import is_marker
from pvibr.gl.uniforms import set_fragment_uniforms
from pvibr.maths.views import may_see
from pvibr.things.actor_watch import ActorWatch
from pvibr.things.plain_actors import PlainActors
from pvibr.things.thing import Thing

_FLAT, _WIREFRAME, _SURFACE = 0, 1, 2  # VTK_FLAT, VTK_WIREFRAME, VTK_SURFACE
#: Depth offset of the arrows of PyVista's affine widget, in depth-buffer steps.
_ON_TOP = -20_000
_MAPPERS = ('vtkPolyDataMapper', 'vtkDataSetMapper', 'vtkGlyph3DMapper')


#: Version of an actor, and its `surface_features` then.
_found_features: weakref.WeakKeyDictionary[Any, tuple] = weakref.WeakKeyDictionary()


class Surfaces:
    """The surface actors of a renderer, cached until its props change."""

    def __init__(self, renderer, plain_actors=None):
        self.renderer = renderer
        self.plain_actors = plain_actors or PlainActors(renderer)
        self._key: tuple = ()
        self._user_actors: dict = {}
        self._scenery: set = set()
        self._without_handles: dict = {}
        self._actor_watch, self._watched_actors = ActorWatch(), self._user_actors
        self._versions: dict = {}  # of the visible ones
        self._is_stale = True
        self._last_casters: dict = {}  # by choice

    def begin(self):
        """Check for changes again: a frame begins."""
        self._is_stale = True
        self.plain_actors.begin()

    def _update(self, things):
        """Refresh the lists if props were added or removed."""
        widgets = widgets_of(self.renderer)
        version = self.plain_actors.version()
        props = self.renderer.GetViewProps()
        props_key = props.GetMTime(), version, *map(id, (*things, *widgets))
        if props_key == self._key:
            return
        self._key = props_key
        bounding_box = getattr(self.renderer, 'bounding_box_actor', None)
        actors = [a for p in props for a in self.plain_actors.of(p) if a.IsA('vtkActor')]
        # The actor that represents a thing draws nothing itself.
        own_addresses = {address(a) for t in things for a in (*t.actors(), *t.props)}
        surfaces = {address(a): a for a in actors if a is not bounding_box and _is_surface(a)}
        user_actors = {k: a for k, a in surfaces.items() if k not in own_addresses}
        if user_actors.keys() != self._user_actors.keys():
            self._user_actors, self._last_casters = user_actors, {}
            self._scenery = {k for k, a in user_actors.items() if not a.GetUseBounds()}
        widget_parts = parts_of_widgets(widgets)
        handles = {
            k
            for k, a in user_actors.items()
            if (widget_parts and address(a.GetProperty()) in widget_parts) or _is_on_top(a)
        }
        self._without_handles = {k: a for k, a in user_actors.items() if k not in handles}

    def chosen(self, choice, things, *, handles=True) -> tuple[dict, list]:
        """Return the chosen actors that belong to no thing, and the chosen things."""
        self._update(things)
        actors = self._user_actors if handles else self._without_handles
        if choice is None:
            return actors, list(things)
        is_chosen, plain = _chooser(choice), self.plain_actors
        actors = {k: a for k, a in actors.items() if is_chosen(plain.part_of(a), plain.prop_of(a))}
        return actors, [t for t in things if is_chosen(t)]

    def numbered(self, actors, things) -> tuple[list, list]:
        """Return the props of actors and the things, each once, and the number of each actor."""
        props = [self.plain_actors.prop_of(actor) for actor in actors]
        unique_props = {address(prop): prop for prop in props}
        numbers = {key: number for number, key in enumerate(unique_props, 1)}
        return [*unique_props.values(), *things], [numbers[address(prop)] for prop in props]

    def casters(self, choice, things, frame=None, *, scenery=True) -> Casters:
        """Return the visible chosen actors and things, without handles and scenery."""
        actors, chosen = self.chosen(choice, things, handles=False)
        shown_things = [thing for thing in things if thing.enabled and thing.visibility]
        chosen = [thing for thing in chosen if thing in shown_things]
        self._look()
        excluded = () if scenery else self._scenery
        visible_keys = [k for k in actors if k in self._versions and k not in excluded]
        versions = [self._versions[k] for k in visible_keys]
        shown_actors = [actors[k] for k in visible_keys]
        for thing in shown_things if choice is not None else ():
            # The actors that a thing replaces may be chosen individually.
            if thing not in chosen:
                thing_key = id(thing), thing.content_key()
                chosen_parts = _chosen_of(thing, choice)
                shown_actors += chosen_parts
                versions += [thing_key] * len(chosen_parts)
        casters = Casters(shown_actors, chosen, frame, tuple(versions), self)
        casters.inherit(self._last_casters.get(id(choice)))
        self._last_casters[id(choice)] = casters
        return casters

    def _look(self):
        """Find which actors changed since the last frame, once per frame."""
        if self._watched_actors is not self._user_actors:
            self._watched_actors, self._is_stale = self._user_actors, True
            self._actor_watch = ActorWatch(self._user_actors.values(), self._actor_watch)
        if not self._is_stale:
            return
        self._is_stale = False
        if self._actor_watch.changed():
            pairs = zip(self._user_actors.items(), self._actor_watch.versions, strict=True)
            self._versions = {k: version for (k, a), version in pairs if a.GetVisibility()}
        self._actor_watch.settle()

    def settle(self):
        """Treat the actors as unchanged: drawing may have modified them."""
        self._actor_watch.settle()

    def release(self):
        """Forget the actors and free the GPU memory of copies."""
        self._key, self._user_actors, self._without_handles = (), {}, {}
        self._last_casters = {}
        self.plain_actors.release()


class Choice:
    """An attribute that selects actors and things: None for all, a collection, or a predicate."""

    def __set_name__(self, owner, name):
        self._name = name

    def __get__(self, instance, owner=None):
        return self if instance is None else instance.__dict__.get(self._name)

    def __set__(self, instance, choice):
        if choice is not None and (not callable(choice) or isinstance(choice, type)):
            chosen_props = checked_each(self._name, choice, is_prop, _CHOSEN)
            choice = choice if isinstance(choice, (list, set)) else chosen_props
        instance.__dict__[self._name] = choice


_CHOSEN = 'None for all, actors or things, or a function that returns True for them'


def is_prop(candidate) -> bool:
    """Return whether an object is an actor or a thing."""
    return isinstance(candidate, Thing | _vtk.vtkProp)


def _chooser(choice):
    """Return a predicate, for a choice, of an actor or a thing and the props that contain it."""
    if callable(choice):
        return lambda actor, *_props: choice(actor)
    chosen_addresses = {address(a) for a in choice}
    return lambda *props: any(address(prop) in chosen_addresses for prop in props)


def _chosen_of(thing, choice) -> list:
    """Return the chosen actors among those that a thing replaces."""
    is_chosen = _chooser(choice)
    return [a for a in thing.stands_for() if is_chosen(a)]


def listed(things) -> list:
    """Return a single prop or effect, or several, as a list."""
    is_iterable = isinstance(things, Iterable) and not isinstance(things, str)
    return list(things) if is_iterable and not hasattr(things, 'IsA') else [things]


def _is_surface(actor) -> bool:
    if actor.IsA('vtkSkybox') or actor.IsA('vtkCubeAxesActor') or is_marker(actor):
        return False
    mapper = actor.GetMapper()
    return mapper is not None and any(mapper.IsA(name) for name in _MAPPERS)


def _is_on_top(actor) -> bool:
    """Return True if an actor is drawn over everything else, as the affine widget's arrows are."""
    slope, offset = _vtk.reference(0.0), _vtk.reference(0.0)
    actor.GetMapper().GetRelativeCoincidentTopologyPolygonOffsetParameters(slope, offset)
    return float(offset) <= _ON_TOP


# VTK draws sphere points as squares with normals and depth. The bulge is relative to the window's
# width, not the target's; the position is on the sphere that the light saw, whatever size the
# camera gives it.
SPHERES = Feature(
    'spheres',
    fragment={
        'VTK::Depth::Impl': """#define ZCalcR (ZCalcR * (1.0 + ibr_bulge))
//VTK::Depth::Impl
#define IBR_NORMAL normal@VCVSOutput
#define IBR_PLACE (vertex@VC.xyz + normal@VCVSOutput * ibr_radius)
"""
    },
)


# Points and lines have no plane: they face every light, offset towards it by their width.
THIN = Feature(
    'thin', fragment={'VTK::Normal::Impl': '#define IBR_THIN ibr_radius\n//VTK::Normal::Impl\n'}
)


# Where normals are interpolated, facets approximate a curved surface. The normal's lost length
# gives its bulge over them: 1 - |n| is bulge times curvature.
SMOOTH = Feature(
    'smooth',
    fragment={
        'VTK::CustomUniforms::Dec': """//VTK::CustomUniforms::Dec
float ibr_bend = 0.0;
vec3 ibr_kept(vec3 n)
{
  float size = length(n);
  ibr_bend = clamp(1.0 - size * ibr_scale, 0.0, 0.5);
  return n / size;
}
""",
        'VTK::Normal::Impl': """#define IBR_BEND ibr_bend
#define normalize(n) ibr_kept(n)
//VTK::Normal::Impl
#undef normalize
""",
    },
)


def is_smooth(actor) -> bool:
    """Return whether an actor is lit with interpolated normals."""
    prop = actor.GetProperty()
    if not prop.GetLighting() or prop.GetInterpolation() == _FLAT or is_thin(actor):
        return False
    data = actor.GetMapper().GetInput()
    has_points = data is not None and data.IsA('vtkDataSet')
    normals = data.GetPointData().GetNormals() if has_points else None
    # VTK's normals shrink with the scale.
    return normals is not None and _are_units(normals) and _is_scale_uniform(actor)


def _is_scale_uniform(actor) -> bool:
    """Return whether an actor's transform scales alike along all axes."""
    model_axes = np.reshape(actor.GetMatrix().GetData(), (4, 4))[:3, :3]
    metric = model_axes.T @ model_axes
    differences = np.abs(metric - metric.trace() / 3 * np.eye(3))
    return bool((differences <= 1e-5 * metric.max()).all())


def _are_units(normals) -> bool:
    """Return whether normals have unit length, as of the time of their array."""
    time = normals.GetMTime()
    known_time, are_units = getattr(normals, 'ibr_are_units', (None, False))
    if time != known_time:
        vectors = _vtk.vtk_to_numpy(normals)
        sampled_vectors = np.asarray(vectors[:: len(vectors) // 1000 + 1], float)
        lengths = np.linalg.norm(sampled_vectors, axis=1)
        are_units = bool(np.allclose(lengths, 1.0, atol=1e-3))
        # VTK keeps an object's attributes while its C++ lives.
        normals.ibr_are_units = time, are_units
    return are_units


def surface_features(actor) -> list[Feature]:
    """Return the features that locate surfaces which do not lie on their triangles."""
    version = _surface_version(actor)
    known_version, features = _found_features.get(actor, (None, []))
    if version != known_version:
        features = _find_features(actor)
        _found_features[actor] = version, features
    return features


def _surface_version(actor) -> tuple:
    """Return a value that changes with all that decides about the features of an actor.

    The actor's own time changes with its visibility, too, which differs between lights.
    """
    prop, mapper = actor.GetProperty(), actor.GetMapper()
    data = mapper.GetInput()
    data_version = None if data is None else (address(data), data.GetMTime())
    matrix = actor.GetMatrix().GetData()
    return address(prop), prop.GetMTime(), address(mapper), data_version, matrix


def _find_features(actor) -> list[Feature]:
    has_spheres = draws_spheres(actor)
    has_thin = is_thin(actor) and not has_spheres
    features = {SPHERES: has_spheres, THIN: has_thin, SMOOTH: is_smooth(actor)}
    return [feature for feature, is_needed in features.items() if is_needed]


def set_surface_uniforms(actor, features, *, casts=True):
    """Set the uniforms of the features of an actor, from :func:`surface_features`."""
    if not casts and (THIN in features or SPHERES in features):
        set_fragment_uniforms([actor], {'ibr_bulge': 0.0, 'ibr_radius': 0.0})
    if SMOOTH in features:
        # VTK's normals shrink with the actor's scale.
        scale = abs(actor.GetMatrix().Determinant()) ** (1 / 3)
        set_fragment_uniforms([actor], {'ibr_scale': scale})


def is_thin(actor) -> bool:
    """Return whether an actor draws points or lines whose width is in pixels."""
    if actor.GetMapper().IsA('vtkPointGaussianMapper'):
        return False  # its sizes are in world units
    if actor.GetProperty().GetRepresentation() != _SURFACE:
        return True
    input_data = actor.GetMapper().GetInput()
    return (
        bool(input_data)
        and input_data.IsA('vtkPolyData')
        and not (input_data.GetNumberOfPolys() or input_data.GetNumberOfStrips())
    )


def _draws_lines(actor) -> bool:
    """Return whether a thin actor draws lines."""
    representation = actor.GetProperty().GetRepresentation()
    if representation != _SURFACE:
        return representation == _WIREFRAME
    input_data = actor.GetMapper().GetInput()
    return bool(input_data) and input_data.IsA('vtkPolyData') and input_data.GetNumberOfLines() > 0


def draws_spheres(actor) -> bool:
    """Return whether an actor draws only points as spheres or lines as tubes."""
    prop = actor.GetProperty()
    return bool(prop.GetRenderPointsAsSpheres() or prop.GetRenderLinesAsTubes()) and is_thin(actor)


@contextmanager
def sized(actors, frame, caster_frame, bulge):
    """Scale points and lines to their size in the camera's view."""
    saved_sizes = []
    for actor in actors:
        if is_thin(actor):
            prop, center = actor.GetProperty(), np.array(actor.GetCenter())
            pixel_size = frame.pixel_at(center)
            size_ratio = pixel_size / caster_frame.pixel_at(center)
            point_size, line_width = prop.GetPointSize(), prop.GetLineWidth()
            saved_sizes.append((actor, point_size, line_width))
            prop.SetPointSize(max(point_size * size_ratio, 1.0))
            prop.SetLineWidth(max(line_width * size_ratio, 1.0))
            is_tube = prop.GetRenderLinesAsTubes()
            width = line_width if is_tube or _draws_lines(actor) else point_size
            _set_bulge(actor, 0.0 if is_tube else bulge)
            set_fragment_uniforms([actor], {'ibr_radius': float(0.5 * pixel_size * width)})
    try:
        yield
    finally:
        for actor, point_size, line_width in reversed(saved_sizes):
            actor.GetProperty().SetPointSize(point_size)
            actor.GetProperty().SetLineWidth(line_width)
            _set_bulge(actor, 1.0)


def _set_bulge(actor, bulge):
    if draws_spheres(actor):
        SPHERES.attach(actor)
        set_fragment_uniforms([actor], {'ibr_bulge': bulge - 1.0})


@dataclass
class Casters:
    """Actors and things drawn in views other than the camera's."""

    actors: list = field(default_factory=list)
    things: list = field(default_factory=list)
    frame: Any = None
    versions: tuple = ()
    surfaces: Any = None

    def key(self) -> tuple:
        """Return a key that changes with anything drawn."""
        return self._key

    @cached_property
    def _key(self) -> tuple:
        return self.versions, tuple((id(t), t.content_key()) for t in self.things)

    def settled(self) -> tuple:
        """Return the key after drawing, whose own modifications do not count as changes."""
        vars(self).pop('_key', None)
        if self.surfaces is not None:
            self.surfaces.settle()
        return self._key

    def inherit(self, previous):
        """Reuse cached properties of an earlier frame if nothing changed."""
        if previous is not None and previous.versions == self.versions:
            reusable = {'thin', 'worn', 'translucent', 'addresses'}
            reusable |= set() if previous.thin else {'boxes'}
            vars(self).update({k: v for k, v in vars(previous).items() if k in reusable})

    @cached_property
    def thin(self) -> set:
        """Addresses of the actors that draw points or lines."""
        return {address(a) for a in self.actors if is_thin(a)}

    @cached_property
    def worn(self) -> dict:
        """Indices of the actors by the address of their texture."""
        rows_by_texture: dict = {}
        for row, actor in enumerate(self.actors):
            if (texture := actor.GetTexture()) is not None:
                rows_by_texture.setdefault(address(texture), []).append(row)
        return rows_by_texture

    def wearing(self, texture) -> np.ndarray:
        """Return the world bounds of the actors with a texture, shape (n, 6)."""
        return self.boxes[self.worn.get(address(texture), [])]

    @cached_property
    def addresses(self) -> set:
        """Addresses of the actors."""
        return {address(a) for a in self.actors}

    @cached_property
    def translucent(self) -> list:
        """The translucent actors."""
        return [a for a in self.actors if a.HasTranslucentPolygonalGeometry()]

    def bounds(self) -> np.ndarray:
        """Return all non-empty world bounds, shape (n, 6)."""
        thing_boxes = np.array([t.cast_bounds for t in self.things], float).reshape(-1, 6)
        all_boxes = np.concatenate([self.boxes, thing_boxes])
        return all_boxes[all_boxes[:, 0] <= all_boxes[:, 1]]

    @cached_property
    def boxes(self) -> np.ndarray:
        """The world bounds of each actor, shape (n, 6)."""
        actor_bounds = [a.GetBounds() or (1.0, -1.0) * 3 for a in self.actors]
        widths = np.array([self._width(a) for a in self.actors])
        return np.reshape(actor_bounds, (-1, 6)) + np.outer(widths, [-1.0, 1.0] * 3)

    def _width(self, actor) -> float:
        """Return how far an actor may extend beyond its bounds, world units."""
        mapper = actor.GetMapper()
        if mapper.IsA('vtkPointGaussianMapper'):
            return 3 * mapper.GetScaleFactor()
        if self.frame is None or address(actor) not in self.thin:
            return 0.0
        prop = actor.GetProperty()
        pixel_width = max(prop.GetPointSize(), prop.GetLineWidth())
        world_width = pixel_width * self.frame.pixel_at(np.array(actor.GetCenter()))
        return float(2.0 ** np.ceil(np.log2(world_width)))  # in steps, for a moving camera

    def seen(self, view) -> Casters:
        """Return the casters that may be in a view."""
        in_view = may_see(view, self.boxes)
        actors, versions = compress(self.actors, in_view), compress(self.versions, in_view)
        boxes = [t.cast_bounds for t in self.things]
        things_seen = may_see(view, boxes) | ~np.isfinite(boxes).all(1) if boxes else ()
        things = list(compress(self.things, things_seen))
        return Casters(list(actors), things, self.frame, tuple(versions))
