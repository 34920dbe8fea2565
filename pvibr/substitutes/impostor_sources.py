"""The actors that impostors replace, and doubles that draw their unlit surfaces."""

from __future__ import annotations

from itertools import product

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.instances.instances import Instances
from pvibr.meshes.surfaces import polygons_of
from pvibr.substitutes.draft_meshes import DraftMesh
from pvibr.substitutes.impostor_maths import dop_corners
from pvibr.textures.material_textures import copy_property
from pvibr.things.actor_watch import (
    NOT_FINITE,
    TRANSLUCENT,
    has_thin_cells,
    ineligibility,
    is_evenly_clear,
    stroke_width,
    updated_data,
)
from pvibr.things.casters import listed
from pvibr.things.clipping import set_planes
from pvibr.things.content_key import planes_of
from pvibr.things.thing import Thing

# Images store the colour before lighting, which VTK then multiplies by the texture, and the normal
# after VTK's flip for back faces; for actors without lighting, the colour alone. Edges are unlit.
_UNLIT = """//VTK::Light::Impl
  fragOutput0 = vec4(diffuseColor, 1.0);
  vec3 ibr_normal = ibr_world_from_view * normalVCVSOutput;
  vec3 ibr_unlit = ambientColor;
"""
_PLAIN = """//VTK::Light::Impl
  vec3 ibr_normal = vec3(0.0);
  vec3 ibr_unlit = vec3(0.0);
"""
# VTK lights lines and points only by normals of points, and else declares none for them.
_NO_NORMAL = '//VTK::Normal::Dec\nvec3 normalVCVSOutput = vec3(0.0);\n'
_OUTPUT = """  if (gl_FragData[0].a < 0.5) discard;
  gl_FragData[0].a = 1.0;
  gl_FragData[1] = vec4(ibr_normal * 0.5 + 0.5, ibr_material / 255.0);
  gl_FragData[2] = vec4(ibr_unlit, 1.0);
//VTK::DepthPeeling::Impl
"""


class Materials:
    """Numbered materials: ambient, diffuse, specular, its power and colour."""

    most = 256

    def __init__(self):
        self._numbers: dict[tuple, int] = {}

    def number(self, prop) -> int:
        """Return the number of a property's material."""
        specular = prop.GetSpecular()
        # Without highlights, their power and colour do not matter.
        highlight = (1.0, 0.0, 0.0, 0.0)
        if specular:
            highlight = prop.GetSpecularPower(), *prop.GetSpecularColor()
        key = prop.GetAmbient(), prop.GetDiffuse(), specular, *highlight, 0.0
        if key not in self._numbers and len(self._numbers) == self.most:
            scale = np.array([1, 1, 1, 0.01, 1, 1, 1, 0])
            difference = [np.abs(scale * np.subtract(k, key)).sum() for k in self._numbers]
            return int(np.argmin(difference))
        return self._numbers.setdefault(key, len(self._numbers))

    def __len__(self):
        return len(self._numbers)

    @property
    def shiny(self) -> bool:
        """Whether any material has highlights."""
        return any(key[2] > 0 for key in self._numbers)

    def table(self) -> np.ndarray:
        """Return the materials as an image, shape (2, 256, 4), float32."""
        table = np.zeros((2, self.most, 4), np.float32)
        for key, number in self._numbers.items():
            table[:, number] = np.reshape(key, (2, 4))
        return table


