"""The pipeline: nothing silent, nothing left behind, not a pixel touched that need not be."""

from __future__ import annotations

import gc
import sys
import weakref

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.pipeline import Pipeline
from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.errors import ClosedError, PvibrWarning
from pvibr.core.params import Param
from pvibr.gl import Quad
from pvibr.gl.hidden_window import read_pixels
from pvibr.gl.texture import Texture
from tests.pictures import depth_buffer

pytestmark = pytest.mark.sampled

SIZE = (160, 90)
WHITE = np.array([255, 255, 255, 255], np.uint8)


class Filter(Effect):
    """Draws the picture through one line of GLSL that changes ``c``."""

    code = ''
    amount = Param(1.0, 'How much.', range='[0, 1]')
    quad = None
    frames = 0

    def needed(self, frame):
        return self.amount > 0 or 'amount is 0'

    def prepare(self, frame):
        self.frames += 1

    def render(self, frame, picture):
        if self.quad is None:
            head = 'uniform sampler2D color; uniform sampler2D depth; void main() {'
            body = f'vec4 c = texture(color, uv); float z = texture(depth, uv).r; {self.code}'
            self.quad = Quad(frame.window, f'{head} {body} gl_FragData[0] = c; }}', self.name)
        with picture.drawing():
            self.quad.draw(textures={'color': picture.color, 'depth': picture.depth})

    def release(self):
        if self.quad is not None:
            self.quad.release()
            self.quad = None


class Same(Filter):
    """An image effect that lights nothing."""


class SameHigh(Filter):
    """The same with colours above 1."""

    needs_hdr = True


class Invert(Filter):
    code = 'c.rgb = 1.0 - c.rgb;'


class Near(Filter):
    code = 'c.rgb = vec3(z < 1.0 ? 1.0 : 0.0);'


class Brightest(Filter):
    """White where light is above what a display shows."""

    needs_hdr = True
    code = 'c.rgb = vec3(max(c.r, max(c.g, c.b)) > 1.0 ? 1.0 : 0.0);'


class Broken(Effect):
    hook = 'prepare'

    def _fail(self, hook):
        if hook == self.hook:
            raise ZeroDivisionError(hook)
        return True

    def needed(self, frame):
        return self._fail('needed')

    def prepare(self, frame):
        self._fail('prepare')

    def finish(self, frame):
        self._fail('finish')

    def render(self, frame, picture):
        self._fail('render')


def scene(pl, *, text=False, opacity=1.0):
    pl.disable_anti_aliasing()
    pl.add_mesh(pv.Sphere(), color='tan', smooth_shading=True, show_scalar_bar=False)
    pl.add_mesh(pv.Cube().translate((0.4, 0.4, 0.4)), color='red', opacity=opacity)
    if text:
        pl.add_text('text', font_size=12)
    return pl


@pytest.fixture
def pl():
    return scene(pv.Plotter(window_size=SIZE))


def grab(pl):
    """Return what one new frame holds: (height, width, 4) uint8, and depth; row 0 below."""
    pl.render_window.Render()
    return read_pixels(pl.render_window, alpha=True), depth_buffer(pl)[::-1]


def show(pl):
    pl.show(auto_close=False)
    return grab(pl)


def observers(renderer):
    return [renderer.HasObserver(e) for e in ('StartEvent', 'EndEvent')]


def assert_same(one, other, most=0):
    """The same colours, and the same depth as near as rounding lets it be."""
    off = np.abs(one[0].astype(int) - other[0]).max(axis=2)
    assert off.max() <= most, f'{(off > most).sum()} pixels differ, by up to {off.max()}'
    np.testing.assert_allclose(one[1], other[1], atol=2e-6)


# ---------------------------------------------------------------- what is in it


def test_empty_it_watches_nothing(pl):
    before = show(pl)
    assert not any(observers(pl.renderer))
    same = pl.ibr.add(Same())
    assert all(observers(pl.renderer))
    pl.ibr.remove(same)
    assert not any(observers(pl.renderer))
    assert_same(grab(pl), before)


