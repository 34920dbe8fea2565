"""A scene that workers make, and what may happen to it."""


def ball():
    """Return a function that makes the scene; as a value, it needs no import on the workers."""

    def make(notes, dies_at=None, fails_at=None):
        import os
        import signal
        from pathlib import Path

        import numpy as np
        import pyvista as pv

        import pvibr

        notes = Path(notes)
        (notes / f'made {os.getpid()}').touch()
        pl = pv.Plotter(off_screen=True, window_size=(120, 90))
        ball = pl.add_mesh(pv.Sphere(), color='tan')
        places = np.random.default_rng(0).uniform(-2, 2, (50, 3))
        pl.ibr.add_instances(pv.Cone(resolution=8), places, scale=0.3)
        pl.ibr.add(pvibr.Bloom(threshold=0.5))
        take = pl.ibr.screenshot

        def follow(**options):
            moment = pl.ibr.time
            ball.position = (moment / 10, 0, 0)
            if moment == fails_at and not (notes / 'mended').exists():
                raise ZeroDivisionError('it was asked to')
            if moment == dies_at and not (notes / 'died').exists():
                (notes / 'died').touch()
                os.kill(os.getpid(), signal.SIGKILL)
            with (notes / 'drawn').open('a') as file:
                file.write(f'{moment:g}\n')
            return take(**options)

        pl.ibr.screenshot = follow
        return pl

    return make