class Source:
    """An actor, and a double that draws its unlit surface."""

    def __init__(self, actor, materials):
        self.actor, self.materials = actor, materials
        self.why, self.seconds = 'not drawn yet', np.inf
        self.center, self.half, self.radius = np.zeros(3), np.zeros((3, 3)), 0.0
        self.corners = np.zeros((80, 3))
        self.cells = self.tries = 0
        self.stroke_px = 0.0  # width of the widest edges, lines and points, 0 if none
        self.has_tint = False  # whether edges have another colour than black
        self.opacity = 1.0
        self.planes: list = []  # of the actor's mapper
        self.draft = DraftMesh()
        self._cut_planes: list = []  # of the double's mapper
        self._double = _vtk.vtkActor()
        self._look_times: tuple = ()
        self._shape_key: tuple = ()
        self._local_radius = 0.0
        self._local_corners = np.zeros((80, 3))

    @property
    def shown(self) -> bool:
        """Whether the actor is visible to the user."""
        return bool(self.actor.GetVisibility())

    def update(self, dops):
        """Update eligibility, bounding box and double."""
        self.why = ineligibility(self.actor, relit=True)
        self.opacity = 1.0
        if self.why == TRANSLUCENT and is_evenly_clear(self.actor):
            self.why, self.opacity = '', self.actor.GetProperty().GetOpacity()
        self.planes = planes_of(self.actor)
        if self.why:
            data = updated_data(self.actor.GetMapper())
            self.cells = data.GetNumberOfCells() if data and data.IsA('vtkDataSet') else 0
            self.seconds, self._shape_key = np.inf, ()
            return
        data = self.actor.GetMapper().GetInput()
        self._measure(data, dops)
        world_from_model = pv.array_from_vtkmatrix(self.actor.GetMatrix())[:3]
        if not np.isfinite(world_from_model).all():
            self.why = NOT_FINITE
            return
        bounds = np.reshape(self.actor.GetMapper().GetBounds(), (3, 2))
        # Relative to the middle, for precision far from the origin.
        self.center = world_from_model[:, :3] @ bounds.mean(1) + world_from_model[:, 3]
        self.half = np.diag(np.diff(bounds, axis=1)[:, 0] / 2) @ world_from_model[:, :3].T
        self.radius = float(self._local_radius * np.linalg.norm(world_from_model[:, :3], 2))
        self.corners = self._local_corners @ world_from_model[:, :3].T
        if self.radius == 0.0:
            self.why = 'a point'
        self.stroke_px = stroke_width(self.actor, data)
        prop = self.actor.GetProperty()
        self.has_tint = bool(prop.GetEdgeVisibility() and any(prop.GetEdgeColor()))
        self._copy_looks(data)

    def _measure(self, data, dops):
        shape_key = data, data.GetMTime()
        if shape_key == self._shape_key:
            return
        self._shape_key, self.cells, self.seconds = shape_key, data.GetNumberOfCells(), np.inf
        self.tries = 0
        bounds = np.reshape(self.actor.GetMapper().GetBounds(), (3, 2))
        points = data.GetPoints() if data.IsA('vtkPointSet') else None
        if points is None:
            box_corners = np.array(list(product(*bounds)))
            self._local_corners, self._local_radius = _hull(box_corners, bounds.mean(1))
            return
        array = points.GetData()
        key, modified_time = (array.GetAddressAsString(''), *bounds.ravel()), array.GetMTime()
        if dops.get(key, (-1,))[0] != modified_time:
            coordinates = _vtk.vtk_to_numpy(array)
            # Points that no cell uses may be NaN.
            coordinates = coordinates[np.isfinite(coordinates).all(1)]
            dops[key] = modified_time, _hull(coordinates, bounds.mean(1))
        self._local_corners, self._local_radius = dops[key][1]

    def _copy_looks(self, data):
        actor = self.actor
        mapper, prop = actor.GetMapper(), actor.GetProperty()
        drawn_data = data
        if data.IsA('vtkPolyData') and not has_thin_cells(data):
            drawn_data = polygons_of(pv.wrap(data))
        cleaned_time = 0 if drawn_data is data else data.GetMTime()
        look_times = mapper, mapper.GetMTime(), prop, prop.GetMTime(), data, cleaned_time
        number = self.materials.number(actor.GetProperty())
        double = self._double
        double.SetUserMatrix(actor.GetMatrix())
        double.SetTexture(actor.GetTexture())
        if look_times == self._look_times:
            return
        self._look_times = look_times
        double.SetMapper(copied(actor.GetMapper(), drawn_data))
        set_planes(double.GetMapper(), self._cut_planes)
        copy_property(double.GetProperty(), actor.GetProperty())
        unlit(double, number)
        has_normals = data.GetPointData().GetNormals() is not None
        if self.stroke_px and not (has_normals and actor.GetProperty().GetInterpolation()):
            shader = double.GetShaderProperty()
            shader.AddFragmentShaderReplacement('//VTK::Normal::Dec', True, _NO_NORMAL, False)

    def clip(self, planes):
        """Clip what :meth:`draw` draws."""
        if planes != self._cut_planes:
            self._cut_planes = planes
            set_planes(self._double.GetMapper(), planes)

    def draw(self, renderer, world_from_view, texel, texels_per_pixel, faces=None):
        """Draw colour and coverage, normal and material, and unlit edges, of all faces or some."""
        if faces is not None:
            self._double.GetProperty().SetFrontfaceCulling(faces == 'back')
            self._double.GetProperty().SetBackfaceCulling(faces == 'front')
        if self.stroke_px:
            scale_strokes(self._double.GetProperty(), self.actor.GetProperty(), texels_per_pixel)
        uniforms = self._double.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniformMatrix3x3('ibr_world_from_view', world_from_view)
        self._double.RenderOpaqueGeometry(renderer)

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.draft.release(window)
        if window is not None:
            self._double.SetTexture(None)  # the actor's own
            self._double.ReleaseGraphicsResources(window)
        self._double, self._look_times = _vtk.vtkActor(), ()


