"""Actors that draw instances as the mesh itself, one each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.core import _vtk
from pvibr.gl.feature import DITHER, Feature
from pvibr.instances.one_sided import OneSided
from pvibr.things.shader_draws import DULL, is_shiny

# An instance's colour replaces that of scalars and texture or multiplies it; cut-outs keep their
# holes. The lit colour is VTK's before it multiplies by the texture.
_LOOK = """  vec4 ibr_lit = gl_FragData[0];
//VTK::TCoord::Impl
  if (IBR_DITHER(ibr_dither) >= ibr_share) discard;
  if (gl_FragData[0].a < ibr_cutoff * ibr_alpha) discard;
  if (ibr_cutoff > 0.0) gl_FragData[0].a = ibr_lit.a;
  if (ibr_look.a > 0.504 && ibr_multiply == 0) gl_FragData[0].rgb = ibr_lit.rgb;
"""
_COLOR = """//VTK::Color::Impl
#define IBR_PLACE_ERROR ibr_place_error
  float ibr_alpha = ibr_look.a > 0.504 ? (ibr_look.a * 255.0 - 129.0) / 126.0 : 1.0;
  opacity *= ibr_alpha;
  if (ibr_look.a > 0.504)
  {
    vec3 base = ibr_look.rgb;
    if (ibr_multiply == 1) base *= diffuseColor / max(diffuseIntensity, 1e-6);
    diffuseColor = diffuseIntensity * base;
    ambientColor = ambientIntensity * base;
  }
