"""The surfaces of a renderer, and those that cast shadows."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.arguments import checked_each
from pvibr.core.plotters import parts_of_widgets, widgets_of
from pvibr.gl.feature import Feature
from pvibr.gl.scene_pass import is_marker
from pvibr.gl.uniforms import set_fragment_uniforms
from pvibr.maths.views import may_see
from pvibr.things.actor_watch import ActorWatch
from pvibr.things.thing import Thing

_FLAT, _WIREFRAME, _SURFACE = 0, 1, 2  # VTK_FLAT, VTK_WIREFRAME, VTK_SURFACE
#: Steps of the depth buffer by which PyVista's affine widget lifts its arrows.
_ON_TOP = -20_000
_MAPPERS = ('vtkPolyDataMapper', 'vtkDataSetMapper', 'vtkGlyph3DMapper')


class Surfaces:
    """The actors of a renderer that are surfaces, cached until props change."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._key: tuple = ()
        self._free: dict = {}
        self._scenery: set = set()
        self._others: dict = {}  # than the handles of widgets
        self._watch, self._watched = ActorWatch(), self._free
        self._versions: dict = {}  # of those that are visible
        self._old = True
        self._last: dict = {}  # casters by choice

    def begin(self):
        """Look for changes anew: a frame begins."""
        self._old = True

    def _update(self, things):
        """Refresh the list if props were added or removed."""
        widgets = widgets_of(self.renderer)
        key = self.renderer.GetViewProps().GetMTime(), *map(id, (*things, *widgets))
        if key == self._key:
            return
        self._key = key
        # Parts of assemblies are not props of their own.
        box = getattr(self.renderer, 'bounding_box_actor', None)
        props = [p for p in self.renderer.GetViewProps() if p.IsA('vtkActor')]
        # The prop that stands for a thing draws nothing itself.
        owned = {address(a) for t in things for a in (*t.actors(), *t.props)}
        found = {address(a): a for a in props if a is not box and _is_surface(a)}
        free = {k: a for k, a in found.items() if k not in owned}
        if free.keys() != self._free.keys():
            self._free, self._last = free, {}
            self._scenery = {k for k, a in free.items() if not a.GetUseBounds()}
        parts = parts_of_widgets(widgets)
        mine = {
            k
            for k, a in free.items()
            if (parts and address(a.GetProperty()) in parts) or _is_on_top(a)
        }
        self._others = {k: a for k, a in free.items() if k not in mine}

    def chosen(self, choice, things, *, handles=True) -> tuple[dict, list]:
        """Return the chosen actors of no thing, with or without widgets' handles, and things."""
        self._update(things)
        actors = self._free if handles else self._others
        if choice is None:
            return actors, list(things)
        is_chosen = _chooser(choice)
        actors = {k: a for k, a in actors.items() if is_chosen(k, a)}
        return actors, [t for t in things if is_chosen(address(t), t)]

    def casters(self, choice, things, frame=None, *, scenery=True) -> Casters:
        """Return the chosen actors that are visible, no handles nor scenery, and the things."""
        actors, chosen = self.chosen(choice, things, handles=False)
        self._look()
        out = () if scenery else self._scenery
        visible = [k for k in actors if k in self._versions and k not in out]
        versions = [self._versions[k] for k in visible]
        shown = [actors[k] for k in visible]
        for thing in things if choice is not None else ():
            # Of a thing that stands for actors, these may be chosen one by one.
            if thing not in chosen:
                key = id(thing), thing.content_key()
                mine = _chosen_of(thing, choice)
                shown, versions = [*shown, *mine], [*versions, *[key] * len(mine)]
        found = Casters(shown, chosen, frame, tuple(versions), self)
        found.inherit(self._last.get(id(choice)))
        self._last[id(choice)] = found
        return found

    def _look(self):
        """Find which actors changed since the last frame, once in a frame."""
        if self._watched is not self._free:
            self._watched, self._old = self._free, True
            self._watch = ActorWatch(self._free.values(), self._watch)
        if not self._old:
            return
        self._old = False
        if self._watch.changed():
            pairs = zip(self._free.items(), self._watch.versions, strict=True)
            self._versions = {k: version for (k, a), version in pairs if a.GetVisibility()}
        self._watch.settle()

    def settle(self):
        """Take the actors for unchanged: drawing may modify them."""
        self._watch.settle()


class Choice:
    """An attribute that chooses actors and things, checked when set: all, some, or a function."""

    def __set_name__(self, owner, name):
        self._name = name

    def __get__(self, instance, owner=None):
        return self if instance is None else instance.__dict__.get(self._name)

    def __set__(self, instance, choice):
        if choice is not None and (not callable(choice) or isinstance(choice, type)):
            several = checked_each(self._name, choice, is_prop, _CHOSEN)
            choice = choice if isinstance(choice, (list, set)) else several
        instance.__dict__[self._name] = choice


