"""Instances as the mesh itself, an actor each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.core import _vtk
from pvibr.gl.feature import DITHER, Feature
from pvibr.instances.one_sided import OneSided
from pvibr.scene.shader_draws import DULL, PBR

# The colour of an instance replaces what scalars and texture give, or multiplies it; a cut-out
# keeps its holes. Lit colour is what VTK has before it multiplies by the texture.
_LOOK = """  vec4 ibr_lit = gl_FragData[0];
//VTK::TCoord::Impl
  if (IBR_DITHER(ibr_dither) >= ibr_share) discard;
  if (gl_FragData[0].a < ibr_cutoff * ibr_alpha) discard;
  if (ibr_cutoff > 0.0) gl_FragData[0].a = ibr_lit.a;
  if (ibr_look.a > 0.504 && ibr_multiply == 0) gl_FragData[0].rgb = ibr_lit.rgb;
"""
_COLOR = """//VTK::Color::Impl
#define IBR_BLUR ibr_blur
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
# VTK turns normals by the winding that it sees, which a mirrored pose turns around.
_TURNED = """#define normalMatrix (ibr_turn * normalMatrix)
//VTK::Normal::Impl
#undef normalMatrix
"""
_MIRROR = Feature('mirrored', {'VTK::Normal::Impl': _TURNED}, {'VTK::Normal::Impl': _TURNED})
_PLAIN = (0.0, 0.0, 0.0, 0.5)
#: How well a place on a card is known, in radii: lights may see a mesh as a card.
BLUR = 0.02


@dataclass
class MeshLevel:
    """The mesh, or a lighter stand-in."""

    parts: list
    error: float | None = None  # how far its surface is from the mesh's, in radii, if known

    @property
    def triangles(self) -> int:
        """Triangles of all parts."""
        return sum(p.mesh.n_cells for p in self.parts)

    @cached_property
    def materials(self) -> list[OneSided]:
        """Materials of the parts, with both sides or one."""
        return [OneSided(part) for part in self.parts]


class MeshPool:
    """Actors of one level, lent to instances, with the looks of these."""

    #: Whether normals turn where a pose mirrors.
    turns = True

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
        """Show the mesh at some instances and nowhere else; return new actors."""
        wanted = set(ids)
        for i in [i for i in self.lent if i not in wanted]:
            actors = self.lent.pop(i)
            for actor in actors:
                actor.VisibilityOff()
            self.free.append(actors)
        new = []
        for i in wanted - self.lent.keys():
            if not self.free:
                self.free.append(self._made())
                new += self.free[-1]
            self.lent[i] = self.free.pop()
            self._put(self.lent[i], np.asarray(matrix_of(i), float))
        return new

    def show(self, ids, matrix_of, look_of) -> list:
        """Show the mesh at some instances and nowhere else; return new actors."""
        before = set(self.lent)
        new = self.lend(ids, matrix_of)
        for i in self.lent.keys() - before:
            for actor in self.lent[i]:
                self._set_look(actor, look_of(i))
        return new

    def actors(self) -> list:
        """Return every actor made so far, those that are lent by instance."""
        lent = [self.lent[i] for i in sorted(self.lent)]
        return [a for group in [*lent, *self.free] for a in group]

    def _made(self) -> list:
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
        """Draw a share of the pixels of some instances; cards draw the others."""
        for i in self._faded | shares.keys():
            for actor in self.lent.get(i, ()):
                uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
                uniforms.SetUniformf('ibr_share', shares.get(i, 1.0))
                uniforms.SetUniformf('ibr_dither', dither)
        self._faded = set(shares)

    def show_sides(self, outside):
        """Leave out the hidden side of instances that the eye is outside of."""
        if not self.lent:
            return  # whether a surface is closed takes a while to find
        kinds = [[m.material(seen) for m in self.level.materials] for seen in (False, True)]
        for i, actors in self.lent.items():
            for actor, prop in zip(actors, kinds[i in outside], strict=True):
                if actor.GetProperty() is not prop:
                    actor.SetProperty(prop)

    def tint(self, color, look_of):
        """Set one colour for all instances, over their looks."""
        self._tint = color
        self.recolor(look_of)

    def recolor(self, look_of):
        """Update the looks of the shown instances."""
        for i, actors in self.lent.items():
            for actor in actors:
                self._set_look(actor, look_of(i))

    def _put(self, actors, matrix):
        values = matrix.ravel().tolist()
        volume = float(np.linalg.det(matrix[:3, :3]))
        for actor in actors:
            actor.GetUserMatrix().DeepCopy(values)
            actor.VisibilityOn()
            shader = actor.GetShaderProperty()
            uniforms = shader.GetFragmentCustomUniforms()
            uniforms.SetUniformf('ibr_share', 1.0)
            uniforms.SetUniformf('ibr_blur', BLUR * self.radius * abs(volume) ** (1 / 3))
            for stage in (shader.GetVertexCustomUniforms(), uniforms):
                stage.SetUniformf('ibr_turn', -1.0 if self.turns and volume < 0 else 1.0)

    def _set_look(self, actor, look):
        uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform4f('ibr_look', (*self._tint, 1.0) if self._tint else look)
        uniforms.SetUniformi('ibr_multiply', int(self.multiply and not self._tint))


def lendable(part, mapper):
    """Return a new actor that draws a part at instances, with per-instance looks."""
    actor = with_looks(part, mapper)
    actor.SetUserMatrix(_vtk.vtkMatrix4x4())
    actor.PickableOff()  # what stands for the instance is picked
    actor.UseBoundsOff()
    _MIRROR.attach(actor)
    shader = actor.GetShaderProperty()
    shader.GetVertexCustomUniforms().SetUniformf('ibr_turn', 1.0)
    uniforms = shader.GetFragmentCustomUniforms()
    uniforms.SetUniformf('ibr_turn', 1.0)
    uniforms.SetUniformf('ibr_cutoff', cutoff(part))
    uniforms.SetUniform4f('ibr_look', _PLAIN)
    uniforms.SetUniformf('ibr_share', 1.0)
    uniforms.SetUniformf('ibr_dither', 0.0)
    uniforms.SetUniformf('ibr_blur', 0.0)
    uniforms.SetUniformi('ibr_multiply', 0)
    return actor


def with_looks(part, mapper):
    """Return a new actor that draws a part, with shader text for looks of instances."""
    actor = part.new_actor(mapper)
    shader = actor.GetShaderProperty()
    texts = {'//VTK::TCoord::Impl': DITHER + _LOOK, '//VTK::Color::Impl': _COLOR}
    prop = actor.GetProperty()
    if prop.GetSpecular() == 0 and prop.GetInterpolation() != PBR:
        texts['//VTK::Light::Impl'] = '//VTK::Light::Impl\n'.join(DULL)
    for tag, text in texts.items():
        shader.ClearFragmentShaderReplacement(tag, True)
        shader.AddFragmentShaderReplacement(tag, True, text, False)
    return actor


def cutoff(part) -> float:
    """Return the alpha below which a part is cut out, its opacity included."""
    return (part.alpha_cutoff or 0.0) * part.actor.GetProperty().GetOpacity()
