"""Outlines at object boundaries, depth discontinuities, creases and luminance edges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.arguments import checked_each
from pvibr.core.colors import Color
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, Texture, nbytes_of, release, shader_source
from pvibr.gl import enums as gl
from pvibr.gl.feature import sections
from pvibr.gl.scene_pass import like_window, volumes_of
from pvibr.gl.target import fitting_target
from pvibr.gl.tiles import SIDE, Tiles
from pvibr.things.buffers import Drawn
from pvibr.things.casters import is_prop
from pvibr.things.thing import Thing


class Outline(Effect):
    """Lines at boundaries of objects, depth discontinuities, creases or luminance edges.

    Ids, depth and normals are those of opaque surfaces, instances included; translucent props
    and volumes have luminance edges only. Volumes hide lines behind them as they hide surfaces,
    for which they are drawn a second time. Tiles of large screenshots cut lines at their seams.

    Parameters
    ----------
    actors : actor, thing or list of them, optional
        Actors to outline; all by default.
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        If a setting is unknown or has the wrong type, or an item of `actors` cannot be outlined.
    ValueError
        If a value is out of range; on adding, if an actor is in another subplot.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> chosen = pl.add_mesh(pv.Sphere())
    >>> _ = pl.add_mesh(pv.Cube().translate((0.5, 0, 0.5)))
    >>> outline = pl.ibr.add(pvibr.Outline([chosen], color=(1, 0.5, 0), width=3))
    >>> pl.show(auto_close=False)
    >>> pl.ibr.report().rows[0].state
    'ran'
    >>> pl.close()
    """

    once = True
    web = 'baked', 'lines: silhouettes from the current camera, and creases'
    neutral = 'opacity', 0
    covers = True
    presets = {
        'subtle': {'width': 1.0, 'opacity': 0.5, 'normal': False},
        'strong': {'width': 4.0, 'crease': 20.0},
    }
    width = Param(2.0, 'Line width.', range='[0.5, 16]', unit='px')
    color = Color((0.0, 0.0, 0.0), 'Line colour.')
    opacity = Param(1.0, 'Line opacity.', range='[0, 1]')
    ids = Param(True, 'Lines at boundaries between objects.')
    depth = Param(True, 'Lines at depth discontinuities.')
    jump = Param(4.0, 'Least depth discontinuity, in pixel sizes.', range='(0, inf)', unit='px')
    normal = Param(True, 'Lines along creases.')
    crease = Param(30.0, 'Least angle between normals.', range='(0, 180]', unit='degrees')
    grazing = Param(80.0, 'Largest viewing angle of creases.', range='[0, 90]', unit='degrees')
    luminance = Param(False, 'Lines at luminance edges, for textures and volumes.')
    contrast = Param(0.2, 'Least luminance step, as a fraction of white.', range='(0, inf)')
    hidden = Param(
        'absent', 'Style of the hidden lines of chosen actors.', choices=('absent', 'dashed')
    )
    dash = Param(
        4.0, 'Length of dashes, and of gaps, of hidden lines.', range='[1, 100]', unit='px'
    )
    debug = Param(
        '',
        'Intermediate stage to show: edges to the right (red), above (green), luminance (blue).',
        choices=('', 'edges'),
    )

    _surface_buffer: Drawn | None = None
    _veil: Veil | None = None
    _edge_target: Target | None = None
    _candidates: Target | None = None
    _mark_texture: tuple[bytes, Texture] | None = None

    def __init__(self, actors=None, **settings):
        self._actors = _checked(actors)
        self._tiles: Tiles | None = None
        self._quads: dict = {}
        super().__init__(**settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance in a vivid colour."""
        return cls(color=(1, 0, 1))

    @property
    def actors(self) -> list | None:
        """The actors that are outlined; None for all."""
        return None if self._actors is None else list(self._actors)

    @actors.setter
    def actors(self, actors):
        outlined_actors = _checked(actors)
        if self.pipeline is not None:
            _check_here(outlined_actors, self.pipeline)
        self._actors = outlined_actors

    def attach(self, pipeline):
        """Join a pipeline whose subplot has the actors."""
        _check_here(self._actors, pipeline)
        super().attach(pipeline)

    @property
    def _reads_surfaces(self) -> bool:
        return self.ids or self.depth or self.normal

    @property
    def surfaces(self) -> bool:
        """Whether it reads the surface buffer; dashed hidden lines draw chosen actors alone."""
        return self._reads_surfaces and (self._actors is None or self.hidden == 'absent')

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if self._actors == ():
            return 'no actors'
        if not (self._reads_surfaces or self.luminance):
            return 'no kind of edge'
        return super().needed(frame)

    def render(self, frame, picture):
        """Find edges and draw lines."""
        width = self.width * frame.scale
        line_reach = math.ceil(width / 2)
        tiles = self._tiles = self._tiles or Tiles(frame.window)
        edge_texture = self._find_edges(frame, picture, tiles, line_reach)
        if self.debug:
            with picture.drawing():
                self._quad(frame.window, 'debug').draw(textures={'edges': edge_texture})
            return
        line_uniforms = {
            'width': width,
            'dash': self.dash * frame.scale,
            'ink': self.ink,
        }
        self._veil = self._veil or Veil(frame.renderer)
        veil_texture = self._veil.draw(frame, picture) if self._reads_surfaces else None
        line_uniforms |= {
            'reach': line_reach,
            'veiled': int(veil_texture is not None),
            'corner': frame.origin,
        }
        textures = {
            'edges': edge_texture,
            'squares': tiles.squares,
            'veil': veil_texture or edge_texture,
        }
        with picture.drawing_over():
            tiles.draw(self._tiled_quad(tiles, 'lines'), line_uniforms, textures, 'over')

    def bake_into(self, scene):
        """Add the lines to a scene without pvibr."""
        if self._reads_surfaces:
            scene.lines(
                self._actors,
                color=self.color,
                width=self.width,
                opacity=self.opacity,
                crease=self.crease if self.normal else None,
            )

    def _find_edges(self, frame, picture, tiles, line_reach):
        """Find edges and the tiles that lines reach; return the texture of edges."""
        window, half_size = frame.window, [-(-n // 2) for n in picture.size]
        uniforms, textures = self._inputs(frame, picture)
        self._candidates = fitting_target(self._candidates, window, half_size)
        self._candidates.draw(self._quad(window, 'candidates'), uniforms, textures)
        edge_texture = self._candidates.colors[0]
        tiles.find(edge_texture, picture.size, line_reach)
        if not self._reads_surfaces:
            return edge_texture
        self._edge_target = fitting_target(self._edge_target, window, half_size)
        with self._edge_target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            textures['candidates'] = edge_texture
            tiles.draw(self._tiled_quad(tiles, 'edges'), uniforms, textures)
        return self._edge_target.colors[0]

    def _inputs(self, frame, picture):
        """Return uniforms and textures of the edge programs."""
        uniforms, textures = self.edge_uniforms(frame), {'color': picture.color}
        if self._reads_surfaces:
            geometry = self._geometry(frame, picture)
            uniforms['corner'] = geometry.origin
            textures |= {'surface': geometry.surface, 'depth': geometry.depth}
            textures['scene'] = textures['chosen'] = picture.depth
            if self.surfaces and self._actors is not None:
                textures['chosen'] = self._marks_by_number(frame.window, geometry.numbered)
        return uniforms, textures

    def _geometry(self, frame, picture):
        if self.surfaces:
            return self.pipeline.buffers.geometry(frame, picture, self.pipeline.things)
        self._surface_buffer = self._surface_buffer or Drawn(
            frame.renderer, self.pipeline.surfaces.plain_actors
        )
        return self._surface_buffer.draw(frame, self.pipeline.things, self._actors)

    def _marks_by_number(self, window, numbered_items):
        """Return a texture that marks the numbers of outlined actors."""
        outlined = {address(item) for item in self._actors or ()}
        mark_bytes = bytes([0, *(255 * (address(item) in outlined) for item in numbered_items)])
        if self._mark_texture is None or self._mark_texture[0] != mark_bytes:
            if self._mark_texture is not None:
                self._mark_texture[1].release()
            texels = np.zeros((-(-len(mark_bytes) // _ROW), _ROW), np.uint8)
            texels.ravel()[: len(mark_bytes)] = list(mark_bytes)
            self._mark_texture = mark_bytes, Texture(window).upload(texels)
        return self._mark_texture[1]

    @property
    def ink(self) -> tuple[float, ...]:
        """Colour and opacity of lines."""
        return *self.color, self.opacity

    def edge_uniforms(self, frame) -> dict:
        """Return the uniforms of the programs that find edges."""
        pixel_size, clip = 1 / frame.pixel_scale, frame.clip_from_view
        lens = (1 / clip[0, 0], 1 / clip[1, 1], clip[0, 2], clip[1, 2])
        return {
            'only_chosen': int(self.surfaces and self._actors is not None),
            'by_id': int(self.ids),
            'jump': self.jump if self.depth else 0.0,
            'crease': math.cos(math.radians(self.crease)) if self.normal else -2.0,
            'grazing': math.cos(math.radians(self.grazing)),
            'contrast': self.contrast,
            'dashed': int(self.hidden == 'dashed'),
            'pixel': (pixel_size, 0.0, 1.0) if frame.parallel else (0.0, pixel_size, 0.0),
            'planes': (frame.near, frame.far),
            'lens': (0.0,) * 4 if frame.parallel else lens,
        }

    def _quad(self, window, name):
        text = self.program_text(name)
        if text not in self._quads:
            self._quads[text] = Quad(window, text, _NAME + name)
        return self._quads[text]

    def _tiled_quad(self, tiles, name):
        if name not in self._quads:
            self._quads[name] = tiles.program(f'#define SIDE {SIDE}\n{_TEXTS[name]}', _NAME + name)
        return self._quads[name]

    def program_text(self, name) -> str:
        """Return the source of a program."""
        edge_kinds = {'SURFACES': self._reads_surfaces, 'LUMINANCE': self.luminance}
        return ''.join(f'#define {kind}\n' for kind, on in edge_kinds.items() if on) + _TEXTS[name]

    def release(self):
        """Free GPU memory; the context is current."""
        marks = self._mark_texture[1] if self._mark_texture else None
        release(*self._targets(), marks, *self._quads.values())
        self._surface_buffer = self._veil = self._candidates = self._edge_target = None
        self._tiles = self._mark_texture = None
        self._quads = {}

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(*self._targets())}

    def _targets(self):
        return self._surface_buffer, self._veil, self._candidates, self._edge_target, self._tiles


_NAME = 'outline.glsl, '
_ROW = 1024  # texels in a row of marks
_TEXTS = sections(shader_source(__file__))
for _program in ('candidates', 'edges'):
    _TEXTS[_program] = _TEXTS['surfaces'] + _TEXTS[_program]


def _checked(actors) -> tuple | None:
    if actors is None:
        return None
    return checked_each('actors', actors, is_prop, 'actors, as add_mesh returns, or None for all')


def _check_here(actors, pipeline):
    for item in actors or ():
        is_here = (
            item in pipeline.effects
            if isinstance(item, Thing)
            else pipeline.renderer.HasViewProp(item)
        )
        if not is_here:
            raise ValueError(
                f'actors must be in this subplot, got {type(item).__name__} from elsewhere: '
                'add it first'
            )


class Veil:
    """The opacity of the volumes in front of the surface in each pixel, drawn separately."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._target: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._target)

    def draw(self, frame, picture) -> Texture | None:
        """Return a window-sized texture with the opacity as alpha, or None without volumes."""
        volumes = volumes_of(self.renderer)
        if not volumes:
            return None
        window, (x, y), (width, height) = frame.window, frame.origin, frame.size
        subplot_rect = x, y, x + width, y + height
        if self._target is None or self._target.colors[0].size != subplot_rect[2:]:
            release(self._target)
            self._target = like_window(window, subplot_rect[2:], 'rgba8')
        target, state = self._target, window.GetState()
        with target.drawing((0.0, 0.0, 0.0, 0.0)):
            picture.blit_depth(target.object, subplot_rect)
            state.vtkglViewport(x, y, width, height)
            state.vtkglScissor(x, y, width, height)
            state.SetEnumState(gl.DEPTH_TEST, True)
            state.SetEnumState(gl.BLEND, True)
            for volume in volumes:
                volume.RenderVolumetricGeometry(self.renderer)
        return target.colors[0]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._target)
        self._target = None
