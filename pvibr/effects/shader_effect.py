"""User-written effects: a GLSL function and a few settings."""

from __future__ import annotations

import re
from pathlib import Path

from pvibr.core.arguments import naming
from pvibr.core.effect import Effect
from pvibr.core.errors import ShaderError
from pvibr.core.params import Param, params_of
from pvibr.gl import Quad, nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.textures.projected import Shown

_TYPES = {bool: 'bool', int: 'int', float: 'float', str: 'int', tuple: 'vec'}
_RESERVED = ('uv', 'size', 'time', 'scale', 'nothing', 'effect')
_ELSEWHERE = 100000  # line numbers from here on are not the user's
_LINE = re.compile(r'^(?:ERROR:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:?\s*(.*)', re.IGNORECASE)
_SURFACES = re.compile(r'\b(normal_at|id_at)\b')
_DEPTHS = re.compile(r'\b(depth_at|ibr_depth)\b')
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/', re.DOTALL)
#: Settings that are not uniforms of the source.
_NOT_UNIFORMS = ('intensity', 'needs_hdr')


class ShaderEffect(Effect):
    """An effect from a GLSL function ``vec4 effect(vec2 uv)``; settings are uniforms.

    Start from the file `template`, a complete effect that documents the function's inputs with
    their spaces and units. Either write a class with `source` and :class:`pvibr.Param` settings,
    or pass source and values. The effect runs after outlines, on display colours; a class may set
    `before`.

    Parameters
    ----------
    source : str or path, optional
        GLSL source or its file; the class's own by default.
    images : dict, optional
        Samplers by name: paths, arrays, sequences, films or :class:`pvibr.LiveTexture`.
    **settings
        Values of the class's settings. If `source` is given, a value of another name defines a
        new setting.

    Attributes
    ----------
    source : str or path
        May be assigned at any time, for example to fix an error.
    before : str or None
        Effect of ``pvibr.effects.ORDER`` right before which this one runs, such as
        ``'ToneMapping'`` for light above 1, which also needs `needs_hdr`.
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

    intensity = Param(1.0, 'Opacity of the result over the picture.', range='[0, 1]')
    needs_hdr = Param(False, 'Read colours above 1: for effects on light, at more memory.')

    _quad: Quad | None = None
    _built_from: tuple = ()
    _source_text = ''

    def __init__(self, source=None, *, images=None, **settings):
        if source is not None:
            self.source = source
            self._declare(settings)
        self._images = _projected(images)
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
        """Declare a setting for each value whose name is not one yet."""
        declared_params = params_of(type(self))
        new_params = {
            n: Param(v, 'Uniform.') for n, v in settings.items() if n not in declared_params
        }
        if new_params:
            cls = type(self)
            self.__class__ = type(cls.__name__, (cls,), new_params | {'_class': cls})

    def _read(self):
        """Read the source, a file again each time."""
        source = self.source
        with naming('source', source):
            is_file = _is_file(source)
            self._source_text = (
                Path(source).read_text(encoding='utf-8') if is_file else str(source)
            )
        code = _COMMENT.sub(' ', self._source_text)
        self._reads_surfaces = bool(_SURFACES.search(code))
        self.reads_depth = self._reads_surfaces or bool(_DEPTHS.search(code))
        if not self._source_text.strip():
            raise ValueError(
                f'{self.name}.source must be GLSL with vec4 effect(vec2 uv), or its file, '
                f'got {source!r}'
            )

    @property
    def surfaces(self) -> bool:
        """Whether the source reads normals or ids."""
        return self._reads_surfaces

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if self._quad is None or self._built_from != (frame.window, self.source):
            self._read()
        for name, image in self._images.items():
            if image.missing:
                return f'{name}: {image.missing}'
        return super().needed(frame)

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
        uniform_values = {}
        for name, param in self._uniforms.items():
            value = getattr(self, name)
            if param.choices is not None and param.kind is str:
                value = param.choices.index(value)
            uniform_values[name] = int(value) if isinstance(value, bool) else value
        return uniform_values

    def _build(self, window) -> Quad:
        if self._quad is not None and self._built_from == (window, self.source):
            return self._quad
        self._forget()
        shader_sections = sections(shader_source(__file__))
        head_text = shader_sections['head'] + (shader_sections['surface'] if self.surfaces else '')
        declarations = [f'uniform {_type_of(p)} {n};' for n, p in self._uniforms.items()]
        declarations += [f'uniform sampler2D {name};' for name in self._images]
        declared_text = '\n'.join(declarations)
        full_source = (
            f'#line {_ELSEWHERE}\n{head_text}\n{declared_text}\n#line 0\n{self._source_text}\n'
            f'#line {_ELSEWHERE}\n{shader_sections["main"]}'
        )
        try:
            self._quad = Quad(window, full_source, self.name)
        except ShaderError as error:
            raise ShaderError(self._located(error), error.log) from None
        self._built_from = window, self.source
        return self._quad

    def _located(self, error) -> str:
        """Return the error's message with the line of the user's source."""
        source_name = str(self.source) if _is_file(self.source) else f'{self.name}.source'
        source_lines = self._source_text.splitlines()
        for message in error.log.splitlines():
            match = _LINE.match(message)
            if match and 0 < int(match[1]) <= len(source_lines):
                line_number = int(match[1])
                line = source_lines[line_number - 1].strip()
                return f'{source_name}, line {line_number}, {line!r}: {match[2]}'
        return f'{source_name}: {error}'

    def _forget(self):
        release(self._quad)
        self._quad, self._built_from = None, ()

    def release(self):
        """Free GPU memory; the context is current."""
        self._forget()
        release(*self._images.values())

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(*self._images.values())}


def _projected(images) -> dict:
    if images is None:
        return {}
    with naming('images', images):
        return {name: Shown(image) for name, image in images.items()}


def _is_file(source) -> bool:
    """Return True for a path; source text has a function, and so a brace."""
    return not isinstance(source, str) or bool(source and '{' not in source)


def _uniforms(owner) -> dict[str, Param]:
    return {n: p for n, p in params_of(owner).items() if n not in _NOT_UNIFORMS}


def _type_of(param) -> str:
    glsl_type = _TYPES[param.kind]
    return f'vec{len(param.default)}' if glsl_type == 'vec' else glsl_type


def _check_names(names, owner):
    for name in names:
        if name in _RESERVED or name.startswith(('ibr_', 'gl_')):
            raise ValueError(
                f'{owner}.{name} must not be a reserved name: see template.glsl, choose another'
            )


def _check_param(owner, name, param):
    bad_tuple = param.kind is tuple and (param.optional or not 2 <= len(param.default) <= 4)
    free_text = param.kind is str and param.choices is None
    if param.optional or bad_tuple or free_text:
        raise TypeError(
            f'{owner}.{name} must be a uniform: a bool, int, float, choice or tuple of 2 to 4 '
            f'floats, and not optional, got {param.default!r}'
        )
