"""Outlines in scenes with volumes: hidden as surfaces behind a volume are, whole before it."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import place, plotter, shown

pytestmark = pytest.mark.sampled

OPTIONS = {
    'plain': lambda pl: None,
    'multisampled': lambda pl: pl.render_window.SetMultiSamples(4),
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'floats': lambda pl: pl.ibr.add(pvibr.ShaderEffect(SAME, needs_hdr=True)),
    'chosen': lambda pl: None,
    'parallel': lambda pl: None,
}
SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'


def cloud(seed):
    """Return a ball of fog with dense lumps."""
    grid = pv.ImageData(dimensions=(16, 16, 16), origin=(-1.5,) * 3, spacing=(0.2,) * 3)
    rng = np.random.default_rng(seed)
    lumps = [np.exp(-4 * ((grid.points - c) ** 2).sum(1)) for c in rng.normal(0, 0.4, (4, 3))]
    grid['fog'] = np.clip(sum(lumps), 0, 1)
    return grid


def picture(option, seed, *, lines, volume, cube=2.0, ground='white'):
    pl = plotter((140, 100), shape=(1, 2) if option == 'floats' else (1, 1))
    pl.subplot(0, len(pl.renderers) - 1)
    pl.set_background(ground)
    shown_cube = None
    if cube is not None:
        box = pv.Cube(center=(0, cube, 0), x_length=1.4, y_length=0.5, z_length=1.4)
        shown_cube = pl.add_mesh(box.rotate_z(20 + 7 * seed), color='tan', lighting=False)
    if volume:
        look = {'opacity': [0, 0.8], 'clim': [0, 1], 'cmap': 'Blues', 'shade': False}
        pl.add_volume(cloud(seed), scalars='fog', show_scalar_bar=False, **look)
    OPTIONS[option](pl)
    if lines:
        chosen = [shown_cube] if option == 'chosen' else None
        pl.ibr.add(pvibr.Outline(chosen, color='red', hidden='dashed' if chosen else 'absent'))
    place(pl, (0, -8, 1), parallel=2.0 if option == 'parallel' else None)
    return shown(pl), pl.close()


@pytest.mark.parametrize('option', OPTIONS)
def test_volumes_hide_lines_as_they_hide_what_has_them(option):
    seed = 4 if option == 'plain' else 1
    on = picture(option, seed, lines=True, volume=True)[0]
    # VTK alone draws no volume in the first frame under SSAA.
    off = picture(option.replace('ssaa', 'plain'), seed, lines=False, volume=True)[0]
    bare = picture(option, seed, lines=True, volume=False)[0]
    dark, bright = (
        picture('parallel' if option == 'parallel' else 'plain', seed, lines=False, volume=True,
                cube=None, ground=g)[0] for g in ('black', 'white')
    )  # fmt: skip
    dark, bright = (p[:, -on.shape[1] :] for p in (dark, bright))
    if option == 'floats':  # the scene is in the right half of the window
        middle = on.shape[1] // 2 + 1
        on, off, bare = (p[:, middle:] for p in (on, off, bare))
        dark = bright = None
    lined = np.abs(bare - [255, 0, 0]).max(2) < 3
    assert lined.sum() > 60
    if dark is None:
        kept = np.abs(on - off).max(2)[lined] / np.abs(bare - off).max(2)[lined].clip(1)
        assert kept.min() < 0.5 < kept.max()
        return
    through = (bright - dark) / 255.0
    expected = off + through * (bare - off)
    assert through[lined].min() < 0.4
    error = np.abs(on - expected)
    assert error[lined].max() <= (48 if option == 'ssaa' else 14)
    # Antialiased, on is apart from off at steep edges of the fog itself.
    clear = 20 if option == 'ssaa' else 6
    assert np.abs(on - off)[through.min(2) < 0.02].max(initial=0) <= clear


def test_lines_before_a_volume_are_whole():
    for seed in (1, 3):
        on, bare = (picture('plain', seed, lines=True, volume=v, cube=-2.5)[0] for v in (1, 0))
        lined = np.abs(bare - [255, 0, 0]).max(2) < 3
        assert lined.sum() > 60
        assert np.abs(on - bare)[lined].max() <= 3
