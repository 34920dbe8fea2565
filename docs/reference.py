"""Writes the pages of the API reference, from what the packages export."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

from pvibr.api.mesh_accessor import IBRAccessor
from pvibr.api.plotter_component import IBRComponent
from pvibr.core.params import params_of

FOLDER = Path(__file__).with_name('api')
#: Packages and what is said of them; each gets a table of all that it exports.
PACKAGES = {
    'pvibr': 'Things, effects, data and errors: `import pvibr`.',
    'pvibr.animation': 'Skeletons, clips, drivers and inverse kinematics, in numpy alone.',
    'pvibr.cluster': 'Movies and bakes on a Dask cluster: `import pvibr.cluster`.',
    'pvibr_widgets': 'Panels and handles: `import pvibr_widgets`.',
}
#: Found through PyVista.
ACCESSORS = {'plotter.ibr': IBRComponent, 'mesh.ibr': IBRAccessor}


def members(kind):
    """Return the names of the methods and properties of a class that users call."""
    ours = [base for base in kind.__mro__ if base.__module__.startswith('pvibr')]
    hooks = {n for base in ours if 'FOR_USERS' in vars(base) for n in vars(base)}
    hooks -= {n for base in ours for n in vars(base).get('FOR_USERS', ())}
    hooks |= params_of(kind).keys()  # which the docstring of the class lists
    found = {}
    for name, member in ((n, m) for base in ours for n, m in vars(base).items()):
        callable_ = inspect.isfunction(member) or isinstance(
            member, (property, staticmethod, classmethod)
        )
        if callable_ and not name.startswith('_') and name not in hooks | {'render'}:
            found.setdefault(name, member)
    return found


def page(title, module, name, thing):
    """Return the page of a name."""
    lines = [title, '=' * len(title), '', f'.. currentmodule:: {module}', '']
    if inspect.isclass(thing):
        lines += [f'.. autoclass:: {name}', '']
        for member, value in sorted(members(thing).items()):
            how = 'autoproperty' if isinstance(value, property) else 'automethod'
            lines += [f'   .. {how}:: {member}']
    elif callable(thing):
        lines += [f'.. autofunction:: {name}']
    else:
        lines += [f'.. autodata:: {name}']
    return '\n'.join(lines) + '\n'


def first_sentence(thing):
    """Return the summary line of a docstring."""
    return ' '.join((inspect.getdoc(thing) or '').split('\n\n')[0].split())


def exports(package):
    """Return the names that a package exports, but modules and dunders, and what they are."""
    module = importlib.import_module(package)
    names = sorted((n for n in module.__all__ if not n.startswith('__')), key=str.lower)
    found = {name: getattr(module, name) for name in names}
    return {name: thing for name, thing in found.items() if not inspect.ismodule(thing)}


def sections():
    """Yield a heading, what is said below it, and names, titles and things of its table."""
    through = [(title, title, kind) for title, kind in ACCESSORS.items()]
    yield 'Through PyVista', 'Found on every plotter and mesh.', through
    titles = {}  # what two packages export has one page
    for package, said in PACKAGES.items():
        found = exports(package).items()
        yield (
            package,
            said,
            [(n, titles.setdefault(id(t), f'{package}.{n}'), t) for n, t in found],
        )


def written():
    """Return the text of all pages, by file."""
    pages = {}
    index = ['# API reference', '', 'Everything that pvibr exports.']
    for heading, said, entries in sections():
        index += ['', f'## {heading}', '', said, '', '| name | |', '|---|---|']
        index += [f'| [`{n}`]({title}.rst) | {first_sentence(t)} |' for n, title, t in entries]
        new = {
            f'{title}.rst': (title, t) for _, title, t in entries if f'{title}.rst' not in pages
        }
        for file, (title, thing) in new.items():
            module, _, name = title.rpartition('.')
            if heading == 'Through PyVista':
                module, name = thing.__module__, thing.__name__
            pages[file] = page(title, module, name, thing)
        stems = (file.removesuffix('.rst') for file in new)
        index += ['', '```{toctree}', ':hidden:', '', *stems, '```']
    return {**pages, 'index.md': '\n'.join(index) + '\n'}


def build():
    """Write the pages that differ, which Sphinx reads again, and remove those of old names."""
    FOLDER.mkdir(exist_ok=True)
    pages = written()
    for old in FOLDER.iterdir():
        if old.name not in pages:
            old.unlink()
    for name, text in pages.items():
        path = FOLDER / name
        if not path.exists() or path.read_text(encoding='utf-8') != text:
            path.write_text(text, encoding='utf-8')