def test_adding_twice_or_something_else(pl):
    same = pl.ibr.add(Same())
    with pytest.raises(ValueError, match='Same is in this subplot already: remove it first'):
        pl.ibr.add(same)
    with pytest.raises(TypeError, match=r'must be a pvibr\.Effect'):
        pl.ibr.add(3)
    for meant in ('bloom', 'Bloom', pvibr.Bloom):
        with pytest.raises(TypeError, match=r'such as pvibr\.Bloom\(\)'):
            pl.ibr.add(meant)
    other = pv.Plotter()
    with pytest.raises(ValueError, match='another subplot'):
        other.ibr.add(same)
    assert pl.ibr.effects == (same,)


def test_removing_what_is_not_there(pl):
    pl.ibr.add(Invert())
    with pytest.raises(ValueError, match='Same is not in this subplot; here are: Invert'):
        pl.ibr.remove(Same())


def test_removed_and_added_again(pl):
    before = show(pl)
    invert = Invert()
    for _ in range(3):
        pl.ibr.add(invert)
        inverted = grab(pl)
        assert_same((255 - inverted[0][..., :3], inverted[1]), (before[0][..., :3], before[1]), 1)
        pl.ibr.remove(invert)
        assert_same(grab(pl), before)


def test_attach_that_fails_adds_nothing(pl):
    class Refuses(Effect):
        def attach(self, pipeline):
            msg = 'no'
            raise OSError(msg)

    with pytest.raises(OSError, match='no'):
        pl.ibr.add(Refuses())
    assert not pl.ibr.effects
    assert not any(observers(pl.renderer))


def test_order_is_that_of_effects_then_as_added(pl):
    from pvibr.effects import ORDER

    made = [type(name, (Effect,), {})() for name in (*reversed(ORDER), 'Zebra', 'Ant')]
    for effect in made:
        pl.ibr.add(effect)
    assert [e.name for e in pl.ibr.effects] == ['Zebra', 'Ant', *ORDER]


# ---------------------------------------------------------------- pixels


@pytest.mark.parametrize('kind', [Same, SameHigh])
@pytest.mark.parametrize('opacity', [1.0, 0.4])
def test_identity_leaves_every_pixel(pl, kind, opacity):
    pl.clear()
    scene(pl, text=True, opacity=opacity)
    before = show(pl)
    pl.ibr.add(kind())
    # Blending in floats is not that in bytes: a unit where surfaces are translucent.
    most = int(kind is SameHigh and opacity < 1)
    assert_same(grab(pl), before, most)
    assert pl.ibr.report().rows[0].state == 'ran'


def test_identity_keeps_multisampling(pl):
    pl.enable_anti_aliasing('msaa', multi_samples=4)
    before = show(pl)
    assert len(np.unique(before[0][..., 3])) > 2  # edges that cover a part of a pixel
    pl.ibr.add(Same())
    np.testing.assert_array_equal(grab(pl)[0], before[0])


def test_invert_is_exact_and_spares_text():
    plain = show(scene(pv.Plotter(window_size=SIZE)))[0]
    text = show(scene(pv.Plotter(window_size=SIZE), text=True))[0]
    pl = scene(pv.Plotter(window_size=SIZE), text=True)
    pl.ibr.add(Invert())
    seen = show(pl)[0]
    where = (text != plain).any(axis=2)
    assert 20 < where.sum() < where.size / 2
    np.testing.assert_array_equal(seen[~where][:, :3], 255 - plain[~where][:, :3])
    black = (text == [0, 0, 0, 255]).all(axis=2) | (text[..., :3] < 10).all(axis=2)
    assert black.any()
    assert (seen[black & where][:, :3] < 30).all()


