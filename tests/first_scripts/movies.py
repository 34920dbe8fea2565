"""A GIF, an MP4, an orbit."""

import tempfile
from pathlib import Path

import imageio.v3 as iio
import pyvista as pv

pl = pv.Plotter(window_size=(128, 96))
pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    pl.open_gif(str(folder / 'a.gif'))
    for _ in range(4):
        pl.camera.azimuth += 20
        pl.write_frame()
    pl.mwriter.close()
    assert iio.imread(folder / 'a.gif').shape[0] == 4
    pl.open_movie(str(folder / 'a.mp4'))
    for _ in range(4):
        pl.camera.azimuth += 20
        pl.write_frame()
    pl.mwriter.close()
    assert (folder / 'a.mp4').stat().st_size > 1000
    pl.orbit_on_path(pl.generate_orbital_path(n_points=4), write_frames=False)

    def turn(time):
        pl.camera.azimuth = 90 * time  # GIFs keep one frame of what stands still

    pl.ibr.movie(folder / 'b.gif', frames=5, fps=10, each=turn)
    frames = iio.imread(folder / 'b.gif')
    assert len(frames) == 5
    assert iio.immeta(folder / 'b.gif')['duration'] == 100
pl.close()
