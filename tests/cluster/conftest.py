"""A cluster of two worker processes on this machine."""

import pytest

distributed = pytest.importorskip('distributed', reason='needs distributed')


@pytest.fixture(scope='module')
def client(tmp_path_factory):
    """The client of two processes, each with a limit of memory."""
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            memory_limit='2GiB',
            dashboard_address=':0',
            local_directory=str(tmp_path_factory.mktemp('dask')),
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client
