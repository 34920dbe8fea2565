"""Pointwise programs fused into one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from pvibr.gl.enums import SCISSOR_TEST
from pvibr.gl.quad import Quad
from pvibr.gl.texture import filtered, release

_COMMENT = re.compile(r'//[^\n]*')
_COLOR = re.compile(r'^\s*uniform\s+sampler2D\s+color\s*;', re.M)
_UNIFORM = re.compile(r'^\s*uniform\s+\w+\s+(\w+)\s*;', re.M)
_CONSTANT = re.compile(r'^\s*const\s+\w+\s+(\w+)\s*=', re.M)
_FUNCTION = re.compile(r'^(?:void|bool|u?int|float|[biu]?vec[234]|mat[234])\s+(\w+)\s*\(', re.M)
_MAX_TEXTURES = 8  # per program; drivers support at least 16
_MAX_PROGRAMS = 16  # in the cache
_STEP = """  ibr_found = vec4(0.0);
  main_{k}();
"""
_COVER = """  ibr_color = vec4(ibr_found.rgb, ibr_found.a + ibr_color.a * (1.0 - ibr_found.a));
"""
# Blending of a program's output with the picture, as in gl/quad.py.
_STEPS = {
    '': _STEP + '  ibr_color = ibr_found;\n',
    # Full coverage hides whatever is below, even NaN.
    'over': f"""{_STEP}  ibr_found.rgb = ibr_found.a < 1.0
    ? mix(ibr_color.rgb, ibr_found.rgb, ibr_found.a) : ibr_found.rgb;
{_COVER}""",
    'add': f'{_STEP}  ibr_found.rgb += ibr_color.rgb;\n{_COVER}',
    'screen': f"""{_STEP}  ibr_found.rgb *= 1.0 - clamp(ibr_color.rgb, 0.0, 1.0);
  ibr_found.rgb += ibr_color.rgb;
{_COVER}""",
}


class Pointwise(NamedTuple):
    """A program whose output at a pixel depends on that pixel only."""

    name: str
    text: str
    uniforms: dict
    textures: dict
    blend: str = ''
    box: Sequence[int] | None = None


class Fused:
    """Draws pointwise programs in as few passes as possible."""

    def __init__(self, window):
        self.window = window
        self._programs: dict[object, Quad] = {}

    def draw(self, picture, points, to=None) -> bool:
        """Draw programs on a picture, in order; the last of them into `to`, if given.

        Return whether a pass was drawn, rather than everything blended with the picture in place.
        """
        batch: list[Pointwise] = []
        for point in points:
            if sum(len(p.textures) for p in [*batch, point]) > _MAX_TEXTURES and batch:
                self._draw(picture, batch)
                batch = []
            batch.append(point)
        return self._draw(picture, batch, to)

    def _draw(self, picture, points, to=None) -> bool:
        # Light is mostly local: drawing each in its box is cheaper than all of them everywhere.
        one_by_one = len(points) == 1 or all(p.blend in ('add', 'screen') for p in points)
        points = list(points)
        while points and ((one_by_one and to is None) or _is_local(points[0], picture.size)):
            if not self._draw_in_place(picture, points[0]):
                break
            points.pop(0)
        if not points:
            return False
        uniforms: dict[str, object] = {}
        color = picture.color
        textures = {'color': color}
        for k, point in enumerate(points):
            uniforms |= {f'{name}_{k}': value for name, value in point.uniforms.items()}
            textures |= {f'{name}_{k}': texture for name, texture in point.textures.items()}
        program_key = tuple((point.text, point.blend) for point in points)
        target = picture if to is None else to
        # Nearest filtering is a seventh faster than texelFetch on llvmpipe.
        with target.drawing(), filtered(color, 'nearest'):
            self._program(program_key, points).draw_alone(uniforms, textures)
        return True

    def _draw_in_place(self, picture, point) -> bool:
        """Blend with the picture in place; return False if that is impossible."""
        ground = picture.ground(point.blend) if point.blend else None
        if ground is None:
            return False
        quad = self._program(point.text, [point], point.text)
        with ground.drawing():
            if point.box is not None:
                _cut(picture, point.box)
            quad.draw_alone(point.uniforms, point.textures, point.blend)
        return True

    def _program(self, key, points, text='') -> Quad:
        if key not in self._programs:
            if len(self._programs) == _MAX_PROGRAMS:
                self._programs.pop(next(iter(self._programs))).release()
            program_names = ' + '.join(p.name for p in points)
            self._programs[key] = Quad(self.window, text or fuse(points), program_names)
        return self._programs[key]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._programs.values())
        self._programs = {}


def _cut(picture, box):
    """Clip to a box."""
    state = picture.window.GetState()
    state.SetEnumState(SCISSOR_TEST, True)
    state.vtkglScissor(*_within(box, picture.size))


def _within(box, size):
    """Return left, bottom, width and height of a box clipped to a picture."""
    left, bottom = (max(b, 0) for b in box[:2])
    right, top = (min(b, n) for b, n in zip(box[2:], size, strict=True))
    return left, bottom, max(right - left, 0), max(top - bottom, 0)


def _is_local(point, size) -> bool:
    """Return whether adding light within its box first is worth it."""
    if point.box is None or point.blend != 'add':
        return False
    width, height = _within(point.box, size)[2:]
    return width * height < size[0] * size[1] / 2


def fuse(points) -> str:
    """Return the source of one program equal to several in order."""
    renamed_texts, call_steps = [], []
    for k, point in enumerate(points):
        text = _COLOR.sub('', _COMMENT.sub('', point.text))
        text = text.replace('texture(color, uv)', 'ibr_color').replace('discard', 'return')
        text = text.replace('gl_FragData[0]', 'ibr_found')
        declarations = (kind.findall(text) for kind in (_UNIFORM, _CONSTANT, _FUNCTION))
        local_names = {'main'}.union(*declarations)
        renamed_texts.append(re.sub(rf'\b({"|".join(sorted(local_names))})\b', rf'\1_{k}', text))
        call_steps.append(_STEPS[point.blend].format(k=k))
    return (
        'uniform sampler2D color;\nvec4 ibr_color, ibr_found;\n'
        + '\n'.join(renamed_texts)
        + 'void main()\n{\n  ibr_color = textureLod(color, uv, 0.0);\n'
        + ''.join(call_steps)
        + '  gl_FragData[0] = ibr_color;\n}\n'
    )
