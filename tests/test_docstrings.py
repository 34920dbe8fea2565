"""Docstrings: numpydoc in full for what users call, one sentence for all else."""

import ast
import inspect
import pydoc
import re
from pathlib import Path

import pytest
from numpydoc.validate import validate

import pvibr
import pvibr.animation
import pvibr.cluster
import pvibr_widgets
from pvibr.animation import Clip, Morphs, Rig, Skin, VertexAnimation
from pvibr.animation.model import Model
from pvibr.animation.rig import Step
from pvibr.api.add_methods import add_thing
from pvibr.api.mesh_accessor import IBRAccessor
from pvibr.api.plotter_component import IBRComponent
from pvibr.core.effect import Effect
from pvibr.figures.animated import animated
from pvibr.maths import cameras, facing

# GL08 is left out: it asks for docstrings of setters; ruff's 'D1' asks for all others. PR02 is
# left out: it takes dataclasses for classes without a constructor. RT01 too: one line is enough
# for a property. Ruff's 'D' checks the form.
CHECKS = {
    'GL06', 'GL07', 'SS02', 'SS03',
    'PR01', 'PR03', 'PR04', 'PR06', 'PR07', 'PR09', 'PR10', 'RT02', 'RT03', 'RT05', 'YD01',
}  # fmt: skip
#: Called by other modules of pvibr, not by users.
INTERNAL = {
    Clip.cycle,
    Clip.fits,
    Clip.local_time,
    Model.layers,
    Morphs.check,
    Morphs.has,
    Morphs.width,
    Rig.clamped_to_limit,
    Rig.limit,
    Skin.blend,
    Skin.matrices,
    Step.bound,
    VertexAnimation.blend,
    pvibr.AnimatedActor.download_posed,
    pvibr.animation.FigureMesh.mirrors,
}
#: Functions of ``pvibr.maths`` to which guides and docstrings send users.
FORMULAS = cameras.as_camera, facing.azimuths, facing.cards, facing.eye_of
#: Parts of what ``add_*`` say.
TEMPLATES = animated, add_thing
PACKAGES = Path(pvibr.__file__).parent, Path(pvibr_widgets.__file__).parent


def is_ours(thing):
    return getattr(thing, '__module__', '').split('.')[0] in ('pvibr', 'pvibr_widgets')


def exported():
    """What users name: the exports, the component, the accessor, and a few formulas."""
    for package in (pvibr, pvibr.animation, pvibr.cluster, pvibr_widgets):
        yield from (getattr(package, name) for name in package.__all__)
    yield from (IBRComponent, IBRAccessor, *FORMULAS)


def members(kind):
    """The public functions and properties of a class, each where it is first defined.

    What overrides them is documented there. Hooks are called by pvibr only.
    """
    ours = [base for base in kind.__mro__ if is_ours(base)]
    first = {name: vars(base)[name] for base in ours for name in vars(base)}
    declared = [base for base in ours if 'FOR_USERS' in vars(base)]
    hooks = {name for base in declared for name in {*vars(base)} - {*base.FOR_USERS}}
    hooks -= {name for base in declared for name in base.FOR_USERS}
    if issubclass(kind, Effect):
        hooks.add('render')  # its presence makes an effect one on pixels; Effect says how
    for name, member in first.items():
        for way in ('fget', 'func', '__func__'):
            member = getattr(member, way, member)
        user = inspect.isfunction(member) and not name.startswith('_') and name not in hooks
        if user and member not in INTERNAL:
            yield member
            yield from (f for f in anew(ours, name) if takes(f) - takes(member))


def anew(ours, name):
    """What classes define under a name."""
    found = [vars(base).get(name) for base in ours]
    return [f for f in found if inspect.isfunction(f)]


def takes(function):
    """Names of the parameters."""
    return set(inspect.signature(function).parameters)


def for_users():
    """All that users call, by module and qualified name."""
    found = {}
    for thing in (*exported(), *TEMPLATES):
        if inspect.ismodule(thing) or not callable(thing) or not is_ours(thing):
            continue
        parts = [thing]
        if inspect.isclass(thing):
            parts += [base for base in thing.__mro__ if is_ours(base) and base.__name__[0] != '_']
            parts += members(thing)
        for part in parts:
            if is_ours(part) and '<locals>' not in part.__qualname__:
                found[part.__module__, part.__qualname__] = part
    return found


USERS = for_users()


@pytest.mark.parametrize('name', sorted('.'.join(name) for name in USERS))
def test_what_users_call_is_documented(name):
    found = {f'{code}: {text}' for code, text in validate(name)['errors'] if code in CHECKS}
    text = inspect.getdoc(pydoc.locate(name))
    if 'Attributes\n----' in text or 'Parameters are those of :class:' in text:
        found = {error for error in found if not error.startswith('PR01')}
    assert not found, '\n'.join(found)


def documented(node, prefix=''):
    """Qualified names and docstrings of all that is defined in a module."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.ClassDef, ast.FunctionDef)):
            yield f'{prefix}{child.name}', ast.get_docstring(child)
            yield from documented(child, f'{prefix}{child.name}.')


def is_short(text):
    """Whether it is one sentence, and at most one line more, or the source that it follows."""
    summary, *more = text.split('\n\n')
    if len(more) > 1 or re.search(r'[a-z`)\]]\. [A-Z]', ' '.join(summary.split())):
        return False
    return all('\n' not in part or re.search(r'\b(19|20)\d\d\b', part) for part in more)


def test_all_else_is_one_sentence():
    """And at most one line more: of shapes or spaces, or the source; but what commands print."""
    long = []
    for folder in PACKAGES:
        for path in sorted(folder.rglob('*.py')):
            parts = path.relative_to(folder.parent).with_suffix('').parts
            module = '.'.join(parts).removesuffix('.__init__')
            for name, text in documented(ast.parse(path.read_text(encoding='utf-8'))):
                for_users = (module, name) in USERS or module == 'pvibr.cli.app'
                if text and not for_users and not is_short(text):
                    long.append(f'{module}.{name}')
    assert not long, '\n'.join(long)
