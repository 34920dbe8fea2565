"""Effects of a user's own: a GLSL function and a few settings."""

from __future__ import annotations

import re
from pathlib import Path

from pvibr.core.effect import Effect
from pvibr.core.errors import ShaderError
from pvibr.core.params import Param, params_of
from pvibr.gl import Quad, nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.images.projected import Shown
from pvibr.maths.arguments import naming

_TYPES = {bool: 'bool', int: 'int', float: 'float', str: 'int', tuple: 'vec'}
_RESERVED = ('uv', 'size', 'time', 'scale', 'nothing', 'effect')
_ELSEWHERE = 100000  # first line number of code that is not the user's
_LINE = re.compile(r'^(?:ERROR:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:?\s*(.*)', re.IGNORECASE)
_SURFACES = re.compile(r'\b(normal_at|id_at)\b')
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/', re.DOTALL)
#: Settings that are no uniforms of the source.
_OWN = ('intensity', 'needs_hdr')


class ShaderEffect(Effect):
    """An effect from a GLSL function ``vec4 effect(vec2 uv)``; settings are uniforms.

    The file `template` documents the inputs of the function with their spaces and units; it is
    a complete effect to start from. Either write a class with `source` and
    :class:`pvibr.Param` settings, or pass source and values. The effect runs after outlines, on
    display colours; a class may set `before`.

    Parameters
    ----------
    source : str or path, optional
        GLSL source or its file; the class's own by default.
    images : dict, optional
        Samplers: name to image (path, array, sequence, film or :class:`pvibr.LiveTexture`).
    **settings
        Values of the class's settings. If `source` is given, a value of another name defines a
        new setting.

    Attributes
    ----------
    source : str or path
        May be assigned at any time, such as to fix an error.
    before : str or None
        Effect of ``pvibr.effects.ORDER`` that it runs right before, such as ``'ToneMapping'``
        for light above 1, which also needs `needs_hdr`.
    template : pathlib.Path
        File that documents the inputs.

    Raises
    ------
    TypeError
        If a setting is unknown or cannot be a uniform.
    ValueError
        If a value is out of range, a name is reserved, or the source is empty.
    FileNotFoundError
        If the file does not exist.

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
    ...     amount = pvibr.Param(1.0, 'Amount of sepia.', range='[0, 1]')
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

    source: str | Path = ''
    template = Path(__file__).with_name('template.glsl')
    once = True
    neutral = 'intensity', 0

    intensity = Param(1.0, 'Opacity of the result.', range='[0, 1]')
    needs_hdr = Param(False, 'Use colours above 1.')

    _quad: Quad | None = None
    _built: tuple = ()
    _text = ''

    def __init__(self, source=None, *, images=None, **settings):
        if source is not None:
            self.source = source
            self._declare(settings)
        self._images = _shown(images)
        self._uniforms = _uniforms(type(self))
        _check_names([*self._uniforms, *self._images], self.name)
        for name, param in self._uniforms.items():
            _check_param(self.name, name, param)
        self._read()
        super().__init__(**settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance that inverts colours."""
        code = 'vec4 c = color_at(uv); return vec4(c.a - c.rgb, c.a);'
        return cls(f'vec4 effect(vec2 uv) {{ {code} }}')

    def _declare(self, settings):
        """Declare a setting for each value that the class has none for."""
        known = params_of(type(self))
        made = {n: Param(v, 'Uniform.') for n, v in settings.items() if n not in known}
        if made:
            cls = type(self)
            self.__class__ = type(cls.__name__, (cls,), made | {'_class': cls})

    def _read(self):
        """Read the source; a file is read anew each time."""
        source = self.source
        with naming('source', source):
            is_file = _is_file(source)
            self._text = Path(source).read_text(encoding='utf-8') if is_file else str(source)
        self._asks_surfaces = bool(_SURFACES.search(_COMMENT.sub(' ', self._text)))
        if not self._text.strip():
            raise ValueError(
                f'{self.name}.source is empty: give GLSL with vec4 effect(vec2 uv), or a file'
            )

    @property
    def surfaces(self) -> bool:
        """Whether the source reads normals or ids."""
        return self._asks_surfaces

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if self._quad is None or self._built != (frame.window, self.source):
            self._read()
        for name, image in self._images.items():
            if image.missing:
                return f'{name}: {image.missing}'
        return super().needed(frame)

    def render(self, frame, picture):
        """Draw the result of the function."""
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
        """Return the error with the line of the user's source."""
        path = str(self.source) if _is_file(self.source) else f'{self.name}.source'
        lines = self._text.splitlines()
        for message in error.log.splitlines():
            found = _LINE.match(message)
            if found and 0 < int(found[1]) <= len(lines):
                number = int(found[1])
                return f'{path}, line {number}, {lines[number - 1].strip()!r}: {found[2]}'
        return f'{path}: {error}'

    def _forget(self):
        release(self._quad)
        self._quad, self._built = None, ()

    def release(self):
        """Free GPU memory; the context is current."""
        self._forget()
        release(*self._images.values())

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(*self._images.values())}


def _shown(images) -> dict:
    if images is None:
        return {}
    with naming('images', images):
        return {name: Shown(image) for name, image in images.items()}


def _is_file(source) -> bool:
    """Return True for a path; source text has a function, hence a brace."""
    return not isinstance(source, str) or bool(source and '{' not in source)


def _uniforms(owner) -> dict[str, Param]:
    return {n: p for n, p in params_of(owner).items() if n not in _OWN}


def _type_of(param) -> str:
    kind = _TYPES[param.kind]
    return f'vec{len(param.default)}' if kind == 'vec' else kind


def _check_names(names, owner):
    for name in names:
        if name in _RESERVED or name.startswith(('ibr_', 'gl_')):
            raise ValueError(
                f'{owner}.{name}: the name is reserved, see template.glsl; choose another'
            )


def _check_param(owner, name, param):
    wide = param.kind is tuple and (param.optional or not 2 <= len(param.default) <= 4)
    loose = param.kind is str and param.choices is None
    if param.optional or wide or loose:
        raise TypeError(
            f'{owner}.{name}: cannot be a uniform; a setting of the source is a bool, int, float, '
            'choice, or tuple of 2 to 4 floats, and not optional'
        )