def test_first_frame_has_its_annotations():
    pl = scene(pv.Plotter(window_size=SIZE), text=True)
    pl.add_mesh(pv.Sphere(), scalars=np.arange(842.0), scalar_bar_args={'title': 'z'})
    pl.ibr.add(Same())
    pl.show(auto_close=False)
    assert_same(grab(pl), grab(pl))
    first = pl.screenshot()
    pl.ibr.clear()
    assert np.abs(first.astype(int) - pl.screenshot()).max() == 0


def test_depth_is_the_scenes(pl):
    _, depth = show(pl)
    pl.ibr.add(Near())
    seen = grab(pl)[0][..., 0] > 127
    np.testing.assert_array_equal(seen, depth < 1)
    assert 0.05 < seen.mean() < 0.95


def test_high_range_sees_light_above_white():
    pl = pv.Plotter(window_size=SIZE, lighting='none')
    pl.disable_anti_aliasing()
    pl.add_light(pv.Light(position=(0, 0, 5), light_type='headlight', intensity=3.0))
    pl.add_mesh(pv.Sphere(), color='white', smooth_shading=True)
    pl.ibr.add(Brightest())
    seen = show(pl)[0][..., 0] > 127
    assert 0.01 < seen.mean() < 0.9


@pytest.mark.parametrize('samples', [0, 4])
def test_floats_leave_the_window_its_depth(pl, samples):
    pl.render_window.SetMultiSamples(samples)
    before = show(pl)[1]
    pl.ibr.add(Near()).needs_hdr = True
    colors, depth = grab(pl)
    np.testing.assert_array_equal(depth, before)
    seen = colors[..., 0] > 127
    off = seen != (before < 1)
    assert off.mean() < (0.02 if samples else 1e-9)  # edges have samples of both


def test_switching_allocates_nothing_and_long_rest_frees(pl, monkeypatch):
    effect = pl.ibr.add(SameHigh())
    show(pl)
    made, allocate = [], Texture.allocate
    monkeypatch.setattr(Texture, 'allocate', lambda *a: made.append(a) or allocate(*a))
    for enabled in (False, True, False, True):
        effect.enabled = enabled
        grab(pl)
    assert made == []
    effect.enabled = False
    for _ in range(10):
        grab(pl)
    assert pl.ibr.report().picture_bytes == 0


def test_two_effects_are_one_after_the_other(pl):
    before = show(pl)
    pl.ibr.add(Invert())
    pl.ibr.add(Invert())
    pl.ibr.add(Same())
    assert_same(grab(pl), before)


@pytest.mark.parametrize('kind', [Same, SameHigh])
def test_transparent_background_stays(pl, kind):
    before = show(pl)
    transparent = pl.screenshot(transparent_background=True)
    assert 0 < (transparent[..., 3] == 0).mean() < 1
    pl.ibr.add(kind())
    np.testing.assert_array_equal(pl.screenshot(transparent_background=True), transparent)
    assert_same(grab(pl), before)


