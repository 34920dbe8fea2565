"""GLSL attached to an actor at VTK's named tags."""

from __future__ import annotations

import re

_SECTION = re.compile(r'^//@([\w.]+)\s*$', re.M)


def sections(text) -> dict[str, str]:
    r"""Split a shader file into its entry points.

    Parameters
    ----------
    text : str
        GLSL in which a line ``//@name`` starts an entry point; what precedes the first is
        commentary.

    Returns
    -------
    dict of str to str
        Name to text.

    Examples
    --------
    >>> from pvibr.gl.feature import sections
    >>> sections('about\n//@vertex.declare\nuniform int n;\n')
    {'vertex.declare': 'uniform int n;\n'}
    """
    names = _SECTION.findall(text)
    return dict(zip(names, (t.lstrip('\n') for t in _SECTION.split(text)[2::2]), strict=True))


class Feature:
    """Shader text for an actor, merged by tag and stage.

    Parameters
    ----------
    name : str
        Its mark in the generated source, a valid identifier.
    vertex, fragment : dict of str to str, optional
        Tag without slashes (``'VTK::Color::Impl'``) to text; text that does not hold the tag
        itself replaces VTK's own.
    """

    def __init__(self, name, vertex=None, fragment=None):
        self.name = name
        self.stages = {'Vertex': vertex or {}, 'Fragment': fragment or {}}

    @property
    def mark(self) -> str:
        """What :func:`landed` looks for."""
        return f'// pvibr:{self.name}\n'

    def attach(self, actor):
        """Put the text on an actor; every text carries the mark.

        Parameters
        ----------
        actor : vtkActor
            The actor; one feature for each tag of it.
        """
        shader = actor.GetShaderProperty()
        for stage, texts in self.stages.items():
            add = getattr(shader, f'Add{stage}ShaderReplacement')
            for tag, text in texts.items():
                add(f'//{tag}', True, self.mark + text, False)

    def landed(self, program) -> bool:
        """Return whether every text is in the source of a program.

        Parameters
        ----------
        program : vtkShaderProgram
            The program that drew the actor.
        """
        sources = {
            'Vertex': program.GetVertexShader().GetSource(),
            'Fragment': program.GetFragmentShader().GetSource(),
        }
        return all(sources[s].count(self.mark) == len(t) for s, t in self.stages.items())