_CHOSEN = 'None for all, actors or things, or a function that returns True for them'


def is_prop(one) -> bool:
    """Return whether something is an actor or a thing."""
    return isinstance(one, Thing | _vtk.vtkProp)


def _chooser(choice):
    """Return a function of an address and an actor that tells if a choice has it."""
    if callable(choice):
        return lambda _key, actor: choice(actor)
    wanted = {address(a) for a in choice}
    return lambda key, _actor: key in wanted


def _chosen_of(thing, choice) -> list:
    """Return the chosen ones of the actors that a thing stands for."""
    is_chosen = _chooser(choice)
    return [a for a in thing.stands_for() if is_chosen(address(a), a)]


def listed(things) -> list:
    """Return one prop or effect, or several, as a list."""
    several = isinstance(things, Iterable) and not isinstance(things, str)
    return list(things) if several and not hasattr(things, 'IsA') else [things]


def _is_surface(actor) -> bool:
    if actor.IsA('vtkSkybox') or actor.IsA('vtkCubeAxesActor') or is_marker(actor):
        return False
    mapper = actor.GetMapper()
    return mapper is not None and any(mapper.IsA(name) for name in _MAPPERS)


def _is_on_top(actor) -> bool:
    """Return True if an actor is drawn over all others, as arrows are that move an actor."""
    factor, units = _vtk.reference(0.0), _vtk.reference(0.0)
    actor.GetMapper().GetRelativeCoincidentTopologyPolygonOffsetParameters(factor, units)
    return float(units) <= _ON_TOP


# Points as spheres are squares to VTK, which has only their normals and depth. Their bulge is told
# in widths of the window, whatever the target's width is; their place is on the sphere that light
# met, whatever the camera has made of their pixels since.
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


# Points and lines have no plane of their own: they face every light, from as far before them as
# they are wide for it.
THIN = Feature(
    'thin', fragment={'VTK::Normal::Impl': '#define IBR_THIN ibr_radius\n//VTK::Normal::Impl\n'}
)


# Facets stand for a curved surface where normals are averaged: by how much it bulges over them is
# told by the length that interpolated normals lose: 1 - |n| is the bulge times the curvature.
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
    """Return whether an actor is lit by interpolated normals."""
    data, prop = actor.GetMapper().GetInput(), actor.GetProperty()
    has_points = data is not None and data.IsA('vtkDataSet')
    if not has_points or data.GetPointData().GetNormals() is None:
        return False
    smooth = prop.GetLighting() and prop.GetInterpolation() != _FLAT
    return smooth and not is_thin(actor) and _tells_bulge(actor, data.GetPointData())