@pytest.mark.parametrize('high', [False, True])
def test_each_subplot_keeps_to_itself(high):
    pl = pv.Plotter(shape=(2, 2), window_size=(200, 120), border=False)
    for i in range(4):
        pl.subplot(i // 2, i % 2)
        scene(pl)
    before = show(pl)[0]
    pl.subplot(1, 1)  # the lower right
    invert = pl.ibr.add(Invert())
    invert.needs_hdr = high
    after = grab(pl)[0]
    tile = np.zeros(before.shape[:2], bool)
    tile[:60, 100:] = True
    np.testing.assert_array_equal(after[~tile], before[~tile])
    # In a texture of its own, the tile's triangles are cut at other fractions of a pixel.
    off = np.abs(after[tile][:, :3].astype(int) - (255 - before[tile][:, :3]))
    assert off.max() <= (1 if high else 0)
    pl.subplot(0, 0)
    assert not pl.ibr.effects


@pytest.mark.parametrize('kind', [Same, SameHigh])
def test_background_layer_stays(kind):
    pl = scene(pv.Plotter(window_size=SIZE))
    pl.add_background_image(pv.examples.mapfile)
    before = show(pl)
    pl.ibr.add(kind())
    assert_same(grab(pl), before)


@pytest.mark.parametrize('size', [(1, 1), (300, 20), (20, 300)])
def test_any_window(size):
    pl = scene(pv.Plotter(window_size=size))
    before = show(pl)
    pl.ibr.add(Same())
    assert_same(grab(pl), before)


def test_resized_window(pl):
    invert = pl.ibr.add(Invert())
    show(pl)
    for size in ((90, 160), (200, 50)):
        pl.window_size = size
        pl.ibr.pipeline.effects[0].enabled = True
        inverted = grab(pl)[0]
        pl.ibr.remove(invert)
        np.testing.assert_array_equal(255 - inverted[..., :3], grab(pl)[0][..., :3])
        pl.ibr.add(invert)


@pytest.mark.parametrize('kind', [Same, SameHigh])
def test_large_screenshot_in_tiles(pl, kind):
    show(pl)
    before = pl.screenshot(scale=2)
    pl.ibr.add(kind())
    after = pl.screenshot(scale=2)
    assert after.shape == before.shape
    assert np.abs(after.astype(int) - before).max() <= 1


# ---------------------------------------------------------------- the pass slot


def foreign(pl):
    """A pass as another library sets it: supersampling around the plain steps."""
    steps, camera, outer = _vtk.vtkRenderStepsPass(), _vtk.vtkCameraPass(), _vtk.vtkSSAAPass()
    camera.SetDelegatePass(steps)
    outer.SetDelegatePass(camera)
    pl.renderer.SetPass(outer)
    return outer


PASSES = {
    'ssao': lambda pl: pl.enable_ssao(),
    'edl': lambda pl: pl.enable_eye_dome_lighting(),
    'shadows': lambda pl: pl.enable_shadows(),
    'peeling': lambda pl: pl.enable_depth_peeling(),
    'ssaa': lambda pl: pl.enable_anti_aliasing('ssaa'),
    'foreign': foreign,
    'none': lambda pl: None,
}


@pytest.mark.parametrize('high', [False, True])
@pytest.mark.parametrize('name', PASSES)
def test_slot_holds_after_a_frame_what_it_held_before(pl, name, high):
    pl.clear()
    scene(pl, opacity=0.4 if name == 'peeling' else 1.0)
    kept = PASSES[name](pl)
    found = pl.renderer.GetPass()
    before = show(pl)
    same = pl.ibr.add(SameHigh() if high else Same())
    after = grab(pl)
    assert pl.renderer.GetPass() is found
    off = np.abs(after[0].astype(int) - before[0]).max(axis=2)
    assert off.max() <= (1 if high else 0), f'{(off > 1).sum()} pixels'
    pl.ibr.remove(same)
    assert_same(grab(pl), before)
    if name == 'foreign':
        pl.renderer.SetPass(None)
        kept.ReleaseGraphicsResources(pl.render_window)


def test_slot_is_untouched_where_nothing_is_drawn(pl):
    seen = []

    class Look(Effect):
        def prepare(self, frame):
            seen.append(frame.renderer.GetPass())

    show(pl)
    pl.ibr.add(SameHigh(amount=0))
    pl.ibr.add(Look())
    tag = pl.renderer.AddObserver('StartEvent', lambda *_: seen.append(pl.renderer.GetPass()), -9)
    grab(pl)
    pl.renderer.RemoveObserver(tag)
    assert seen == [None, None]


def test_pass_set_while_drawing_is_left(pl):
    """Whoever takes the slot within the frame keeps it."""
    show(pl)
    pl.ibr.add(SameHigh())
    steps = _vtk.vtkRenderStepsPass()
    tag = pl.renderer.AddObserver('EndEvent', lambda *_: pl.renderer.SetPass(steps), 9)
    grab(pl)
    assert pl.renderer.GetPass() is steps
    pl.renderer.RemoveObserver(tag)
    pl.renderer.SetPass(None)
    steps.ReleaseGraphicsResources(pl.render_window)


@pytest.mark.parametrize('kind', [Same, SameHigh])
def test_hardware_picking_finds_the_actor(pl, kind):
    show(pl)
    effect = pl.ibr.add(kind())
    grab(pl)
    frames = effect.frames
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)
    x, y = SIZE[0] // 2, SIZE[1] // 2
    selector.SetArea(x, y, x, y)
    assert selector.Select().GetNumberOfNodes() == 1
    assert effect.frames == frames
    assert pl.ibr.report().rows[0].state == 'ran'