def _hull(points, middle):
    """Return corners of a bounding polytope relative to a centre, and the radius."""
    offsets = points - middle
    squares = np.einsum('ni,ni->n', offsets, offsets)
    return dop_corners(offsets), float(np.sqrt(squares.max()))


def unlit(actor, number):
    """Make an actor draw colour and coverage, normal and material number."""
    prop, shader = actor.GetProperty(), actor.GetShaderProperty()
    is_lit = bool(prop.GetLighting())
    prop.SetInterpolation(min(prop.GetInterpolation(), 2))
    prop.SetOpacity(1.0)
    prop.SetAmbient(0.0)
    prop.SetDiffuse(1.0)
    prop.SetSpecular(0.0)
    shader.ClearFragmentShaderReplacement('//VTK::Normal::Dec', True)
    for tag, text in (('Light', _UNLIT if is_lit else _PLAIN), ('DepthPeeling', _OUTPUT)):
        name = f'//VTK::{tag}::Impl'
        shader.ClearFragmentShaderReplacement(name, True)
        shader.AddFragmentShaderReplacement(name, True, text, False)
    shader.GetFragmentCustomUniforms().SetUniformf('ibr_material', float(number))


def scale_strokes(prop, source_prop, scale):
    """Make edges, lines and points so many times as wide as those of another property."""
    prop.SetLineWidth(scale * source_prop.GetLineWidth())
    prop.SetEdgeWidth(scale * source_prop.GetEdgeWidth())
    prop.SetPointSize(scale * source_prop.GetPointSize())


def copied(mapper, data):
    """Return a copy of a mapper for other data."""
    copy = _vtk.vtkPolyDataMapper() if data.IsA('vtkPolyData') else _vtk.vtkDataSetMapper()
    copy.ShallowCopy(mapper)
    copy.SetInputDataObject(data)
    return copy


def check_members(things, impostor, *, are_new):
    """Raise an error unless an impostor replaces all things, or none of them if they are new."""
    replaced = {address(thing) for thing in impostor.things}
    for index, thing in enumerate(things):
        if (address(thing) in replaced) == are_new:
            must_be = (
                f'new, got one that {impostor.name} replaces: remove it'
                if are_new
                else f'one of the {len(replaced)} that {impostor.name} replaces'
            )
            raise ValueError(f'actors[{index}] must be {must_be}')


def checked_members(actors) -> list:
    """Return actors and instances as a checked list."""
    things = listed(actors)
    for thing in things:
        if not is_actor(thing) and type(thing) is not Instances:
            raise TypeError(
                'actors must be actors (from add_mesh) or Instances (from add_instances), '
                f'got {type(thing).__name__}'
            )
    if not things:
        raise ValueError('actors must have one or more, got none')
    known_ids: set = set()
    for index, thing in enumerate(things):
        if id(thing) in known_ids:
            raise ValueError(f'actors must not repeat, got actors[{index}] twice')
        known_ids.add(id(thing))
    return things


def is_actor(thing) -> bool:
    """Return True for a plain VTK actor, False for one of our things."""
    return isinstance(thing, _vtk.vtkActor) and not isinstance(thing, Thing)
