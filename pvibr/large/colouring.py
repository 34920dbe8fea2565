"""How a large mesh is coloured: the look of ``add_mesh``, and values of its vertices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.large.original_cells import VISIBLE
from pvibr.large.scalars import Scalars, opacities_of, scalars_of
from pvibr.large.vertex_values import Values, vertex_values
from pvibr.meshes.parts import Part, as_parts, copy_look

_TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
#: Arguments that choose scalars, which are no longer in the look of what shows them.
_CHOICES = 'component', 'preference'
#: Length of edges beside which they are drawn in full, relative to that from which they are seen.
_FULL = 1.8
_EDGE_SHADER = {
    '//VTK::Edges::Dec': '//VTK::CustomUniforms::Dec\n//VTK::Edges::Dec',
    # Lengths as if they were seen from the front, relative to the viewport's height: they are
    # alike in neighbours. What is added to the distance from an edge makes its line thinner.
    'pos[3] = pos[0];': """pos[3] = pos[0];
  vec3 places[3];
  for (int i = 0; i < 3; i++)
  {
    vec4 place = gl_in[i].gl_Position;
    vec2 from_center = (pos[i] - vpDims.xy) / vpDims.w - 0.5 * vpDims.zw / vpDims.w;
    places[i] = vec3(from_center * place.w, 0.5 * dot(ibr_depths, place.wz));
  }
  float size = (distance(places[0], places[1]) + distance(places[1], places[2])
    + distance(places[2], places[0]))
    / (gl_in[0].gl_Position.w + gl_in[1].gl_Position.w + gl_in[2].gl_Position.w);
  vec2 sizes = ibr_edge_sizes;
  float hidden = clamp((sizes.y - size) / (sizes.y - sizes.x), 0.0, 1.0);
  float thinner = hidden * (0.5 * lineWidth + 1.0);""",
    'vec4(tmp.x, tmp.y, 0.0, -d)': 'vec4(tmp.x, tmp.y, 0.0, thinner - d)',
    # What VTK draws beside a triangle, for lines on its border, is half dark at hidden edges.
    '.z = lineWidth;': '.z = 2.0 * lineWidth + 1.0;',
}


@dataclass(frozen=True)
class Coloring:
    """What a large mesh looks like."""

    #: An actor with the look; its mesh is one triangle.
    part: Part
    #: Scalars or colours of the user's mesh, None for one colour.
    scalars: Scalars | None = None

    @classmethod
    def of(cls, source, scalars, look) -> Coloring:
        """Return the colouring of a mesh by scalars, a name, an array or None."""
        found, opacity = scalars_of(source, scalars, look), look.get('opacity', 1.0)
        opacities = opacities_of(source, found, opacity)
        look = {name: value for name, value in look.items() if name not in _CHOICES}
        if np.ndim(opacity) or isinstance(opacity, str):
            look.pop('opacity')
        if found is None:
            look.pop('categories', None)
            return cls(as_parts(_triangle(), **look)[0])
        part = _part(found, look)
        if opacities is not None:
            found = found.blended(part.actor.mapper.lookup_table, opacities)
            part = _part(found, look)
        elif 'opacity' not in look and not found.are_colors:
            table = part.actor.mapper.lookup_table
            table.apply_opacity(pv.opacity_transfer_function(opacity, table.n_values))
        return cls(part, found)

    @property
    def title(self) -> str:
        """Title of the scalar bar."""
        return '' if self.scalars is None else self.scalars.title

    @property
    def has_texture(self) -> bool:
        """Whether an image is on it, by texture coordinates of its own."""
        actor = self.part.actor
        return actor.GetTexture() is not None or bool(actor.GetProperty().GetNumberOfTextures())

    @property
    def has_table(self) -> bool:
        """Whether scalars are looked up in a table of colours."""
        return self.scalars is not None and not self.scalars.are_colors

    @property
    def has_names(self) -> bool:
        """Whether the scalars are words."""
        return self.scalars is not None and bool(self.scalars.words)

    @property
    def is_of_cells(self) -> bool:
        """Whether each cell of the mesh has a value."""
        return self.scalars is not None and self.scalars.on_cells

    def values_of(self, hierarchy) -> Values | None:
        """Return the values of a hierarchy's vertices and triangles."""
        return None if self.scalars is None else vertex_values(hierarchy, self.scalars)

    def dress(self, actor):
        """Give an actor this look."""
        copy_look(actor, self.part.actor)
        shader = actor.GetShaderProperty()
        for old, new in _EDGE_SHADER.items():
            shader.AddGeometryShaderReplacement(old, old.startswith('//VTK'), new, True)


def fade_edges(actor, frame, error):
    """Let an actor draw the edges of triangles that are large in a frame, beside an error."""
    clip = frame.view.clip_from_view
    height = 2 * frame.pixel_scale / clip[1, 1]
    smallest = min(VISIBLE * error / height, 1e6)
    depths = (0.0, clip[1, 1] / clip[2, 2]) if frame.view.parallel else (clip[1, 1], 0.0)
    uniforms = actor.GetShaderProperty().GetGeometryCustomUniforms()
    uniforms.SetUniform2f('ibr_edge_sizes', (smallest, max(_FULL * smallest, 1e-9)))
    uniforms.SetUniform2f('ibr_depths', depths)


def _part(scalars, look) -> Part:
    """Return a triangle with the look of scalars."""
    triangle, values = _triangle(), scalars.values
    triangle.point_data[scalars.name] = values[[0, 0, 0]] if len(values) else np.zeros(3)
    return as_parts(triangle, scalars=scalars.name, **scalars.look(look))[0]


def _triangle() -> pv.PolyData:
    triangle = pv.PolyData.from_regular_faces(_TRIANGLE, np.array([[0, 1, 2]]))
    triangle.active_texture_coordinates = _TRIANGLE[:, :2].copy()
    return triangle
