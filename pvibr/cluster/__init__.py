"""Movies, bakes and scenes by many processes or machines: those of a Dask cluster."""

from __future__ import annotations

from pvibr import lazy_exports

_EXPORTS = {
    'Distributed': 'pvibr.cluster.distributed',
    'StoredViews': 'pvibr.cluster.stored_views',
    'ViewWriter': 'pvibr.cluster.view_database',
    'bake': 'pvibr.cluster.bakes',
    'movie': 'pvibr.cluster.movies',
    'views': 'pvibr.cluster.view_database',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)
