"""GLSL attached to an actor at VTK's shader tags."""

from __future__ import annotations

import re

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl import refused_shaders

# Interleaved gradient noise: Jimenez, "Next Generation Post Processing in Call of Duty: Advanced
# Warfare", SIGGRAPH 2014, slide 123. Constant over time, but the samples of a still picture
# shift it by `Frame.vary`.
DITHER = (
    '#define IBR_DITHER(shift) fract(shift + 52.9829189 * fract(dot(gl_FragCoord.xy, '
    'vec2(0.06711056, 0.00583715))))\n'
)
# Placed in names that VTK may declare, and removed after its own replacements: passes such as SSAO
# search the shader for a name to see whether it is declared.
MAYBE = '@'
_MOVED = re.compile(r'\bgl_Position\b[.\w]*\s*[-+*/]?=(?!=)|#define vertexMC\b')
_SECTION = re.compile(r'^//@([\w.]+)\s*$', re.M)


def sections(text) -> dict[str, str]:
    """Split a shader file into its entry points."""
    names = _SECTION.findall(text)
    return dict(zip(names, (t.lstrip('\n') for t in _SECTION.split(text)[2::2]), strict=True))


def declared_samplers(samplers) -> str:
    """Return the declaration of samplers for the tag ``VTK::CustomUniforms::Dec``."""
    defines = ''.join(f'#define {name} {name}_unit\n' for name in samplers)
    uniforms = ''.join(
        f'#undef {name}\nuniform {kind} {name};\n' for name, kind in samplers.items()
    )
    return f'{defines}//VTK::CustomUniforms::Dec\n{uniforms}'


class Feature:
    """Shader text for an actor, by stage and tag; an actor may have several features."""

    def __init__(self, name, vertex=None, fragment=None, geometry=None):
        self.name = name
        self.stages = {'Vertex': vertex or {}, 'Fragment': fragment or {}}
        # VTK ignores it except for edges and tubes, the only props with a geometry shader.
        self.stages |= {'Geometry': geometry} if geometry else {}

    @property
    def mark(self) -> str:
        """The comment that :meth:`landed` searches for."""
        return f'// pvibr:{self.name}\n'

    def attach(self, actor):
        """Add the text to an actor, marked in each place."""
        refused_shaders.watch()
        for shader, stage, tag, text in self._texts(actor):
            current_text = replacements(shader).get((stage, tag), tag)
            if self.mark not in current_text:
                _replace(shader, stage, tag, current_text.replace(tag, self._marked(text), 1))
                _finish(shader, stage)

    def detach(self, actor):
        """Remove the text from an actor; other features stay."""
        for shader, stage, tag, text in self._texts(actor):
            current_text = replacements(shader).get((stage, tag), '')
            text_before, _, text_after = self._marked(text).partition(tag)
            if text_before in current_text and text_after in current_text:
                current_text = current_text.replace(text_before, '').replace(text_after, '')
                _replace(shader, stage, tag, current_text)
                _finish(shader, stage)

    def _texts(self, actor):
        shader = actor.GetShaderProperty()
        for stage, texts in self.stages.items():
            for tag, text in texts.items():
                yield shader, stage, f'//{tag}', text

    def _marked(self, text):
        end = '' if text.endswith('\n') else '\n'
        return f'{self.mark}{text}{end}// end of pvibr:{self.name}\n'

    def landed(self, program) -> bool:
        """Return whether all text is in the source of a program."""
        stage_sources = {
            'Vertex': program.GetVertexShader().GetSource(),
            'Fragment': program.GetFragmentShader().GetSource(),
        }
        return all(
            source.count(self.mark) == len(self.stages[stage])
            for stage, source in stage_sources.items()
        )


