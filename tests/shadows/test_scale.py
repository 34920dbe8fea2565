"""What is small on large ground has its shadow, by every kind of light, against rays."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.bench.common.light_scenes import LightScene, bare, light_at
from pvibr.bench.common.rays import Rays
from pvibr.bench.shadows.errors import drawn, sight


@pytest.mark.parametrize('kind', ['directional', 'spot', 'point'])
@pytest.mark.parametrize('size', [100.0, 1e4])
def test_a_box_of_a_metre_on_wide_ground(kind, size):
    turn = np.random.default_rng(int(size)).uniform(2.2, 4.0)  # to the side of the box
    ground = bare(pv.Plane(i_size=size, j_size=size, i_resolution=40, j_resolution=40))
    box = bare(pv.Cube(center=(0, 0, 0.5)).rotate_z(np.degrees(turn)))
    way = np.array([0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.7])
    lights = {
        'directional': light_at(way * size),
        'spot': light_at(way * size * 0.5, cone=30.0),
        'point': light_at(way * size * 0.05, cone=90.0),
    }
    scene = LightScene('box', [ground, box], lights, ((4, -9, 5), (0, 0, 0.3), (0, 0, 1)))
    with sight(scene, Rays(scene.meshes), kind, (200, 150), clipping=(1.0, 3 * size)) as found:
        lit = drawn(found, {'method': 'pcf'})
    known = np.isfinite(lit) & np.isfinite(found.lit) & ~found.away & ~found.band
    dark = known & (found.lit == 0)
    assert dark.sum() > 20
    assert (np.abs(lit - found.lit)[known] > 0.5).mean() <= 5e-4
    assert (lit[dark] < 0.5).mean() > 0.99
