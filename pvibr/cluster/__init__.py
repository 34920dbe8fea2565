"""Movies, bakes and scenes by many processes or machines: those of a Dask cluster."""

from __future__ import annotations

from pvibr import lazy_exports

_EXPORTS = {
    'Distributed': 'pvibr.cluster.distributed',
    'bake': 'pvibr.cluster.bakes',
    'movie': 'pvibr.cluster.movies',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)
