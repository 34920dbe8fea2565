"""GLSL attached to an actor at VTK's named tags."""

from __future__ import annotations

import re

from pvibr.core import _vtk
from pvibr.core._vtk import address

# Interleaved gradient noise: Jimenez, "Next Generation Post Processing in Call of Duty: Advanced
# Warfare", SIGGRAPH 2014, slide 123. The same picture every time, but for samples of a still one,
# which shift it by `Frame.vary`.
DITHER = (
    '#define IBR_DITHER(shift) fract(shift + 52.9829189 * fract(dot(gl_FragCoord.xy, '
    'vec2(0.06711056, 0.00583715))))\n'
)
# Stands in names that VTK may declare, and goes once it has: its passes look for such names in
# the text of a shader to see whether they are declared, as SSAO does.
MAYBE = '@'
_SECTION = re.compile(r'^//@([\w.]+)\s*$', re.M)


def sections(text) -> dict[str, str]:
    r"""Split a shader file into its entry points."""
    names = _SECTION.findall(text)
    return dict(zip(names, (t.lstrip('\n') for t in _SECTION.split(text)[2::2]), strict=True))


def declared_samplers(samplers) -> str:
    """Return the text that declares samplers, for the tag ``VTK::CustomUniforms::Dec``."""
    hidden = ''.join(f'#define {name} {name}_unit\n' for name in samplers)
    shown = ''.join(f'#undef {name}\nuniform {kind} {name};\n' for name, kind in samplers.items())
    return f'{hidden}//VTK::CustomUniforms::Dec\n{shown}'


class Feature:
    """Shader text for an actor by tag and stage; several features share an actor."""

    def __init__(self, name, vertex=None, fragment=None):
        self.name = name
        self.stages = {'Vertex': vertex or {}, 'Fragment': fragment or {}}

    @property
    def mark(self) -> str:
        """The comment that :func:`landed` looks for."""
        return f'// pvibr:{self.name}\n'

    def attach(self, actor):
        """Put the text on an actor; every text carries the mark."""
        for shader, stage, tag, text in self._texts(actor):
            present = replacements(shader).get((stage, tag), tag)
            if self.mark not in present:
                _replace(shader, stage, tag, present.replace(tag, self._marked(text), 1))
                _finish(shader, stage)

    def detach(self, actor):
        """Take the text off an actor; other features stay."""
        for shader, stage, tag, text in self._texts(actor):
            present = replacements(shader).get((stage, tag), '')
            before, _, after = self._marked(text).partition(tag)
            if before in present and after in present:
                _replace(shader, stage, tag, present.replace(before, '').replace(after, ''))
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
        """Return whether every text is in the source of a program."""
        sources = {
            'Vertex': program.GetVertexShader().GetSource(),
            'Fragment': program.GetFragmentShader().GetSource(),
        }
        return all(sources[s].count(self.mark) == len(t) for s, t in self.stages.items())


class FeatureSet:
    """Features on exactly the actors of the last match."""

    def __init__(self):
        self._attached: dict[str, tuple] = {}  # actor, its features, its version

    def __len__(self):
        return len(self._attached)

    def actors(self) -> list:
        """Return the actors that have features."""
        return [actor for actor, _, _ in self._attached.values()]

    def match(self, actors, features_of, version_of=None) -> list:
        """Do as :meth:`attach`, and detach from all other actors."""
        before, self._attached = self._attached, {}
        changed = self.attach(actors, features_of, version_of, before)
        for actor, features, _ in before.values():
            self._detach(actor, features)
        return changed

    def attach(self, actors, features_of, version_of=None, before=None) -> list:
        """Attach ``features_of(actor)`` to actors; return those whose version changed."""
        before = self._attached if before is None else before
        changed = []
        for actor in actors:
            key = address(actor)
            _, old, known = before.pop(key, (None, None, None))
            version = None if version_of is None else version_of(actor)
            new = old
            if old is None or version is None or version != known:
                new = tuple(features_of(actor))
                self._change(actor, old, new)
                changed.append(actor)
            self._attached[key] = actor, new, version
        return changed

    def _change(self, actor, old, new):
        if old != new:
            if old is not None:
                self._detach(actor, old)
            self._attach(actor, new)

    def _attach(self, actor, features):
        for feature in features:
            feature.attach(actor)

    def _detach(self, actor, features):
        for feature in features:
            feature.detach(actor)

    def leave_shared(self):
        """Detach from actors that other renderers draw, too."""
        for key, (actor, features, _) in [*self._attached.items()]:
            consumers = map(actor.GetConsumer, range(actor.GetNumberOfConsumers()))
            if sum(consumer.IsA('vtkRenderer') for consumer in consumers) > 1:
                del self._attached[key]
                self._detach(actor, features)

    def clear(self):
        """Detach from all."""
        self.match((), tuple)


def replacements(shader) -> dict:
    """Return the texts on a shader property that come before VTK's own."""
    found = {}
    tag, text = _vtk.reference(''), _vtk.reference('')
    first, every = _vtk.reference(False), _vtk.reference(False)
    for i in range(shader.GetNumberOfShaderReplacements()):
        shader.GetNthShaderReplacement(i, tag, first, text, every)
        if first.get():
            stage = shader.GetNthShaderReplacementTypeAsString(i)
            found[stage, tag.get()] = text.get()
    return found


def _replace(shader, stage, tag, text):
    getattr(shader, f'Clear{stage}ShaderReplacement')(tag, True)
    if text.strip() not in ('', tag):  # nothing is left of what replaced VTK's own
        getattr(shader, f'Add{stage}ShaderReplacement')(tag, True, text, False)


def _finish(shader, stage):
    """Take `MAYBE` out of what VTK has made of all texts, if it is in any."""
    texts = replacements(shader)
    getattr(shader, f'Clear{stage}ShaderReplacement')(MAYBE, False)
    if any(MAYBE in text for (at, _), text in texts.items() if at == stage):
        getattr(shader, f'Add{stage}ShaderReplacement')(MAYBE, False, '', True)