def _tells_bulge(actor, point_data) -> bool:
    """Return whether normals have unit length at points and equal scale in all directions."""
    axes = pv.array_from_vtkmatrix(actor.GetMatrix())[:3, :3]
    square = axes.T @ axes
    if not np.allclose(square, np.trace(square) / 3 * np.eye(3), rtol=0, atol=1e-5 * square.max()):
        return False  # as short as the actor is large, another way in each direction
    normals = _vtk.vtk_to_numpy(point_data.GetNormals())
    some = np.asarray(normals[:: len(normals) // 1000 + 1], float)
    return bool(np.allclose(np.linalg.norm(some, axis=1), 1.0, atol=1e-3))


def surface_features(actor) -> list[Feature]:
    """Return the features that locate a surface which is not on its triangles."""
    spheres = draws_spheres(actor)
    thin = is_thin(actor) and not spheres
    features = {SPHERES: spheres, THIN: thin, SMOOTH: is_smooth(actor)}
    return [feature for feature, wanted in features.items() if wanted]


def set_surface_uniforms(actor, *, casts=True):
    """Set the uniforms of :func:`surface_features`."""
    if not casts and is_thin(actor):
        set_fragment_uniforms([actor], {'ibr_bulge': 0.0, 'ibr_radius': 0.0})
    if is_smooth(actor):
        # VTK's normals are as short as the actor is large.
        scale = abs(actor.GetMatrix().Determinant()) ** (1 / 3)
        set_fragment_uniforms([actor], {'ibr_scale': scale})


def is_thin(actor) -> bool:
    """Return whether an actor draws points or lines, with a width in pixels."""
    if actor.GetMapper().IsA('vtkPointGaussianMapper'):
        return False  # its points are as large as the world says
    if actor.GetProperty().GetRepresentation() != _SURFACE:
        return True
    data = actor.GetMapper().GetInput()
    return (
        bool(data)
        and data.IsA('vtkPolyData')
        and not (data.GetNumberOfPolys() or data.GetNumberOfStrips())
    )


def _draws_lines(actor) -> bool:
    """Return whether a thin actor draws lines."""
    representation = actor.GetProperty().GetRepresentation()
    if representation != _SURFACE:
        return representation == _WIREFRAME
    data = actor.GetMapper().GetInput()
    return bool(data) and data.IsA('vtkPolyData') and data.GetNumberOfLines() > 0


def draws_spheres(actor) -> bool:
    """Return whether an actor draws points as spheres, and nothing else."""
    prop = actor.GetProperty()
    return bool(prop.GetRenderPointsAsSpheres() or prop.GetRenderLinesAsTubes()) and is_thin(actor)


@contextmanager
def sized(actors, frame, seen, bulge):
    """Scale points and lines to their size in the camera's view."""
    kept = []
    for actor in actors:
        if is_thin(actor):
            prop, center = actor.GetProperty(), np.array(actor.GetCenter())
            pixel = frame.pixel_at(center)
            scale = pixel / seen.pixel_at(center)
            size, width = prop.GetPointSize(), prop.GetLineWidth()
            kept.append((actor, size, width))
            prop.SetPointSize(max(size * scale, 1.0))
            prop.SetLineWidth(max(width * scale, 1.0))
            tube = prop.GetRenderLinesAsTubes()
            radius = 0.5 * pixel * (width if tube or _draws_lines(actor) else size)
            _set_bulge(actor, 0.0 if tube else bulge)
            set_fragment_uniforms([actor], {'ibr_radius': float(radius)})
    try:
        yield
    finally:
        for actor, size, width in reversed(kept):
            actor.GetProperty().SetPointSize(size)
            actor.GetProperty().SetLineWidth(width)
            _set_bulge(actor, 1.0)


def _set_bulge(actor, bulge):
    if draws_spheres(actor):
        SPHERES.attach(actor)
        set_fragment_uniforms([actor], {'ibr_bulge': bulge - 1.0})


@dataclass
class Casters:
    """Actors and things drawn in views from elsewhere."""

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
        """Return the key once all is drawn: what drawing changed is no change."""
        vars(self).pop('_key', None)
        if self.surfaces is not None:
            self.surfaces.settle()
        return self._key

    def inherit(self, before):
        """Reuse cached properties of an earlier frame if nothing changed."""
        if before is not None and before.versions == self.versions:
            kept = {'thin', 'worn', 'translucent', 'addresses'}
            kept |= set() if before.thin else {'boxes'}
            vars(self).update({k: v for k, v in vars(before).items() if k in kept})

    @cached_property
    def thin(self) -> set:
        """Addresses of the actors that draw points or lines."""
        return {address(a) for a in self.actors if is_thin(a)}

    @cached_property
    def worn(self) -> dict:
        """Addresses of the textures that actors wear, and the rows of those."""
        found: dict = {}
        for row, actor in enumerate(self.actors):
            if (texture := actor.GetTexture()) is not None:
                found.setdefault(address(texture), []).append(row)
        return found

    def wearing(self, texture) -> np.ndarray:
        """Return the world bounds of the actors that wear a texture, shape (n, 6)."""
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
        """Return the world bounds of all that have any, shape (n, 6)."""
        reach = [t.cast_bounds for t in self.things]
        things = np.array(reach, float).reshape(-1, 6)
        boxes = np.concatenate([self.boxes, things])
        return boxes[boxes[:, 0] <= boxes[:, 1]]

    @cached_property
    def boxes(self) -> np.ndarray:
        """Return the world bounds of each actor, shape (n, 6)."""
        boxes = [a.GetBounds() or (1.0, -1.0) * 3 for a in self.actors]
        found = np.array(boxes, float).reshape(-1, 6)
        widths = np.array([self._width(a) for a in self.actors])
        return found + np.outer(widths, [-1.0, 1.0] * 3)

    def _width(self, actor) -> float:
        """Return how far an actor may extend beyond its bounds, world units."""
        mapper = actor.GetMapper()
        if mapper.IsA('vtkPointGaussianMapper'):
            return 3 * mapper.GetScaleFactor()
        if self.frame is None or address(actor) not in self.thin:
            return 0.0
        prop = actor.GetProperty()
        pixels = max(prop.GetPointSize(), prop.GetLineWidth())
        width = pixels * self.frame.pixel_at(np.array(actor.GetCenter()))
        return float(2.0 ** np.ceil(np.log2(width)))  # in steps: the camera moves all the time

    def seen(self, view) -> Casters:
        """Return the casters that may be in a view."""
        inside = may_see(view, self.boxes)
        actors = list(compress(self.actors, inside))
        boxes = [t.cast_bounds for t in self.things]
        near = may_see(view, boxes) | ~np.isfinite(boxes).all(1) if boxes else ()
        versions = tuple(compress(self.versions, inside))
        return Casters(actors, list(compress(self.things, near)), self.frame, versions)
