"""Instances near enough to be drawn as the mesh itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.core import _vtk
from pvibr.gl.feature import DITHER, Feature
from pvibr.scene.shader_draws import DULL, PBR

# The colour of an instance replaces what scalars and texture give, or multiplies it; a cut-out
# keeps its holes. Lit colour is what VTK has before it multiplies by the texture.
_LOOK = """  vec4 ibr_lit = gl_FragData[0];
//VTK::TCoord::Impl
  if (IBR_DITHER >= ibr_share) discard;
  if (gl_FragData[0].a < ibr_cutoff) discard;
  if (ibr_cutoff > 0.0) gl_FragData[0].a = ibr_lit.a;
  if (ibr_look.a > 0.75 && ibr_multiply == 0) gl_FragData[0].rgb = ibr_lit.rgb;
"""
_COLOR = """//VTK::Color::Impl
#define IBR_BLUR ibr_blur
  if (ibr_look.a > 0.75)
  {
    vec3 base = ibr_look.rgb;
    if (ibr_multiply == 1) base *= diffuseColor / max(diffuseIntensity, 1e-6);
    diffuseColor = diffuseIntensity * base;
    ambientColor = ambientIntensity * base;
  }
"""
# VTK turns normals by the winding that it sees, which a mirrored pose turns around.
_MIRROR = Feature(
    'mirrored',
    fragment={
        'VTK::Normal::Impl': """//VTK::Normal::Impl
  if (ibr_mirrored == 1) normalVCVSOutput = -normalVCVSOutput;
"""
    },
)
_PLAIN = (0.0, 0.0, 0.0, 0.5)
#: How well a place on a card is known, in radii: lights may see a mesh as a card.
BLUR = 0.02


@dataclass
class MeshLevel:
    """The mesh, or a lighter stand-in, with its error."""

    parts: list
    error: float = 0.0

    @property
    def triangles(self) -> int:
        """Triangles of all parts."""
        return sum(p.mesh.n_cells for p in self.parts)


class MeshPool:
    """Actors of one level, lent to the instances that need them."""

    def __init__(self, level):
        self.level = level
        self.radius = max(p.mesh.length for p in level.parts) / 2
        self.lent: dict = {}  # by instance
        self.free: list = []
        self.multiply = False
        self._tint: tuple | None = None
        self._faded: set[int] = set()
        self._lit = True

    def light(self, lit):
        """Switch the flip of mirrored normals, which VTK lacks without lights."""
        if lit == self._lit:
            return
        self._lit = lit
        # All or none: they share a mapper, which looks at one of them for changes of its shader.
        for actor in (a for actors in (*self.lent.values(), *self.free) for a in actors):
            _turn_normals(actor, lit)

    def show(self, ids, matrix_of, look_of):
        """Show the mesh at some instances and nowhere else."""
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
                for actor in () if self._lit else self.free[-1]:
                    _turn_normals(actor, False)
                new += self.free[-1]
            self.lent[i] = self.free.pop()
            self._put(self.lent[i], matrix_of(i), look_of(i))
        return new

    def _made(self) -> list:
        """Return new actors that show one instance."""
        return [lendable(p, p.actor.GetMapper()) for p in self.level.parts]

    def fade(self, shares):
        """Draw a share of the pixels of some instances; cards draw the others."""
        for i in self._faded | shares.keys():
            for actor in self.lent.get(i, ()):
                uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
                uniforms.SetUniformf('ibr_share', shares.get(i, 1.0))
        self._faded = set(shares)

    def tint(self, color, look_of):
        """Set one colour for all instances, over their looks."""
        self._tint = color
        self.recolor(look_of)

    def recolor(self, look_of):
        """Update the looks of the shown instances."""
        for i, actors in self.lent.items():
            for actor in actors:
                self._set_look(actor, look_of(i))

    def instance_of(self, actor):
        """Return the instance that an actor shows, or None."""
        return next((i for i, actors in self.lent.items() if actor in actors), None)

    def _put(self, actors, matrix, look):
        values = np.asarray(matrix, float).ravel().tolist()
        volume = float(np.linalg.det(np.asarray(matrix, float)[:3, :3]))
        for actor in actors:
            actor.GetUserMatrix().DeepCopy(values)
            actor.VisibilityOn()
            uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
            uniforms.SetUniformf('ibr_share', 1.0)
            uniforms.SetUniformi('ibr_mirrored', int(volume < 0))
            uniforms.SetUniformf('ibr_blur', BLUR * self.radius * abs(volume) ** (1 / 3))
            self._set_look(actor, look)

    def _set_look(self, actor, look):
        uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
        uniforms.SetUniform4f('ibr_look', (*self._tint, 1.0) if self._tint else look)
        uniforms.SetUniformi('ibr_multiply', int(self.multiply and not self._tint))

    def actors(self):
        """Return every actor made so far."""
        return [a for group in [*self.lent.values(), *self.free] for a in group]


def lendable(part, mapper):
    """Return a new actor that draws a part at instances, with per-instance looks."""
    actor = part.new_actor(mapper)
    actor.SetUserMatrix(_vtk.vtkMatrix4x4())
    shader = actor.GetShaderProperty()
    texts = {'//VTK::TCoord::Impl': DITHER + _LOOK, '//VTK::Color::Impl': _COLOR}
    prop = actor.GetProperty()
    if prop.GetSpecular() == 0 and prop.GetInterpolation() != PBR:
        texts['//VTK::Light::Impl'] = '//VTK::Light::Impl\n'.join(DULL)
    for tag, text in texts.items():
        shader.ClearFragmentShaderReplacement(tag, True)
        shader.AddFragmentShaderReplacement(tag, True, text, False)
    _turn_normals(actor, True)
    uniforms = shader.GetFragmentCustomUniforms()
    uniforms.SetUniformf('ibr_cutoff', (part.alpha_cutoff or 0.0) * prop.GetOpacity())
    uniforms.SetUniform4f('ibr_look', _PLAIN)
    uniforms.SetUniformf('ibr_share', 1.0)
    uniforms.SetUniformi('ibr_mirrored', 0)
    uniforms.SetUniformf('ibr_blur', 0.0)
    uniforms.SetUniformi('ibr_multiply', 0)
    return actor


def _turn_normals(actor, there):
    """Flip the normals of mirrored poses, if there are any."""
    if there and actor.GetProperty().GetLighting() and _has_normals(actor):
        _MIRROR.attach(actor)
    else:
        _MIRROR.detach(actor)


def _has_normals(actor):
    """Return True if VTK lights all that it draws of an actor by normals of its points."""
    data, prop = actor.GetMapper().GetInput(), actor.GetProperty()
    if prop.GetRepresentation() == 0 or prop.GetVertexVisibility():  # VTK_POINTS
        return False
    others = data.GetNumberOfVerts() + data.GetNumberOfLines()
    return data.GetPointData().GetNormals() is not None and not others