class FeatureSet:
    """Features on exactly the actors of the last match."""

    def __init__(self):
        self._attached: dict[str, tuple] = {}  # actor, its features, its version

    def __len__(self):
        return len(self._attached)

    def actors(self) -> list:
        """Return the actors that have features."""
        return [actor for actor, _, _ in self._attached.values()]

    def has(self, name) -> bool:
        """Return whether a feature of this name is on any actor."""
        entries = self._attached.values()
        return any(f.name == name for _, features, _ in entries for f in features)

    def of(self, actor) -> tuple:
        """Return the features of an actor that has some."""
        return self._attached[address(actor)][1]

    def match(self, actors, features_of, version_of=None) -> list:
        """Like :meth:`attach`, and detach from all other actors."""
        old_entries, self._attached = self._attached, {}
        changed_actors = self.attach(actors, features_of, version_of, old_entries)
        for actor, features, _ in old_entries.values():
            self._detach(actor, features)
        return changed_actors

    def attach(self, actors, features_of, version_of=None, old_entries=None) -> list:
        """Attach ``features_of(actor)`` to actors; return those whose version changed."""
        old_entries = self._attached if old_entries is None else old_entries
        changed_actors = []
        for actor in actors:
            key = address(actor)
            _, old_features, old_version = old_entries.pop(key, (None, None, None))
            version = None if version_of is None else version_of(actor)
            features = old_features
            if old_features is None or version is None or version != old_version:
                features = tuple(features_of(actor))
                self._change(actor, old_features, features)
                changed_actors.append(actor)
            self._attached[key] = actor, features, version
        return changed_actors

    def _change(self, actor, old_features, features):
        if old_features != features:
            if old_features is not None:
                self._detach(actor, old_features)
            self._attach(actor, features)

    def _attach(self, actor, features):
        for feature in features:
            feature.attach(actor)
        _notify(actor)

    def _detach(self, actor, features):
        for feature in features:
            feature.detach(actor)
        _notify(actor)

    def leave_shared(self, prop_of=lambda actor: actor):
        """Detach from actors whose prop other renderers also draw."""
        for key, (actor, features, _) in [*self._attached.items()]:
            prop = prop_of(actor)
            consumers = map(prop.GetConsumer, range(prop.GetNumberOfConsumers()))
            if sum(consumer.IsA('vtkRenderer') for consumer in consumers) > 1:
                del self._attached[key]
                self._detach(actor, features)

    def clear(self):
        """Detach from all actors."""
        self.match((), tuple)


def has_text(actor, name) -> bool:
    """Return whether an actor has the text of a feature."""
    texts = replacements(actor.GetShaderProperty()).values()
    return any(Feature(name).mark in text for text in texts)


def replacements(shader) -> dict:
    """Return a shader property's texts that come before VTK's own, by stage and tag."""
    texts = {}
    tag, text = _vtk.reference(''), _vtk.reference('')
    is_first, replaces_all = _vtk.reference(False), _vtk.reference(False)
    for i in range(shader.GetNumberOfShaderReplacements()):
        shader.GetNthShaderReplacement(i, tag, is_first, text, replaces_all)
        if is_first.get():
            texts[shader.GetNthShaderReplacementTypeAsString(i), tag.get()] = text.get()
    return texts


def moves_vertices(shader) -> bool:
    """Return whether a shader property's own code or a replacement may move vertices."""
    return shader.HasVertexShaderCode() or any(
        stage != 'Fragment' and (tag not in text or _MOVED.search(text))
        for (stage, tag), text in replacements(shader).items()
    )


def _notify(actor):
    """Let the one mapper that ignores the time of shader text build its programs again."""
    mapper = actor.GetMapper()
    if mapper is not None and mapper.IsA('vtkPointGaussianMapper'):
        actor.Modified()


def _replace(shader, stage, tag, text):
    getattr(shader, f'Clear{stage}ShaderReplacement')(tag, True)
    if text.strip() not in ('', tag):  # unless only VTK's own tag is left
        getattr(shader, f'Add{stage}ShaderReplacement')(tag, True, text, False)


def _finish(shader, stage):
    """Remove `MAYBE` from VTK's final text, if any text contains it."""
    texts = replacements(shader)
    getattr(shader, f'Clear{stage}ShaderReplacement')(MAYBE, False)
    if any(MAYBE in text for (text_stage, _), text in texts.items() if text_stage == stage):
        getattr(shader, f'Add{stage}ShaderReplacement')(MAYBE, False, '', True)
