"""What draws frames without the plotter's ``render`` draws those that it draws."""

from functools import cache, partial

import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.animation import Clip, FigureMesh, Skeleton, Track
from pvibr.maths.image_error import box_reduce

SIZE = (64, 48)
TIMES = np.arange(4) / 4
EYE = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]


def walker(pl):
    """A figure that walks away from the eye, to z = -90."""
    walk = Clip('walk', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, -100]])])
    ball = FigureMesh(pv.Sphere(radius=1), node=0)
    pl.ibr.add_animated(pvibr.Figure([ball], Skeleton([-1], [np.eye(4)]), [walk]), clip='walk')
    pl.camera_position = EYE


def points(pl):
    balls = pl.ibr.add_spheres([[0, 0, 0], [1, 0, 0]], 1.0)
    pl.camera_position = EYE
    return lambda time: setattr(balls, 'points', [[0, 0, 0], [1, 0, -100 * time]])


def around(pl):
    """Spheres before and behind the eye, which move away from it."""
    balls = pl.ibr.add_spheres([[0, 0, -5], [0, 0, 5]], 1.0)
    pl.camera_position = [(0, 0, 0), (0, 0, -1), (0, 1, 0)]
    return lambda time: setattr(balls, 'points', np.outer([-1, 1], [0, 0, 5 + 50 * time]))


def plain(pl):
    """An actor of PyVista's, which resets nothing."""
    ball = pl.add_mesh(pv.Sphere(radius=1), color='red')
    pl.camera_position = EYE
    return lambda time: setattr(ball, 'position', (0, 0, -8 * time))


def cut(pl):
    """The user's clipping range cuts the figure open."""
    walker(pl)
    pl.camera.clipping_range = 4.5, 20


def parallel(pl):
    walker(pl)
    pl.enable_parallel_projection()


def ground(pl):
    walker(pl)
    pl.ibr.add(pvibr.Ground(up=(0, 1, 0)))


def linked(pl):
    walker(pl)
    pl.subplot(0, 1)
    pl.add_mesh(pv.Cube(), color='blue')
    pl.link_views()


def turning(pl):
    """The camera moves with the time, too."""
    walker(pl)
    return lambda time: setattr(pl, 'camera_position', [(9 * time, 0, 5), *EYE[1:]])


def chart(pl):
    """A chart of growing data, to which PyVista fits the axes in each ``render``."""
    pl.add_mesh(pv.Sphere(radius=1))
    pl.camera_position = EYE
    line = pv.Chart2D(size=(1, 1), loc=(0, 0))
    line.background_color = 'white'
    pl.add_chart(line)
    plot = line.line([0, 1], [0, 1])
    return lambda time: plot.update([0, 1 + 9 * time], [0, 1 + 30 * time])


def slide(pl):
    """What the user calls after each frame changes the next one."""
    ball = pl.add_mesh(pv.Sphere(radius=1), color='red')
    pl.camera_position = EYE
    pl.add_on_render_callback(lambda _: ball.AddPosition(0.1, 0, 0))


SCENES = (walker, points, around, plain, cut, parallel, ground, linked, turning, chart)


def plotter(scene, times=1):
    """Return a plotter with a scene, and what shows it at a time."""
    size, shape = (times * SIZE[0], times * SIZE[1]), (1, 2) if scene is linked else (1, 1)
    pl = pv.Plotter(off_screen=True, window_size=size, shape=shape, border=False)
    change = scene(pl)

    def go(time):
        pl.ibr.time = time
        if change is not None:
            change(time)

    go(0.0)
    pl.show(auto_close=False)
    return pl, go


def shot(pl):
    return np.array(pl.screenshot(return_img=True))


@cache
def rendered(scene, times=1):
    """The frames of PyVista's ``render``."""
    pl, go = plotter(scene, times)
    frames = []
    for time in TIMES:
        go(time)
        pl.render()
        frames.append(shot(pl))
    pl.close()
    return frames


def movie(pl, go, folder, **options):
    pl.ibr.movie(folder / 'frames', frames=len(TIMES), fps=len(TIMES), each=go, **options)
    return [iio.imread(file) for file in sorted((folder / 'frames').iterdir())]


