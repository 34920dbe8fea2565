"""Ten thousand knots on a plane, and a camera that walks low among them."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.common.harness import Row
from benchmarks.common.meshes import knot
from pvibr.cli.peers import GlyphFrames, beside_peers
from pvibr.cli.timing import CLOCKS, medians_ms
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import MULTI_SAMPLES, Stage

SIZE = 1280, 720
#: Of the walk, that are timed; VTK's own way draws at one of so many.
FRAMES, EVERY = 24, 8
#: Glyphs that are drawn: their time is extrapolated.
PART = 100
#: Of the centres of knots that are 7 wide, and of the eye above their plane.
SPACING, HEIGHT = 12.0, 4.0
_SHIFT = 1.5  # of a knot from its place on the grid


def measure(settings, results):
    """Yield the rows of the walk: at one sample, and at defaults."""
    mesh = knot(settings.knot_cells)
    poses, cameras, bounds = _field(settings.knots)

    def new_stage():
        stage = Stage(settings.knots_size)
        stage.bounds = bounds
        return stage

    parts, index = as_parts(mesh), np.zeros(len(poses), int)
    with ExitStack() as stack:
        own = stack.enter_context(new_stage())
        own.plotter.ibr.add_instances(mesh, poses, progress=False)
        make = partial(GlyphFrames, new_stage, [parts], poses, index, part=PART)
        glyphs = stack.enter_context(make())
        for samples in MULTI_SAMPLES:
            own.window.SetMultiSamples(samples)
            glyphs.sample(samples)
            times = beside_peers(own, {'glyphs': glyphs}, cameras, EVERY)
            ms = {name: medians_ms(frames) for name, frames in times.items()}
            title = f'{len(poses):,} knots of {mesh.n_cells:,} triangles, {samples} samples'
            for clock in CLOCKS:
                yield Row(f'{title}: pvibr, {clock}', ms['pvibr'][clock], 'ms')
                faster = ms['glyphs'][clock] / ms['pvibr'][clock]
                bar = 150 if clock == 'CPU' else None
                name = f'{title}: faster than VTK glyphs ({glyphs.part}, extrapolated), {clock}'
                yield Row(name, faster, 'x', bar, at_least=True)


def _field(count, seed=0):
    """Return the poses of knots, cameras in an aisle through the middle, and the bounds."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    places = np.stack(np.divmod(np.arange(count), side), 1) - (side - 1) / 2 + side % 2 / 2
    places = SPACING * places + rng.uniform(-_SHIFT, _SHIFT, places.shape)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(rng.normal(size=(count, 4))).as_matrix()
    poses[:, :2, 3] = places
    reach = side * SPACING / 2
    eyes = np.linspace(-0.8, 0.4, FRAMES) * reach
    cameras = [((x, 0, HEIGHT), (x + 60.0, 10.0, 0.0), (0, 0, 1)) for x in eyes.tolist()]
    high = reach + 2 * SPACING
    return poses, cameras, (-high, high, -high, high, -5.0, 5.0)
