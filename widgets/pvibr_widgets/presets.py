"""Named sets of settings: a few for each effect, and those that users keep in a file."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from pvibr.core import state_files
from pvibr.core.params import params_of

DEFAULTS = 'defaults'


class Presets:
    """Named sets of settings by class of effect.

    Parameters
    ----------
    path : str or os.PathLike, optional
        The file of those that users keep; by default ``presets.json`` in the folder that
        ``PVIBR_CONFIG`` names, else in the platform's own for settings.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pvibr
    >>> folder = tempfile.TemporaryDirectory()
    >>> presets = Presets(pathlib.Path(folder.name) / 'presets.json')
    >>> bloom = pvibr.Bloom(threshold=0.7)
    >>> presets.keep(bloom, 'mine')
    >>> presets.apply(bloom, 'strong')
    []
    >>> presets.apply(bloom, 'mine')
    []
    >>> bloom.threshold, presets.names(bloom)
    (0.7, ['defaults', 'subtle', 'strong', 'mine'])
    >>> folder.cleanup()
    """

    def __init__(self, path=None):
        self.path = _default_path() if path is None else Path(path)

    def names(self, thing) -> list[str]:
        """Return the names for a thing, its users' last.

        Parameters
        ----------
        thing : pvibr.Effect
            Whose class decides.

        Returns
        -------
        list of str
            ``'defaults'`` first.

        Raises
        ------
        OSError, ValueError
            Where there is a file, but it cannot be read.
        """
        kind = type(thing).__name__
        return [DEFAULTS, *(thing.presets | self._kept().get(kind, {}))]

    def apply(self, thing, name) -> list[str]:
        """Give a thing all settings of a set, its default to each that is not in it.

        Parameters
        ----------
        thing : pvibr.Effect
            What is changed.
        name : str
            One of `names`.

        Returns
        -------
        list of str
            Names of settings that the thing does not have, left out.

        Raises
        ------
        TypeError, ValueError
            Where there is no such set, or a value is not allowed; nothing is changed.
        """
        kind = type(thing).__name__
        sets = {DEFAULTS: {}} | thing.presets | self._kept().get(kind, {})
        if name not in sets:
            msg = f'{kind} has no preset {name!r}; it has: {", ".join(sets)}'
            raise ValueError(msg)
        defaults = {n: p.default for n, p in params_of(type(thing)).items()}
        return thing.restore(defaults | sets[name])

    def keep(self, thing, name):
        """Keep the settings of a thing under a name, for every thing of its class.

        Parameters
        ----------
        thing : pvibr.Effect
            Whose settings.
        name : str
            What they are called; a set that a user kept under that name is replaced.

        Raises
        ------
        ValueError
            Where the name is empty or that of a supplied set.
        OSError
            Where the file cannot be written; it is as it was.
        """
        kind, name = type(thing).__name__, name.strip()
        if not name or name == DEFAULTS or name in thing.presets:
            msg = f'name = {name!r}: must be a new one, of a letter at least'
            raise ValueError(msg)
        kept = self._kept()
        settings = {n: thing.state()[n] for n in params_of(type(thing))}
        kept.setdefault(kind, {})[name] = settings
        self._write(kept)

    def forget(self, thing, name):
        """Remove a set that a user kept.

        Parameters
        ----------
        thing : pvibr.Effect
            Whose class decides.
        name : str
            Which.

        Raises
        ------
        ValueError
            Where no user kept it.
        OSError
            Where the file cannot be written; it is as it was.
        """
        kept, kind = self._kept(), type(thing).__name__
        if name not in kept.get(kind, {}):
            msg = f'preset = {name!r}: must be one that you kept'
            raise ValueError(msg)
        del kept[kind][name]
        self._write(kept)

    def _kept(self) -> dict:
        if not self.path.exists():
            return {}
        values, _ = state_files.from_text('presets', state_files.read(self.path), str(self.path))
        sets = values.get('presets')
        if not isinstance(sets, dict) or not _is_nested(sets):
            msg = f'{self.path} is not a file of presets: mend or remove it'
            raise ValueError(msg)
        return sets

    def _write(self, kept):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        state_files.write(self.path, state_files.to_text('presets', {'presets': kept}))


def _is_nested(sets) -> bool:
    """Tell whether it is settings by name by class."""
    return all(
        isinstance(named, dict) and all(isinstance(s, dict) for s in named.values())
        for named in sets.values()
    )


def _default_path() -> Path:
    folder = os.environ.get('PVIBR_CONFIG')
    found = Path(folder) if folder else platformdirs.user_config_path('pvibr', appauthor=False)
    return found.expanduser() / 'presets.json'
