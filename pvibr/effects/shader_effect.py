"""Effects of a user's own: a function in GLSL and a few settings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pvibr.core.effect import Effect
from pvibr.core.errors import ShaderError
from pvibr.core.params import Param, params_of
from pvibr.gl import Quad, shader_source
from pvibr.gl.feature import sections
from pvibr.images.projected import Shown

_TYPES = {bool: 'bool', int: 'int', float: 'float', str: 'int', tuple: 'vec'}
_RESERVED = ('uv', 'size', 'time', 'scale', 'nothing', 'effect')
_ELSEWHERE = 100000  # the number of the first line that is not the user's
_LINE = re.compile(r'^(?:ERROR:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:?\s*(.*)', re.IGNORECASE)
_SURFACES = re.compile(r'\b(normal_at|id_at)\b')
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/', re.DOTALL)
#: Settings that are the effect's own and no uniforms of the text.
_OWN = ('intensity', 'needs_hdr')


class ShaderEffect(Effect):
    """An effect of your own: `source` has ``vec4 effect(vec2 uv)`` in GLSL, settings are uniforms.

    What the function may use, in which spaces and units, is written in the file that `template`
    names; it is an effect itself, to begin from. Either write a class, with `source` and
    :class:`pvibr.Param` settings, or give text and values at once. It runs after outlines, on
    the colours that a display shows; a class may say what it runs before.

    Parameters
    ----------
    source : str or path, optional
        GLSL text, or a file of it; by default the class's own.
    images : dict, optional
        Name to image (path, array, sequence, film or :class:`pvibr.LiveTexture`): samplers.
    **settings
        Values of the class's settings. Where `source` is given and the class has no setting of
        that name, the value makes one.

    Attributes
    ----------
    source : str or path
        It may be set again, to mend it or while you work on it.
    before : str or None
        What it runs right before, of ``pvibr.effects.ORDER``: for light above 1, which needs
        `needs_hdr` too, ``'ToneMapping'``.
    template : pathlib.Path
        The file that says what the text is given.

    Raises
    ------
    TypeError
        Where a setting is unknown, or cannot be a uniform.
    ValueError
        Where a value is out of range, a name is taken, or there is no source.
    FileNotFoundError
        Where there is no such file.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> class Sepia(pvibr.ShaderEffect):
    ...     source = '''vec4 effect(vec2 uv) {
    ...       vec4 c = color_at(uv);
    ...       float gray = dot(c.rgb, vec3(0.2126, 0.7152, 0.0722));
    ...       return vec4(mix(c.rgb, gray * vec3(1.0, 0.85, 0.65), amount), c.a);
    ...     }'''
    ...     amount = pvibr.Param(1.0, 'How old it looks.', range='[0, 1]')
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='teal')
    >>> sepia = pl.ibr.add(Sepia(amount=0.8))
    >>> text = 'vec4 effect(vec2 uv) { return color_at(uv) * vec4(vec3(dim), 1.0); }'
    >>> dim = pl.ibr.add(pvibr.ShaderEffect(text, dim=0.5))
    >>> pl.show(auto_close=False)
    >>> pl.ibr.report().rows[1].state
    'ran'
    >>> dim.dim = 0.7
    >>> pl.close()
    """

    source: Any = ''
    template = Path(__file__).with_name('template.glsl')

    intensity = Param(1.0, 'Share of what it shows in the picture.', range='[0, 1]')
    needs_hdr = Param(False, 'See colours above 1, which multisampling does not go with.')

    _quad: Quad | None = None
    _built: tuple = ()
    _text = ''

    def __init__(self, source=None, *, images=None, **settings):
        if source is not None:
            self.source = source
            self._declare(settings)
        self._images = {name: Shown(image) for name, image in (images or {}).items()}
        self._uniforms = _uniforms(type(self))
        _check_names([*self._uniforms, *self._images], self.name)
        for name, param in self._uniforms.items():
            _check_param(self.name, name, param)
        self._read()
        super().__init__(**settings)

    def _declare(self, settings):
        """Make a setting of each value that the class has none for."""
        known = params_of(type(self))
        made = {n: Param(v, 'As given.') for n, v in settings.items() if n not in known}
        if made:
            self.__class__ = type(type(self).__name__, (type(self),), made)

    def _read(self):
        """Take the text; of a file it is read again each time."""
        source = self.source
        if _is_file(source):
            self._text = Path(source).read_text(encoding='utf-8')
        else:
            self._text = str(source)
        #: Whether the text names what is drawn for that alone.
        self._asks_surfaces = bool(_SURFACES.search(_COMMENT.sub(' ', self._text)))
        if not self._text.strip():
            msg = f'{self.name}.source is empty: give GLSL with vec4 effect(vec2 uv), or a file'
            raise ValueError(msg)

    @property
    def surfaces(self) -> bool:
        """Whether the shader reads normals or ids."""
        return self._asks_surfaces

    def needed(self, frame) -> bool | str:
        """Tell whether the picture changes."""
        if self._quad is None or self._built != (frame.window, self.source):
            self._read()
        for name, image in self._images.items():
            if image.missing:
                return f'{name}: {image.missing}'
        return self.intensity > 0 or 'intensity is 0'

    def render(self, frame, picture):
        """Draw what the function returns."""
        quad = self._build(frame.window)
        textures = {'ibr_color': picture.color, 'ibr_depth': picture.depth}
        textures |= {n: i.texture(frame.window, frame.time) for n, i in self._images.items()}
        uniforms = {
            'ibr_tile': frame.tile,
            'ibr_planes': (frame.near, frame.far, float(frame.parallel)),
            'ibr_intensity': self.intensity,
            'size': frame.whole,
            'time': frame.time,
            'scale': float(frame.scale),
        }
        if self.surfaces:
            geometry = self.pipeline.buffers.geometry(frame, picture, self.pipeline.things)
            textures['ibr_surface'] = geometry.surface
            uniforms['ibr_corner'] = [float(x) for x in geometry.origin]
        with picture.drawing():
            quad.draw(uniforms | self._values(), textures)

    def _values(self) -> dict:
        """Return the settings as uniforms."""
        values = {}
        for name, param in self._uniforms.items():
            value = getattr(self, name)
            if param.choices is not None and param.kind is str:
                value = param.choices.index(value)
            values[name] = int(value) if isinstance(value, bool) else value
        return values

    def _build(self, window) -> Quad:
        if self._quad is not None and self._built == (window, self.source):
            return self._quad
        self._forget()
        entries = sections(shader_source(__file__))
        head = entries['head'] + (entries['surface'] if self.surfaces else '')
        declared = [f'uniform {_type_of(p)} {n};' for n, p in self._uniforms.items()]
        declared += [f'uniform sampler2D {name};' for name in self._images]
        own = '\n'.join(declared)
        code = (
            f'#line {_ELSEWHERE}\n{head}\n{own}\n#line 0\n{self._text}\n'
            f'#line {_ELSEWHERE}\n{entries["main"]}'
        )
        try:
            self._quad = Quad(window, code, self.name)
        except ShaderError as error:
            raise ShaderError(self._explained(error), error.log) from None
        self._built = window, self.source
        return self._quad

    def _explained(self, error) -> str:
        """Return what is wrong, at the lines of the user's text."""
        path = str(self.source) if _is_file(self.source) else f'{self.name}.source'
        lines = self._text.splitlines()
        for message in error.log.splitlines():
            found = _LINE.match(message)
            if found and 0 < int(found[1]) <= len(lines):
                number = int(found[1])
                return f'{path}, line {number}, {lines[number - 1].strip()!r}: {found[2]}'
        return f'{path}: {error}'

    def _forget(self):
        if self._quad is not None:
            self._quad.release()
        self._quad, self._built = None, ()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self._forget()
        for image in self._images.values():
            image.release()

    def report(self) -> dict:
        """Return the bytes on the GPU."""
        return {'bytes': sum(image.nbytes for image in self._images.values())}


def _is_file(source) -> bool:
    """Tell a path from a text: that has a function, hence a brace."""
    return not isinstance(source, str) or bool(source and '{' not in source)


def _uniforms(owner) -> dict[str, Param]:
    return {n: p for n, p in params_of(owner).items() if n not in _OWN}


def _type_of(param) -> str:
    kind = _TYPES[param.kind]
    return f'vec{len(param.default)}' if kind == 'vec' else kind


def _check_names(names, owner):
    for name in names:
        if name in _RESERVED or name.startswith(('ibr_', 'gl_')):
            msg = f'{owner}.{name}: the name is taken, see template.glsl; call it otherwise'
            raise ValueError(msg)


def _check_param(owner, name, param):
    wide = param.kind is tuple and (param.optional or not 2 <= len(param.default) <= 4)
    loose = param.kind is str and param.choices is None
    if param.optional or wide or loose:
        msg = (
            f'{owner}.{name}: no uniform can be made of it; a setting of the text is a bool, int, '
            'float, choice, or tuple of 2 to 4 floats, and not optional'
        )
        raise TypeError(msg)
