"""Volumes that VTK draws on the CPU read the window's depth: surfaces hide them all the same."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import place, plotter, read, shot

SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'
FLOATS = {
    'floats': lambda: [pvibr.ShaderEffect(SAME, needs_hdr=True)],
    'surfaces': lambda: [pvibr.Outline(opacity=0.0), pvibr.ShaderEffect(SAME, needs_hdr=True)],
    'bloom': lambda: [pvibr.Bloom(intensity=1e-9)],
}


def fog(kind, seed):
    """Return a grid of noise, of tetrahedra or of voxels."""
    grid = pv.ImageData(dimensions=(3, 3, 3), origin=(-1.5,) * 3, spacing=(1.5,) * 3)
    grid['fog'] = np.random.default_rng(seed).random(27)
    return grid.cast_to_unstructured_grid() if kind == 'ugrid' else grid


def frames(kind, seed, effects, samples, *, apart):
    """Return the first picture, one after a turn and one after a move."""
    pl = plotter((70, 40), shape=(1, 2) if apart else (1, 1))
    pl.render_window.SetMultiSamples(samples)
    pl.subplot(0, len(pl.renderers) - 1)
    ball = pl.add_mesh(pv.Sphere(radius=0.9, center=(0.3, -0.6, 0)), color='tan', lighting=False)
    mapper = {'mapper': 'fixed_point'} if kind == 'voxels' else {}
    pl.add_volume(fog(kind, seed), scalars='fog', show_scalar_bar=False, **mapper)
    for effect in effects:
        pl.ibr.add(effect)
    place(pl, (2, -8, 3))
    pl.show(auto_close=False)
    pictures = [read(pl.render_window)]  # the very first frame; a second one would find its depth
    for move in (lambda: pl.camera.Azimuth(40), lambda: setattr(ball, 'position', (0, -1.0, 0.6))):
        move()
        pictures.append(shot(pl))
    pl.close()
    return np.array(pictures, int)


@pytest.mark.parametrize(
    ('name', 'kind', 'samples'),
    [('floats', 'ugrid', 0), ('surfaces', 'voxels', 0), ('bloom', 'ugrid', 4)],
)
def test_surfaces_hide_volumes_of_the_cpu_as_without_effects(name, kind, samples):
    apart = name == 'surfaces'
    off = frames(kind, 5, [], samples, apart=apart)
    on = frames(kind, 5, FLOATS[name](), samples, apart=apart)
    assert np.ptp(off, axis=0).max() > 60
    first = int(samples > 0)  # VTK resolves the samples of a first frame in its own way
    assert np.abs(on - off)[first:].max() <= 1
