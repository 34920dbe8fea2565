"""Effects beside multisampling: soft edges stay as VTK draws them, in floats too."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.effect import Effect
from tests.pictures import off, shot

SIZE = (200, 150)
SAME = 'vec4 effect(vec2 uv) { return color_at(uv); }'
#: Effects at next to nothing: what they change besides their own is what is tested.
FAINT = {
    'tone mapping': lambda: pvibr.ToneMapping(),
    'bloom': lambda: pvibr.Bloom(threshold=5, needs_hdr=True),
    'bloom of bytes': lambda: pvibr.Bloom(threshold=5),
    'lens': lambda: pvibr.DepthOfField(radius=1e-4, debug='', needs_hdr=True),
    'own': lambda: pvibr.ShaderEffect(SAME, needs_hdr=True),
    'lines': lambda: pvibr.Outline(opacity=1e-3),
    'vignette': lambda: pvibr.Vignette(intensity=1e-4),
}
#: Beside each other.
TOGETHER = (
    *(FAINT[name] for name in ('tone mapping', 'bloom', 'lens', 'vignette', 'lines')),
    lambda: pvibr.AmbientOcclusion(strength=1e-4),
    lambda: pvibr.Fog(1e6),
)


def scene(samples, seed=3):
    """Return a plotter of random boxes and balls, solid and translucent, in two subplots."""
    rng = np.random.default_rng(seed)
    pl = pv.Plotter(window_size=SIZE, shape=(1, 2), border=False, off_screen=True)
    pl.render_window.SetMultiSamples(samples)
    for column in range(2):
        pl.subplot(0, column)
        pl.set_background(rng.uniform(0, 0.4, 3))
        for k in range(8):
            mesh = (pv.Cube() if k % 2 else pv.Sphere()).rotate_vector(rng.normal(size=3), 40)
            place = rng.uniform(-1, 1, 3)
            color, opacity = rng.uniform(0.2, 1, 3), 1.0 if k < 6 else 0.5
            pl.add_mesh(mesh.scale(0.5).translate(place), color=color, opacity=opacity)
        pl.camera_position = [(0, -4, 2), (0, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    return pl


@pytest.mark.parametrize('samples', [4, 8])
def test_soft_edges_are_those_of_the_plain_picture(samples):
    hard = shot(scene(0))
    pl = scene(samples)
    plain, clear = shot(pl), shot(pl, transparent_background=True)
    assert (off(plain, hard) > 8).sum() > 300
    assert len(np.unique(clear[..., 3])) > 3
    for name, make in FAINT.items():
        effect = pl.ibr.add(make())
        assert off(shot(pl), plain).max() <= 1, name
        assert pl.ibr.report().rows[0].state == 'ran' or name == 'lens', pl.ibr.report()
        assert off(shot(pl, transparent_background=True), clear).max() <= 1, name
        pl.ibr.remove(effect)
    for make in TOGETHER:
        pl.ibr.add(make())
    assert off(shot(pl), plain).max() <= 2
    assert off(shot(pl, transparent_background=True), clear).max() <= 2


def test_a_sky_composites_soft_edges():
    """A silhouette is a mean of what is on both sides: nothing brighter, nothing darker."""
    frames = []
    for samples in (0, 4):
        pl = scene(samples)
        pl.ibr.add(pvibr.Sky(top=(0.1, 0.2, 0.5), horizon=(0.9, 0.9, 0.8)))
        pl.ibr.add(pvibr.ToneMapping())
        frames.append(shot(pl))
        pl.close()
    hard, soft = frames
    assert (off(soft, hard) > 8).sum() > 300
    near = [np.roll(hard, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    low, high = np.min(near, axis=0) - 6, np.max(near, axis=0) + 6
    outside = ((soft < low) | (soft > high)).any(axis=2)
    assert outside[2:-2, 2:-2].mean() < 0.002


class Bright(Effect):
    """Turns the picture of the scene into floats, and remembers them."""

    needs_hdr = True
    found = None

    def render(self, frame, picture):
        """Read the colours."""
        self.found = picture.color.download()


def test_light_above_one_has_soft_edges():
    """The mean is that of light, as VTK has it: a coverage of a half is 2 ** (-1 / 2.2)."""
    pl = pv.Plotter(window_size=SIZE, lighting='none', off_screen=True)
    pl.render_window.SetMultiSamples(4)
    pl.set_background('black')
    pl.add_light(pv.Light(light_type='headlight', intensity=8))
    pl.add_mesh(pv.Plane(direction=(0, 0, 1)).rotate_z(20), color='white', diffuse=1, ambient=0)
    pl.camera_position = 'xy'
    bright = pl.ibr.add(Bright())
    pl.show(auto_close=False)
    value = bright.found[..., 0]
    full = value.max()
    assert full > 4
    shares = np.unique(np.round((value / full) ** 2.2, 3))
    np.testing.assert_allclose(shares, np.arange(5) / 4, atol=2e-3)
