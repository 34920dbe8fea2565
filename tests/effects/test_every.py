"""What every effect on pixels keeps to, whatever it does."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.effect import Effect
from pvibr.core.errors import ClosedError
from pvibr.effects import ORDER
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad
from tests.makers import ENABLED
from tests.pictures import off, shot, shown
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (96, 64)
SMOOTH = np.dstack([*np.meshgrid(np.linspace(0, 1, 96), np.linspace(1, 0, 64)), np.ones((64, 96))])

#: They look farther than tiles overlap, those of VTK.
WIDE = 'AmbientOcclusion', 'DepthOfField'


def things(pl):
    return [a for a in pl.renderer.actors.values() if isinstance(a, pv.Actor)]


#: The registered effects that draw on pixels; each makes a sample that is seen. The mean of many
#: frames is none: `test_accumulation.py` has the same of it.
EVERY = {
    name: effect
    for name, effect in ((n, getattr(pvibr, n)) for n in pvibr.EFFECTS)
    if effect.render is not Effect.render and name != 'Accumulation'
}
#: Light spreads over shares of the picture, whatever its pixels: that of the window is shown.
LIGHT = [name for name, effect in EVERY.items() if issubclass(effect, LightSpread)]


def scene(pl, *, text=False):
    pl.disable_anti_aliasing()
    pl.set_background((0.2, 0.3, 0.4))
    pl.add_mesh(pv.Sphere(), color='tan', smooth_shading=True)
    pl.add_mesh(pv.Cube(center=(0.5, 0.4, -0.4), x_length=0.6), color='red')
    if text:
        pl.add_text('text', font_size=14, color='magenta')
    pl.camera_position = [(0, -3, 2), (0.1, 0, 0), (0, 0, 1)]
    return pl


def plotter(size=SIZE, **settings):
    pl = scene(pv.Plotter(window_size=size), **settings)
    pl.show(auto_close=False)
    return pl


@pytest.fixture
def pl():
    return plotter()


def sample(pl, name):
    return EVERY[name].sample(things(pl))


def add(pl, name):
    return pl.ibr.add(sample(pl, name))


def nothing(effect):
    setattr(effect, *effect.neutral)


def test_every_effect_is_a_module_of_its_room_and_in_order():
    assert ORDER[1:-1] == tuple(pvibr.EFFECTS)
    assert len(EVERY) >= 14
    for effect in EVERY.values():
        assert effect.__module__ == pvibr.EFFECTS[effect.__name__]


every = pytest.mark.parametrize('name', EVERY)


@every
def test_on_off_removed_and_added_again(pl, name):
    before = shot(pl)
    effect = add(pl, name)
    on = shot(pl)
    assert pl.ibr.report().rows[0].state == 'ran', pl.ibr.report()
    assert off(on, before).max() > 15
    np.testing.assert_array_equal(shot(pl), on)
    nothing(effect)
    np.testing.assert_array_equal(shot(pl), before)
    row = pl.ibr.report().rows[0]
    assert row.state == 'skipped'
    assert row.why
    pl.ibr.remove(effect)
    assert effect.report()['bytes'] == 0
    np.testing.assert_array_equal(shot(pl), before)
    assert pl.ibr.report().picture_bytes == 0
    made = sample(pl, name)
    effect.restore(made.state())
    pl.ibr.add(effect)
    np.testing.assert_array_equal(shot(pl), on)


@every
def test_the_first_frame_is_right(name):
    """A script saves the first one; what is drawn off screen within it gives the context back."""
    pl = scene(pv.Plotter(window_size=SIZE))
    add(pl, name)
    first = shot(pl)
    shot(pl)
    np.testing.assert_array_equal(first, shot(pl))


@every
def test_own_subplot_and_no_annotation(name):
    pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]), border=False)
    for i in range(2):
        pl.subplot(0, i)
        scene(pl, text=True)
    before = shown(pl)
    add(pl, name)
    after = shot(pl)
    np.testing.assert_array_equal(after[:, : SIZE[0]], before[:, : SIZE[0]])
    assert off(after, before).max() > 15
    text = (before == [255, 0, 255]).all(axis=2)
    assert text[:, SIZE[0] :].sum() > 20
    np.testing.assert_array_equal(after[text], before[text])


@every
def test_two_plotters_know_nothing_of_each_other(pl, name):
    other = plotter()
    before = shot(other)
    one, two = add(pl, name), add(other, name)
    assert (off(shot(pl), shot(other)) <= 1).all()
    nothing(two)
    np.testing.assert_array_equal(shot(other), before)
    pl.close()
    refused('create a new one', pl.ibr.add, one, kind=ClosedError)
    np.testing.assert_array_equal(shot(other), before)


@every
def test_transparent_background(pl, name):
    before = shot(pl, transparent_background=True)
    effect = add(pl, name)
    after = shot(pl, transparent_background=True)
    opaque = before[..., 3] == 255
    assert 0.1 < opaque.mean() < 0.9
    if effect.covers:
        assert (after[..., 3] >= before[..., 3] - (255 if name == 'DepthOfField' else 0)).all()
        assert (after[opaque][:, 3] == 255).all() or name == 'DepthOfField'
    else:
        np.testing.assert_array_equal(after[..., 3], before[..., 3])


class Hole(Effect):
    """One pixel that is no number, or black."""

    value = 'zero / zero'
    quad = None

    def render(self, frame, picture):
        if self.quad is None:
            text = f"""uniform float zero; uniform sampler2D color; void main() {{
              bool hole = ivec2(gl_FragCoord.xy) == ivec2(40, 24);
              vec4 c = texture(color, uv);
              gl_FragData[0] = hole ? vec4(vec3({self.value}), c.a) : c; }}"""
            self.quad = Quad(frame.window, text, self.name)
        with picture.drawing():
            self.quad.draw({'zero': 0.0}, {'color': picture.color})

    def release(self):
        if self.quad is not None:
            self.quad.release()
            self.quad = None


@every
def test_a_pixel_that_is_no_number_does_not_spread(name):
    found = []
    for value in (Hole.value, '0.0'):
        pl = plotter()
        hole = Hole()
        hole.value, hole.needs_hdr = value, True
        pl.ibr.add(hole)
        add(pl, name)
        found.append(shot(pl))
        assert [r.state for r in pl.ibr.report().rows] == ['ran', 'ran'], pl.ibr.report()
        pl.close()
    far = np.ones(SIZE[::-1], bool)
    far[64 - 24 - 2 : 64 - 24 + 1, 39:42] = False
    assert off(*found)[far].max() <= 2


@every
def test_sizes_of_windows(pl, name):
    effect = add(pl, name)
    for size in ((1, 1), (130, 7), (7, 90), SIZE):
        pl.window_size = size
        found = shot(pl)
        assert found.shape[:2] == size[::-1]
    assert effect.enabled, pl.ibr.report()
    fresh = plotter()
    add(fresh, name)
    assert (off(found, shot(fresh)) <= 1).all()


@every
def test_a_screenshot_in_tiles_is_that_of_a_larger_window(pl, name):
    """Beside the seams too, but for what a lens spreads over them."""

    def quiet(effect):
        if name == 'NightVision':
            effect.grain = 0  # as large as pixels of the window
        return effect

    quiet(add(pl, name))
    small = shot(pl)
    tiled = shot(pl, scale=2)
    large = plotter((2 * SIZE[0], 2 * SIZE[1]))
    other = quiet(add(large, name))
    if name == 'Outline':
        other.width *= 2
    expected = shot(large)
    if name in LIGHT:
        differ = off(tiled.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3)), small)
        assert differ.mean() <= 2
    else:
        assert off(tiled, expected).max() <= (12 if name in WIDE else 2)
    steps, usual = (np.abs(np.diff(x, axis=1)).mean(axis=(0, 2)) for x in (tiled, expected))
    assert (steps - usual)[SIZE[0] - 6 : SIZE[0] + 6].max() < 2


def volume(pl):
    grid = pv.ImageData(dimensions=(12, 12, 12), spacing=(0.1, 0.1, 0.1), origin=(-1.2, -0.6, 0))
    grid['v'] = np.linalg.norm(grid.points - grid.center, axis=1)
    pl.add_volume(grid, opacity=[0.3, 0.1, 0, 0], show_scalar_bar=False)


COMPANY = {
    name: ENABLED[name] for name in ('ssaa', 'msaa', 'ssao', 'edl', 'peeling', 'shadows')
} | {'volume': volume, 'translucent': ENABLED['nothing']}


@pytest.mark.parametrize('company', COMPANY)
def test_beside_what_a_plotter_enables(pl, company):
    """Each alone, then all at once: they run, nothing of the frame before stays, no VTK error."""
    pl.add_mesh(pv.Cube(center=(-0.5, -0.5, 0.3), x_length=0.4), color='blue', opacity=0.5)
    COMPANY[company](pl)
    before = shot(pl)
    for name in EVERY:
        effect = add(pl, name)
        shot(pl)
        found = shot(pl)
        assert pl.ibr.report().rows[0].state == 'ran', pl.ibr.report()
        assert off(found, before).max() > 10, name
        np.testing.assert_array_equal(shot(pl), found)
        pl.ibr.remove(effect)
        assert off(shot(pl), before).max() <= 1, name
    for name in EVERY:
        if name != 'Sky':  # a backdrop is behind the scene already
            add(pl, name)
    shot(pl)
    assert all(r.state == 'ran' for r in pl.ibr.report().rows), pl.ibr.report()
    pl.ibr.clear()
    assert off(shot(pl), before).max() <= 1


def camera_above():
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, -1, 4), (0, 0, 0), (0, 1, 0)
    return camera


IN_THE_SCENE = {
    'maps': lambda pl: pl.ibr.add(pvibr.Shadows()),
    'volumes': lambda pl: pl.ibr.add(pvibr.Shadows(method='volume')),
    'projector': lambda pl: pl.ibr.add(pvibr.Projector(SMOOTH, camera_above())),
    'instances': lambda pl: pl.ibr.add_instances(
        pv.Sphere(radius=0.1),
        np.random.default_rng(0).uniform(-1, 1, (40, 3)),
        color='red',
        bake=True,
    ),
}


@pytest.mark.parametrize('name', IN_THE_SCENE)
def test_effects_in_the_scene_in_tiles(name):
    found = []
    for size, scale in ((SIZE, 2), ((2 * SIZE[0], 2 * SIZE[1]), None)):
        pl = scene(pv.Plotter(window_size=size, lighting='none'))
        pl.add_mesh(pv.Plane(center=(0, 0, -0.6), i_size=4, j_size=4), color='white')
        pl.add_light(pv.Light(position=(2, -2, 6), light_type='scene light'))
        IN_THE_SCENE[name](pl)
        pl.show(auto_close=False)
        found.append(shot(pl, scale=scale))
    differ = off(*found)
    assert differ.mean() < 0.1
    assert (differ > 8).mean() < 0.002
