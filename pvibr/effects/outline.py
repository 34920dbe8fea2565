"""Outlines: lines on the picture where objects end, jump in depth, or have creases."""

from __future__ import annotations

import math
from typing import Any

from pvibr.buffers import Drawn
from pvibr.effect import Effect
from pvibr.gl import Quad, Target, shader_source
from pvibr.gl.feature import sections
from pvibr.params import Param


class Outline(Effect):
    """Lines where objects end, surfaces jump in depth, have creases, or luminance changes.

    Numbers, depth and normals are those of opaque surfaces, instances among them; translucent
    props and volumes have lines by luminance alone. A large screenshot is drawn in tiles, and
    lines do not cross their seams.

    Parameters
    ----------
    actors : actor, thing or list of them, optional
        What has lines; everything by default. Their hidden parts are told from what other opaque
        props are before them.
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        Where a setting is unknown or of the wrong type, or something is no actor.
    ValueError
        Where a value is out of range; where it is added, that an actor is of another subplot.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> chosen = pl.add_mesh(pv.Sphere())
    >>> _ = pl.add_mesh(pv.Cube().translate((0.5, 0, 0.5)))
    >>> outline = pl.ibr.add(pvibr.Outline(actors=[chosen], color=(1, 0.5, 0), width=3))
    >>> pl.show(auto_close=False)
    >>> pl.ibr.report().rows[0].state
    'ran'
    >>> pl.close()
    """

    width = Param(2.0, 'Of the lines, whatever the size of the window.', range='[0.5, 16]',
                  unit='px')  # fmt: skip
    color = Param((0.0, 0.0, 0.0), 'Of the lines, red, green, blue.', range='[0, 1]')
    opacity = Param(1.0, 'Of the lines; 0 draws none.', range='[0, 1]')
    ids = Param(True, 'Lines where one object ends and another begins.')
    depth = Param(True, 'Lines where a surface jumps in depth.')
    jump = Param(4.0, 'Least jump in depth, as deep as so many pixels are wide; more where the '
                 'surface is seen at a grazing angle.', range='(0, inf)', unit='px')  # fmt: skip
    normal = Param(True, 'Lines along creases.')
    crease = Param(30.0, 'Least angle between normals.', range='(0, 180]', unit='degrees')
    grazing = Param(80.0, 'Angle between normal and line of sight above which creases are left '
                    'out.', range='[0, 90]', unit='degrees')  # fmt: skip
    luminance = Param(False, 'Lines where luminance changes, of whatever there is in the picture.')
    contrast = Param(0.2, 'Least step of luminance, 0 to 1 from black to white.',
                     range='(0, inf)')  # fmt: skip
    hidden = Param('absent', 'What is drawn of chosen actors where others hide them.',
                   choices=('absent', 'dashed'))  # fmt: skip
    dash = Param(4.0, 'Length of a dash along an axis, and of a gap.', range='[1, 100]', unit='px')
    debug = Param('', 'Shows a stage: boundaries to the right red, above green, luminance blue.',
                  choices=('', 'edges'))  # fmt: skip

    def __init__(self, *, actors=None, **settings):
        self._actors = _checked(actors)
        self._drawn: Any = None
        self._target: Any = None
        self._coarse: Any = None
        self._quads: dict = {}
        super().__init__(**settings)

    @property
    def actors(self) -> list | None:
        """What has lines; None is everything."""
        return None if self._actors is None else list(self._actors)

    @actors.setter
    def actors(self, actors):
        chosen = _checked(actors)
        if self.pipeline is not None:
            _check_here(chosen, self.pipeline)
        self._actors = chosen

    def attach(self, pipeline):
        """Take a place in a pipeline.

        Parameters
        ----------
        pipeline : pvibr.pipeline.Pipeline
            Where it was added; it has the chosen actors.
        """
        _check_here(self._actors, pipeline)
        super().attach(pipeline)

    @property
    def _asks_surfaces(self) -> bool:
        return self.ids or self.depth or self.normal

    def needed(self, frame) -> bool | str:
        """Tell whether there are lines to draw.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame about to be drawn.
        """
        if not self.opacity:
            return 'opacity is 0'
        if self._actors == []:
            return 'no actors'
        return self._asks_surfaces or self.luminance or 'no kind of edge'

    def render(self, frame, picture):
        """Find edges and draw lines.

        Parameters
        ----------
        frame : pvibr.frame.Frame
            The frame that is drawn.
        picture : pvibr.gl.picture.Picture
            Its pixels.
        """
        edges = self._edges(frame, picture)
        squares = self._squares(frame.window, edges)
        with picture.drawing():
            if self.debug:
                quad = self._quad(frame.window, 'shown', _SHOWN)
                quad.draw(textures={'edges': edges})
                return
            reach = max(1, math.ceil(self.width / 2))
            lines = f'#define REACH {reach}\n{_SIDE}{_TEXTS["lines"]}'
            self._quad(frame.window, f'lines {reach}', lines).draw(
                {'width': self.width, 'dash': self.dash, 'ink': (*self.color, self.opacity)},
                {'edges': edges, 'squares': squares, 'color': picture.color},
            )

    def _edges(self, frame, picture):
        """Draw the edges and return their texture."""
        textures = {'color': picture.color, 'scene': picture.depth}
        textures |= {'surface': picture.color, 'depth': picture.depth}
        uniforms = self._uniforms(frame)
        if self._asks_surfaces:
            geometry = self._surfaces_of(frame, picture)
            textures |= {'surface': geometry.surface, 'depth': geometry.depth}
            uniforms['corner'] = geometry.origin
        self._target = target = _sized(self._target, frame.window, picture.size)
        with target.drawing():
            self._quad(frame.window, 'edges', _TEXTS['edges']).draw(uniforms, textures)
        return target.colors[0]

    def _squares(self, window, edges):
        """Draw which squares have edges and return their texture."""
        size = tuple(-(-n // _SQUARE) for n in edges.size)
        self._coarse = _sized(self._coarse, window, size)
        with self._coarse.drawing():
            quad = self._quad(window, 'tiles', f'{_SIDE}{_TEXTS["tiles"]}')
            quad.draw({'tiles': tuple(map(float, size))}, {'edges': edges})
        return self._coarse.colors[0]

    def _surfaces_of(self, frame, picture):
        if self._actors is None:
            return self.pipeline.buffers.geometry(frame, picture, self.pipeline.things)
        self._drawn = self._drawn or Drawn(frame.renderer)
        return self._drawn.draw(frame, self.pipeline.things, self._actors)

    @property
    def surfaces(self) -> bool:
        """Whether it reads what all surfaces write."""
        return self._asks_surfaces and self._actors is None

    def _uniforms(self, frame):
        size, clip = 1 / frame.pixel_scale, frame.clip_from_view
        lens = (0.0,) * 4 if frame.parallel else (
            1 / clip[0, 0], 1 / clip[1, 1], clip[0, 2], clip[1, 2]
        )  # fmt: skip
        return {
            'surfaces': int(self._asks_surfaces),
            'by_id': int(self.ids),
            'jump': self.jump if self.depth else 0.0,
            'crease': math.cos(math.radians(self.crease)) if self.normal else -2.0,
            'grazing': math.cos(math.radians(self.grazing)),
            'contrast': self.contrast if self.luminance else 0.0,
            'dashed': int(self.hidden == 'dashed'),
            'pixel': (size, 0.0, 1.0) if frame.parallel else (0.0, size, 0.0),
            'planes': (frame.near, frame.far),
            'lens': lens,
        }

    def _quad(self, window, name, text):
        if name not in self._quads:
            self._quads[name] = Quad(window, text, f'outline.glsl, {name}')
        return self._quads[name]

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        for owner in (self._drawn, self._target, self._coarse, *self._quads.values()):
            if owner is not None:
                owner.release()
        self._drawn = self._target = self._coarse = None
        self._quads = {}

    def report(self) -> dict:
        """Return the bytes that it holds on the GPU."""
        owners = self._drawn, self._target, self._coarse
        return {'bytes': sum(owner.nbytes for owner in owners if owner is not None)}


_SQUARE = 16  # pixels; as wide as the widest line, so that lines reach into two
_SIDE = f'#define SIDE {_SQUARE}\n'
_TEXTS = sections(shader_source(__file__))
_SHOWN = 'uniform sampler2D edges; void main() { gl_FragData[0] = texture(edges, uv); }'


def _sized(target, window, size) -> Target:
    """Return a target of a size: the given one where it has it."""
    if target is not None and (target.width, target.height) == tuple(size):
        return target
    if target is not None:
        target.release()
    return Target(window, size[0], size[1], filter='nearest')


def _checked(actors) -> list | None:
    if actors is None:
        return None
    chosen = list(actors) if isinstance(actors, (list, tuple, set)) else [actors]
    for item in chosen:
        if not (hasattr(item, 'drawn') or (hasattr(item, 'IsA') and item.IsA('vtkProp'))):
            msg = f'actors has {item!r:.80}: must be actors, as add_mesh returns, or None for all'
            raise TypeError(msg)
    return chosen


def _check_here(actors, pipeline):
    for item in actors or ():
        here = (
            item in pipeline.effects
            if hasattr(item, 'drawn')
            else pipeline.renderer.HasViewProp(item)
        )
        if not here:
            msg = f'actors has a {type(item).__name__} that is not in this subplot: add it first'
            raise ValueError(msg)
