"""Scenes as they are sent to workers: functions that make plotters, checked at the call."""

from __future__ import annotations

import hashlib
import inspect
from contextlib import suppress

import pyvista as pv

from pvibr.capture.tiled_screenshot import check_samples
from pvibr.cluster.stages import Scene
from pvibr.core.determinism import is_deterministic


def scene_of(cluster, make_scene, args, kwargs, samples=1, name='make_scene') -> Scene:
    """Return the scene, checked, with a key that is the same in other processes."""
    if not callable(make_scene):
        # An open plotter, above all.
        raise TypeError(
            f'{name} must be a function that returns a plotter, got '
            f'{type(make_scene).__name__}: workers make their own'
        )
    check_samples(samples)
    args, kwargs = _arguments(args, kwargs)
    cluster.check_paths('args and kwargs', [*args, *kwargs.values()])
    remedy = f'pass numbers, arrays, paths or meshes, and make plotters and actors in {name}'
    digest = hashlib.blake2b(digest_size=20)
    for what, value in ((name, make_scene), ('args', args), ('kwargs', kwargs)):
        digest.update(cluster.sent(what, value, remedy))
    with suppress(OSError, TypeError):  # what is imported is sent by its name alone
        digest.update(inspect.getsource(make_scene).encode())
    theme, fixed = pv.global_theme.to_dict(), is_deterministic()
    theme.pop('trame', None)  # of notebooks, and not for others to set
    digest.update(repr((theme, samples, fixed)).encode())
    return Scene(digest.hexdigest(), make_scene, args, kwargs, theme, samples, fixed, name)


def _arguments(args, kwargs) -> tuple[tuple, dict]:
    if isinstance(args, str) or not isinstance(args, (tuple, list)):
        raise TypeError(f'args must be a tuple of arguments, got {args!r:.80}')
    if kwargs is not None and not isinstance(kwargs, dict):
        raise TypeError(f'kwargs must be a dict of arguments, got {kwargs!r:.80}')
    return tuple(args), dict(kwargs or {})