def test_things_may_prepare_for_picking(pl):
    class Thing(Effect):
        picks = True
        seen = ()

        def prepare(self, frame):
            self.seen += (frame.picking,)

    show(pl)
    thing = pl.ibr.add(Thing())
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)
    selector.SetArea(5, 5, 5, 5)
    selector.Select()
    assert set(thing.seen) == {True}


def test_finish_follows_every_prepare(pl):
    class Thing(Effect):
        picks = True
        calls = ''

        def needed(self, frame):
            return self.enough or 'enough'

        def prepare(self, frame):
            self.calls += 'p'

        def finish(self, frame):
            self.calls += 'f'

    show(pl)
    thing = Thing()
    thing.enough = True
    pl.ibr.add(thing)
    grab(pl)
    grab(pl)
    selector = _vtk.vtkHardwareSelector()
    selector.SetRenderer(pl.renderer)
    selector.SetArea(5, 5, 5, 5)
    selector.Select()
    thing.enough = False
    grab(pl)
    assert thing.calls == 'pf' * (len(thing.calls) // 2)
    assert len(thing.calls) >= 6


# ---------------------------------------------------------------- failure


@pytest.mark.parametrize('hook', ['needed', 'prepare', 'finish', 'render'])
def test_errors_end_in_one_warning_and_the_plain_picture(pl, hook):
    before = show(pl)
    broken = pl.ibr.add(Broken())
    broken.hook = hook
    with pytest.warns(PvibrWarning, match=f'Broken is off.*{hook}.*enabled = True') as caught:
        after = grab(pl)
    assert len(caught) == 1
    assert_same(after, before)
    assert not broken.enabled
    assert_same(grab(pl), before)  # and no second warning
    row = pl.ibr.report().rows[0]
    assert (row.state, row.why) == ('off', f'ZeroDivisionError: {hook}')
    broken.hook, broken.enabled = 'none', True
    grab(pl)
    assert pl.ibr.report().rows[0].state == 'ran'


def test_shader_that_does_not_compile_leaves_the_others(pl):
    class Bad(Filter):
        code = 'c = nothing;'

    before = show(pl)
    pl.ibr.add(Bad())
    pl.ibr.add(Invert())
    with pytest.warns(PvibrWarning, match='Bad is off'), pv.VtkErrorCatcher(send_to_logging=False):
        after = grab(pl)
    np.testing.assert_array_equal(after[0][..., :3], 255 - before[0][..., :3])


# ---------------------------------------------------------------- report, time, frame


def test_report_says_what_ran_what_was_skipped_and_why(pl):
    show(pl)
    effect = pl.ibr.add(Invert())
    pl.ibr.add(Invert(amount=0))
    grab(pl)
    report = pl.ibr.report()
    assert [(r.state, r.why) for r in report.rows] == [('ran', ''), ('skipped', 'amount is 0')]
    assert 0 < report.rows[0].ms < 1000
    assert report.picture_bytes == SIZE[0] * SIZE[1] * 8  # the window's own is read in place
    assert 'amount is 0' in str(report)
    assert report.as_dict()['rows'][1]['effect'] == 'Invert'
    effect.enabled = False
    grab(pl)
    assert pl.ibr.report().rows[0].state == 'off'
    assert effect.frames == 1


def test_frame_is_the_cameras(pl):
    frames = []

    class Look(Effect):
        def prepare(self, frame):
            frames.append(frame)

    pl.ibr.add(Look())
    pl.ibr.time = 1.25
    pl.camera.position = (3, 4, 5)
    show(pl)
    frame = frames[-1]
    assert frame.size == SIZE
    assert (frame.time, frame.picking, frame.parallel) == (1.25, False, False)
    assert [f.index for f in frames] == list(range(len(frames)))
    np.testing.assert_allclose(frame.view_from_world @ [*frame.eye, 1], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(frame.eye, pl.camera.position)
    # One unit of tan(angle): from the centre to the edge there are half the pixels.
    half = np.tan(np.radians(pl.camera.view_angle / 2))
    assert frame.pixel_scale * half == pytest.approx(SIZE[1] / 2)
    with pytest.raises(ValueError, match='read-only'):
        frame.eye[0] = 1
    pl.camera.enable_parallel_projection()
    grab(pl)
    assert frames[-1].parallel
    assert frames[-1].pixel_scale * pl.camera.parallel_scale == pytest.approx(SIZE[1] / 2)


# ---------------------------------------------------------------- ends


def test_thing_removed_by_the_plotters_own_means(pl):
    class Thing(Effect):
        def attach(self, pipeline):
            self.actor = pv.Actor(pv.DataSetMapper(pv.Cone()))
            pipeline.renderer.AddActor(self.actor)

        def detach(self):
            self.gone = True

        @property
        def props(self):
            return (self.actor,)

    show(pl)
    for take in (lambda t: pl.renderer.RemoveActor(t.actor), lambda _: pl.clear()):
        thing = pl.ibr.add(Thing())
        grab(pl)
        assert pl.ibr.effects == (thing,)
        take(thing)
        pl.renderer.RemoveActor(thing.actor)
        grab(pl)
        assert not pl.ibr.effects
        assert thing.gone


def test_released_pipeline_takes_nothing_more(pl):
    show(pl)
    pipeline = Pipeline(pl.renderer)
    pipeline.add(Same())
    grab(pl)
    pipeline.release()
    pipeline.release()
    assert not any(observers(pl.renderer))
    with pytest.raises(ClosedError, match='create a new one'):
        pipeline.add(Same())


def test_nothing_outlives_its_plotter():
    pl = scene(pv.Plotter(window_size=SIZE))
    pl.ibr.add(SameHigh())
    show(pl)
    pipeline = weakref.ref(pl.ibr.pipeline)
    pl.close()
    pl.deep_clean()
    del pl
    gc.collect()
    assert pipeline() is None


def test_frame_of_a_tile(pl):
    """Pixels are as large in a tile of a large screenshot as they are drawn there."""
    frames = []

    class Look(Effect):
        def prepare(self, frame):
            frames.append(frame)

    show(pl)
    pl.ibr.add(Look())
    grab(pl)
    whole = frames.pop()
    assert (whole.tile, whole.scale, whole.whole) == ((0, 0, 1, 1), 1, SIZE)
    pl.screenshot(scale=2)
    tiles = [f for f in frames if f.scale == 2]
    assert len(tiles) >= 4
    for frame in tiles:
        assert frame.whole == pytest.approx((2 * SIZE[0], 2 * SIZE[1]))
        assert frame.pixel_scale == pytest.approx(2 * whole.pixel_scale)
        assert frame.tile[2] - frame.tile[0] == pytest.approx(0.5)


def test_a_plotter_that_is_forgotten_unclosed_ends_in_silence(monkeypatch):
    """Python's collector has cleared weak references when it finalizes what it found."""
    said, gone = [], []
    monkeypatch.setattr(sys, 'unraisablehook', lambda event: said.append(repr(event.exc_value)))
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    pl.add_mesh(pv.Cube())
    pl.ibr.add_spheres([[0.0, 0, 0]], 0.3)
    pl.ibr.add(pvibr.Vignette())
    pl.render()
    weakref.finalize(pl.render_window, gone.append, True)
    pv.plotting.plotter._ALL_PLOTTERS.pop(pl._id_name)
    del pl
    gc.collect()
    assert (said, gone) == ([], [True])
