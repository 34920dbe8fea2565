"""What of a renderer can be drawn again: plain actors for props that VTK draws by inner ones."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

from pvibr.core import _vtk
from pvibr.core._vtk import address

# VTK draws these by an inner actor that Python cannot reach, without the outer one's shader text.
_WITH_INNER_ACTOR = ('vtkFollower', 'vtkLODActor', 'vtkQuadricLODActor')
_ASSEMBLIES = ('vtkAssembly', 'vtkPropAssembly')
_COMPOSED = (*_ASSEMBLIES, 'vtkLODProp3D', 'vtkProp3DFollower', *_WITH_INNER_ACTOR)
# Labels of axes, whose size and place VTK finds only as it draws them.
_AXIS_FOLLOWERS = ('vtkAxisFollower', 'vtkProp3DAxisFollower')
# Those that their `ShallowCopy` and their input describe in full.
_COPYABLE = (
    'vtkDataSetMapper',
    'vtkPolyDataMapper',
    'vtkOpenGLPolyDataMapper',
    'vtkCompositePolyDataMapper',
)
_IS_COMPOSED: dict[type, bool] = {}


def is_composed(prop) -> bool:
    """Return whether VTK draws a prop by other actors: followers, assemblies, levels of detail."""
    prop_type = type(prop)
    if prop_type not in _IS_COMPOSED:
        _IS_COMPOSED[prop_type] = _is_any(prop, _COMPOSED)
    return _IS_COMPOSED[prop_type]


class PlainActors:
    """The plain actors that draw a renderer's props in other views and into other targets."""

    # Most props are such actors. A composed one has a stand-in for each actor that VTK draws for
    # it, with the same data, looks and matrix; what else an assembly contains is left out.

    def __init__(self, renderer):
        self.renderer = renderer
        self._composed_props: list = []
        self._stand_ins: dict[tuple, _StandIn] = {}
        self._by_actor: dict[str, _StandIn] = {}
        self._by_prop: dict[str, list] = {}
        self._props_time, self._version, self._is_stale = -1, 0, True

    def begin(self):
        """Look at the composed props again: a frame begins, or VTK has drawn it."""
        self._is_stale = True

    def version(self) -> int:
        """Return a number that changes when stand-ins come or go; they are updated."""
        props = self.renderer.GetViewProps()
        if props.GetMTime() != self._props_time:
            self._props_time, self._is_stale = props.GetMTime(), True
            self._composed_props = [prop for prop in props if is_composed(prop)]
        if self._is_stale and (self._composed_props or self._stand_ins):
            self._update()
        self._is_stale = False
        return self._version

    def of(self, prop) -> list:
        """Return the actors that draw a prop of the renderer, visible or not."""
        if not is_composed(prop):
            return [prop]
        self.version()
        return self._by_prop.get(address(prop), [])

    def of_all(self, props) -> list:
        """Return what draws props in the world; VTK marks some of the props in every frame."""
        in_world = [prop for prop in props if prop.IsA('vtkProp3D') or is_composed(prop)]
        return [actor for prop in in_world for actor in self.of(prop) or [prop]]

    def prop_of(self, actor):
        """Return the prop of the renderer that an actor draws, often itself."""
        stand_in = self._by_actor.get(address(actor))
        return actor if stand_in is None else stand_in.prop

    def part_of(self, actor):
        """Return the actor inside a prop that an actor draws, often itself."""
        stand_in = self._by_actor.get(address(actor))
        return actor if stand_in is None else stand_in.part

    def _update(self):
        old_stand_ins, self._stand_ins = self._stand_ins, {}
        for prop in self._composed_props:
            parts = _parts(prop, None, bool(prop.GetVisibility()))
            for index, (part, matrix, is_visible) in enumerate(parts):
                mapper = part.GetMapper()
                key = address(prop), index, address(part), mapper and address(mapper)
                self._stand_ins[key] = old_stand_ins.get(key) or _StandIn(prop, part)
                self._stand_ins[key].match(matrix, is_visible)
        if old_stand_ins.keys() == self._stand_ins.keys():
            return
        self._version += 1
        self._by_actor = {address(s.actor): s for s in self._stand_ins.values()}
        self._by_prop = {}
        for stand_in in self._stand_ins.values():
            self._by_prop.setdefault(address(stand_in.prop), []).append(stand_in.actor)
        for key in old_stand_ins.keys() - self._stand_ins.keys():
            old_stand_ins[key].release(self.renderer.GetRenderWindow())

    def release(self):
        """Forget the stand-ins and free their GPU memory."""
        self._composed_props, self._props_time = [], -1
        self._update()