def each(take, pl, go, _folder):
    frames = []
    for time in TIMES:
        go(time)
        frames.append(take(pl))
    return frames


def accumulated(pl):
    if not any(isinstance(e, pvibr.Accumulation) for e in pl.ibr.effects):
        pl.ibr.add(pvibr.Accumulation(4))
    for _ in range(6):
        pl.render()
    return shot(pl)


def exported(pl):
    plain_plotter = pl.ibr.to_plain_plotter()
    frame = shot(plain_plotter)
    plain_plotter.close()
    return frame


def after_others(pl):
    """The window's frame after pictures of all kinds were taken."""
    for options in ({'scale': 2}, {'window_size': (9, 8)}, {'samples': 2}):
        pl.ibr.screenshot(**options)
    return shot(pl)


EXACT = {
    'movie': movie,
    'screenshot': partial(each, lambda pl: pl.ibr.screenshot()),
    'transparent': partial(
        each, lambda pl: pl.ibr.screenshot(transparent_background=True)[..., :3]
    ),
    'after others': partial(each, after_others),
}
NEAR = {
    'movie of samples': partial(movie, samples=8),
    'open shutter': partial(movie, samples=8, shutter=1e-6),
    'samples': partial(each, lambda pl: pl.ibr.screenshot(samples=8)),
    'accumulation': partial(each, accumulated),
    'tiles': partial(each, lambda pl: box_reduce(pl.ibr.screenshot(scale=4), 4)),
    'plain plotter': partial(each, exported),
}


def is_drawn(frame):
    return (np.abs(frame.astype(int) - frame[0, 0]).max(-1) > 40).any()


@pytest.mark.parametrize('scene', SCENES, ids=lambda s: s.__name__)
@pytest.mark.parametrize('kind', EXACT)
def test_frames_are_those_of_render(kind, scene, tmp_path):
    pl, go = plotter(scene)
    frames = EXACT[kind](pl, go, tmp_path)
    for frame, expected in zip(frames, rendered(scene), strict=True):
        np.testing.assert_array_equal(frame, expected)


@pytest.mark.parametrize('scene', [walker, cut, linked], ids=lambda s: s.__name__)
@pytest.mark.parametrize('kind', NEAR)
def test_samples_tiles_and_exports_show_what_render_shows(kind, scene, tmp_path):
    pl, go = plotter(scene)
    frames = NEAR[kind](pl, go, tmp_path)
    for frame, large in zip(frames, rendered(scene, times=4), strict=True):
        truth = box_reduce(large, 4)
        off = np.abs(frame - truth).sum()
        assert off <= 0.95 * np.abs(truth - truth[0, 0]).sum()  # a few pixels, at the end; lost: 1


@pytest.mark.parametrize(
    'scene', [walker, points, around, parallel, ground, linked], ids=lambda s: s.__name__
)
def test_what_leaves_the_clipping_range_is_not_lost(scene, tmp_path):
    pl, go = plotter(scene)
    for frame in movie(pl, go, tmp_path):
        halves = np.split(frame, 2, axis=1) if scene is linked else [frame]
        assert all(map(is_drawn, halves))


class Writer:
    """The last frame of a movie."""

    def append_data(self, frame):
        self.frame = np.array(frame)

    def close(self):
        """Do as imageio's writers."""


def test_movies_call_back_as_write_frame_does(tmp_path):
    pl, go = plotter(slide)
    frames = movie(pl, go, tmp_path)
    pl, go = plotter(slide)
    pl.mwriter = Writer()
    for frame in frames:
        pl.write_frame()
        np.testing.assert_array_equal(frame, pl.mwriter.frame)


def test_the_range_after_a_movie_is_that_of_the_scene_before(tmp_path):
    pl, go = plotter(walker)
    go(0.5)  # not drawn yet
    movie(pl, go, tmp_path, start=0.5)
    pl.render()
    assert is_drawn(shot(pl))
    near, far = pl.camera.clipping_range
    assert near < 55 < far
