"""Named sets of settings: those of the classes, and those that users save in a file."""

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
        File of user presets; by default ``presets.json`` in the folder ``PVIBR_CONFIG``, or in
        the platform's folder for settings.

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
        """Return the names of presets of an effect, user presets last.

        Parameters
        ----------
        thing : pvibr.Effect
            Effect; its class matters.

        Returns
        -------
        list of str
            ``'defaults'`` first.

        Raises
        ------
        OSError, ValueError
            If the file exists but cannot be read.
        """
        kind = type(thing).__name__
        return [DEFAULTS, *(thing.presets | self._kept().get(kind, {}))]

    def apply(self, thing, name) -> list[str]:
        """Apply a preset; settings that it leaves out get their defaults.

        Parameters
        ----------
        thing : pvibr.Effect
            Effect to change.
        name : str
            One of :meth:`names`.

        Returns
        -------
        list of str
            Names of settings that the effect does not have; they are ignored.

        Raises
        ------
        TypeError, ValueError
            If the preset does not exist, or a value is invalid; nothing is changed.
        """
        kind = type(thing).__name__
        sets = {DEFAULTS: {}} | thing.presets | self._kept().get(kind, {})
        if name not in sets:
            raise ValueError(f'{kind} has no preset {name!r}; it has: {", ".join(sets)}')
        defaults = {n: p.default for n, p in params_of(type(thing)).items()}
        return thing.restore(defaults | sets[name])

    def keep(self, thing, name):
        """Save the settings of an effect as a preset of its class.

        Parameters
        ----------
        thing : pvibr.Effect
            Effect with the settings.
        name : str
            Name of the preset; a user preset of that name is replaced.

        Raises
        ------
        ValueError
            If the name is empty or that of a built-in preset.
        OSError
            If the file cannot be written; it is unchanged.
        """
        kind, name = type(thing).__name__, name.strip()
        if not name or name == DEFAULTS or name in thing.presets:
            raise ValueError(f'name = {name!r}: must be a new one, of a letter at least')
        kept = self._kept()
        settings = {n: thing.state()[n] for n in params_of(type(thing))}
        kept.setdefault(kind, {})[name] = settings
        self._write(kept)

    def forget(self, thing, name):
        """Delete a user preset.

        Parameters
        ----------
        thing : pvibr.Effect
            Effect; its class matters.
        name : str
            Name of the preset.

        Raises
        ------
        ValueError
            If there is no such user preset.
        OSError
            If the file cannot be written; it is unchanged.
        """
        kept, kind = self._kept(), type(thing).__name__
        if name not in kept.get(kind, {}):
            raise ValueError(f'preset = {name!r}: must be one that you kept')
        del kept[kind][name]
        self._write(kept)

    def _kept(self) -> dict:
        if not self.path.exists():
            return {}
        values, _ = state_files.from_text('presets', state_files.read(self.path), str(self.path))
        sets = values.get('presets')
        if not isinstance(sets, dict) or not _is_nested(sets):
            raise ValueError(f'{self.path} is not a file of presets: fix or remove it')
        return sets

    def _write(self, kept):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        state_files.write(self.path, state_files.to_text('presets', {'presets': kept}))


def _is_nested(sets) -> bool:
    """Return True for a mapping of class to preset to settings."""
    return all(
        isinstance(named, dict) and all(isinstance(s, dict) for s in named.values())
        for named in sets.values()
    )


def _default_path() -> Path:
    folder = os.environ.get('PVIBR_CONFIG')
    found = Path(folder) if folder else platformdirs.user_config_path('pvibr', appauthor=False)
    return found.expanduser() / 'presets.json'