class _StandIn:
    """A plain actor that draws what one actor inside a prop draws."""

    def __init__(self, prop, part):
        self.prop, self.part = prop, part
        self.actor = _vtk.vtkActor()
        self._has_reach = not _is_any(part, _WITH_INNER_ACTOR)
        self._mapper_copy: Any = None
        self._mapper_time = -1
        self._values: dict = {}
        self._matrix: tuple = ()

    def match(self, matrix, is_visible):
        """Take over what changed; what is attached to the stand-in alone stays."""
        part = self.part
        values = {
            'Mapper': part.GetMapper() if self._has_reach else self._copied(part.GetMapper()),
            'Property': part.GetProperty(),
            'BackfaceProperty': part.GetBackfaceProperty(),
            'Texture': part.GetTexture(),
            'PropertyKeys': part.GetPropertyKeys(),
            'ForceOpaque': part.GetForceOpaque(),
            'ForceTranslucent': part.GetForceTranslucent(),
            'UseBounds': bool(part.GetUseBounds() and self.prop.GetUseBounds()),
            'Visibility': is_visible,
        }
        if self._has_reach:  # its shader text is in the scene, too
            values['ShaderProperty'] = part.GetShaderProperty()
        for name, value in values.items():
            if self._values.get(name) is not value:
                getattr(self.actor, f'Set{name}')(value)
        self._values = values
        if matrix != self._matrix:
            self._matrix, user_matrix = matrix, _vtk.vtkMatrix4x4()
            user_matrix.DeepCopy(matrix)
            self.actor.SetUserMatrix(user_matrix)

    def _copied(self, mapper):
        """Return a copy of a mapper, whose programs are of its newest actor; None for some."""
        if mapper is None or mapper.GetClassName() not in _COPYABLE:
            return None
        self._mapper_copy = self._mapper_copy or mapper.NewInstance()
        if mapper.GetMTime() != self._mapper_time:
            self._mapper_copy.ShallowCopy(mapper)
            self._mapper_time = mapper.GetMTime()  # copying may create a lookup table
        if mapper.GetNumberOfInputConnections(0):
            self._mapper_copy.SetInputConnection(mapper.GetInputConnection(0, 0))
        return self._mapper_copy

    def release(self, window):
        """Free the GPU's memory; all but the copied mapper is the user's."""
        if self._mapper_copy is not None and window is not None and not window.GetNeverRendered():
            window.MakeCurrent()
            self._mapper_copy.ReleaseGraphicsResources(window)


def _parts(prop, matrix, is_visible) -> list[tuple]:
    """Return the actors that VTK draws for a prop, each with its matrix and visibility."""
    if _is_any(prop, _ASSEMBLIES):
        return [
            part
            for leaf, leaf_matrix in _leaves(prop)
            for part in _parts(leaf, leaf_matrix, is_visible and bool(leaf.GetVisibility()))
        ]
    if _is_any(prop, _AXIS_FOLLOWERS):
        return []
    if prop.IsA('vtkProp3DFollower'):
        with _moved(prop, matrix):
            followed_prop = prop.GetProp3D()
            prop.GetBounds()  # moves it, as drawing does
            return [] if followed_prop is None else _parts(followed_prop, None, is_visible)
    if prop.IsA('vtkLODProp3D'):
        actor = _shown_level(prop)
    else:
        actor = prop if prop.IsA('vtkActor') else None
    if actor is None:
        return []
    if matrix is None or prop.IsA('vtkFollower'):
        with _moved(prop, matrix):
            matrix = prop.GetMatrix().GetData()
    return [(actor, matrix, is_visible)]


def _leaves(assembly) -> list[tuple]:
    """Return the props at the ends of an assembly's paths, with their matrices or None."""
    leaves = []
    assembly.InitPathTraversal()
    while (path := assembly.GetNextPath()) is not None:
        node = path.GetLastNode()
        matrix = node.GetMatrix()
        leaves.append((node.GetViewProp(), None if matrix is None else matrix.GetData()))
    return leaves


@contextmanager
def _moved(prop, matrix):
    """Move a prop by the matrix of the assembly around it, as VTK does to draw it."""
    if matrix is None:
        yield
        return
    poked_matrix = _vtk.vtkMatrix4x4()
    poked_matrix.DeepCopy(matrix)
    prop.PokeMatrix(poked_matrix)
    try:
        yield
    finally:
        prop.PokeMatrix(None)


def _shown_level(prop):
    """Return the actor of the level of detail that VTK draws, None if it is no actor."""
    level = prop.GetLastRenderedLODID()
    if not prop.GetAutomaticLODSelection():
        level = prop.GetSelectedLODID()
    elif level < 0:
        level = prop.GetPickLODID()  # not drawn yet
    levels = _vtk.vtkPropCollection()
    prop.GetActors(levels)
    mapper = prop.GetLODMapper(level) if prop.GetNumberOfLODs() else None
    return next((actor for actor in levels if actor.GetMapper() is mapper), None)


def _is_any(prop, class_names) -> bool:
    return any(prop.IsA(name) for name in class_names)
