"""Draws a movie of forty slow frames on a cluster of its own; killed by a test."""

import sys
import time

import pyvista as pv
from distributed import Client

import pvibr.cluster


def make():
    """Return a plotter whose frames take a while."""
    pl = pv.Plotter(off_screen=True, window_size=(60, 40))
    pl.add_mesh(pv.Cone())
    take = pl.ibr.screenshot

    def slowly(**options):
        time.sleep(0.1)
        return take(**options)

    pl.ibr.screenshot = slowly
    return pl


if __name__ == '__main__':
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=':0') as client:
        times = [float(k) for k in range(40)]
        pvibr.cluster.movie(make, times, sys.argv[1], client=client)
