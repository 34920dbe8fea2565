"""Shadow maps stay within the memory that they are given."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import plotter, shot

pytestmark = pytest.mark.sampled


def scene(lights=1):
    pl = plotter((90, 60))
    pl.remove_all_lights()
    for k in range(lights):
        pl.add_light(pv.Light(position=(1 + k, 1, 3), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='white')
    pl.add_mesh(pv.Sphere(center=(0, 0, 1)), color='tomato')
    pl.camera_position = [(0, -6, 5), (0, 0, 0), (0, 0, 1)]
    return pl


@pytest.mark.parametrize('method', ['hard', 'pcf', 'pcss', 'vsm', 'evsm', 'msm'])
@pytest.mark.parametrize('lights', [1, 3])
def test_maps_stay_within_their_memory(method, lights):
    pl = scene(lights)
    shadows = pl.ibr.add(pvibr.Shadows(method=method, resolution=1024, memory=2.0))
    with pytest.warns(pvibr.PvibrWarning, match=r'resolution = 1024.*memory = 2'):
        pl.show(auto_close=False)
    report = shadows.report()
    assert report['lights'] == lights
    assert 0.4 * 2**21 < report['bytes'] <= 2**21
    assert 16 <= report['texels'] < 1024
    small = shot(pl).astype(float)
    shadows.memory = 1024.0
    large = shot(pl).astype(float)
    assert shadows.report()['texels'] == 1024
    assert np.abs(small - large).mean() < 8  # the shadow is there in both