"""
# VTK orients normals by the winding on the screen, which a mirrored pose reverses.
_TURNED = """#define normalMatrix (ibr_turn * normalMatrix)
//VTK::Normal::Impl
#undef normalMatrix
"""
_MIRROR = Feature('mirrored', {'VTK::Normal::Impl': _TURNED}, {'VTK::Normal::Impl': _TURNED})
_PLAIN = (0.0, 0.0, 0.0, 0.5)
#: Error of a position on a card, in radii: lights may see a mesh as a card.
PLACE_ERROR = 0.02


@dataclass
class MeshLevel:
    """The mesh or a lighter version of it."""

    parts: list
    error: float | None = None  # distance of its surface from the mesh's in radii, if known

    @property
    def triangles(self) -> int:
        """Triangles of all parts."""
        return sum(p.mesh.n_cells for p in self.parts)

    @cached_property
    def materials(self) -> list[OneSided]:
        """Materials of the parts, which may cull hidden sides."""
        return [OneSided(part) for part in self.parts]


class MeshPool:
    """Actors of one level, lent to instances."""

    #: Whether normals are flipped where a pose mirrors.
    turns_normals = True

    def __init__(self, level):
        self.level = level
        self.lent: dict = {}  # by instance
        self.free: list = []
        self.radius = max(p.mesh.length for p in level.parts) / 2
        self.multiply = self.translucent = False
        self.planes = None
        self._tint: tuple | None = None
        self._faded: set[int] = set()

    def lend(self, ids, matrix_of) -> list:
        """Place actors at instances and hide all others; return new actors."""
        requested = set(ids)
        for i in [i for i in self.lent if i not in requested]:
            actors = self.lent.pop(i)
            for actor in actors:
                actor.VisibilityOff()
            self.free.append(actors)
        new_actors = []
        for i in requested - self.lent.keys():
            if not self.free:
                self.free.append(self._new_actors())
                new_actors += self.free[-1]
            self.lent[i] = self.free.pop()
            self._place(self.lent[i], np.asarray(matrix_of(i), float))
        return new_actors

    def show(self, ids, matrix_of, look_of) -> list:
        """Place actors with looks at instances and hide all others; return new actors."""
        lent_before = set(self.lent)
        new_actors = self.lend(ids, matrix_of)
        for i in self.lent.keys() - lent_before:
            for actor in self.lent[i]:
                self._set_look(actor, look_of(i))
        return new_actors

    def actors(self) -> list:
        """Return all actors so far, lent ones first in the order of instances."""
        lent = [self.lent[i] for i in sorted(self.lent)]
        return [a for group in [*lent, *self.free] for a in group]

    def _new_actors(self) -> list:
        actors = [lendable(p, self._mapper(p)) for p in self.level.parts]
        for actor in actors if self.translucent else ():
            actor.ForceTranslucentOn()
        return actors

    def _mapper(self, part):
        mapper = part.actor.GetMapper()
        if self.planes is None:
            return mapper
        clipped = part.polydata_mapper()
        clipped.SetInputDataObject(mapper.GetInput())
        clipped.SetClippingPlanes(self.planes)
        return clipped

    def fade(self, shares, dither):
        """Draw a share of the pixels of fading instances; cards draw the rest."""
        for i in self._faded | shares.keys():
            for actor in self.lent.get(i, ()):
                uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
                uniforms.SetUniformf('ibr_share', shares.get(i, 1.0))
                uniforms.SetUniformf('ibr_dither', dither)
        self._faded = set(shares)

    def show_sides(self, outside):
        """Cull the hidden sides of instances that the eye is outside of."""
        if not self.lent:
            return  # it takes a while to find whether a surface is closed
        materials = [
            [m.material(culled) for m in self.level.materials] for culled in (False, True)
        ]
        for i, actors in self.lent.items():
            for actor, prop in zip(actors, materials[i in outside], strict=True):
                if actor.GetProperty() is not prop:
                    actor.SetProperty(prop)

    def tint(self, color, look_of):
        """Paint all instances in one colour, or none."""
        self._tint = color
        self.recolor(look_of)

    def recolor(self, look_of):
        """Update the looks of the lent actors."""
        for i, actors in self.lent.items():
            for actor in actors:
                self._set_look(actor, look_of(i))

    def _place(self, actors, matrix):
        values = matrix.ravel().tolist()
        determinant = float(np.linalg.det(matrix[:3, :3]))
        for actor in actors:
            actor.GetUserMatrix().DeepCopy(values)
            actor.VisibilityOn()
            shader = actor.GetShaderProperty()
            uniforms = shader.GetFragmentCustomUniforms()
            uniforms.SetUniformf('ibr_share', 1.0)
            uniforms.SetUniformf(
                'ibr_place_error', PLACE_ERROR * self.radius * abs(determinant) ** (1 / 3)
            )
            for stage in (shader.GetVertexCustomUniforms(), uniforms):
                stage.SetUniformf(
                    'ibr_turn', -1.0 if self.turns_normals and determinant < 0 else 1.0
                )

    def _set_look(self, actor, look):
        uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform4f('ibr_look', (*self._tint, 1.0) if self._tint else look)
        uniforms.SetUniformi('ibr_multiply', int(self.multiply and not self._tint))


def lendable(part, mapper):
    """Return a new actor that draws a part at instances, with looks of their own."""
    actor = with_looks(part, mapper)
    actor.SetUserMatrix(_vtk.vtkMatrix4x4())
    actor.PickableOff()  # the set's item meshes are picked
    actor.UseBoundsOff()
    _MIRROR.attach(actor)
    shader_property = actor.GetShaderProperty()
    shader_property.GetVertexCustomUniforms().SetUniformf('ibr_turn', 1.0)
    uniforms = shader_property.GetFragmentCustomUniforms()
    uniforms.SetUniformf('ibr_turn', 1.0)
    uniforms.SetUniformf('ibr_cutoff', cutoff(part))
    uniforms.SetUniform4f('ibr_look', _PLAIN)
    uniforms.SetUniformf('ibr_share', 1.0)
    uniforms.SetUniformf('ibr_dither', 0.0)
    uniforms.SetUniformf('ibr_place_error', 0.0)
    uniforms.SetUniformi('ibr_multiply', 0)
    return actor


def with_looks(part, mapper):
    """Return a new actor of a part, with shader code for looks of instances."""
    actor = part.new_actor(mapper)
    shader = actor.GetShaderProperty()
    shader_text = {'//VTK::TCoord::Impl': DITHER + _LOOK, '//VTK::Color::Impl': _COLOR}
    if not is_shiny(actor.GetProperty()):
        shader_text['//VTK::Light::Impl'] = '//VTK::Light::Impl\n'.join(DULL)
    for tag, text in shader_text.items():
        shader.ClearFragmentShaderReplacement(tag, True)
        shader.AddFragmentShaderReplacement(tag, True, text, False)
    return actor


def cutoff(part) -> float:
    """Return the alpha below which a part is cut out, scaled by its opacity."""
    if not part.alpha_cutoff:
        return 0.0
    return part.alpha_cutoff * part.actor.GetProperty().GetOpacity()
