"""A large mesh is coarse while the view moves, and refined frame by frame once it rests."""

import itertools

import pytest

from pvibr.capture.adaptive_quality import SETTLE
from tests.capture.test_adaptive_quality import drag, event, press, release, slow, window
from tests.large.surfaces import terrain

__all__ = ['slow', 'window']  # fixtures


@pytest.fixture
def dragged(window):
    """A window after a drag of a large mesh, what was noted of its frames, and the mesh."""
    window.window.SetSize(480, 360)
    thing = window.ibr.add_large_mesh(terrain(), max_error=0.5, cache=False)
    renderer = window.window.GetRenderers().GetFirstRenderer()
    camera = renderer.GetActiveCamera()
    camera.SetPosition(0.4, -1.0, 0.9)
    camera.SetFocalPoint(0.5, 0.5, 0)
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCameraClippingRange()
    frames = []

    def note(*_):
        frames.append(thing.report())
        window.slow.now += 0.02 + 6e-6 * frames[-1]['triangles']

    window.slow.full = 0.0  # triangles take the time
    renderer.AddObserver('EndEvent', note)
    window.window.Render()
    drag(window, 12)
    yield window, thing, frames
    window.ibr.remove(thing)


def rest(window):
    window.slow.now += SETTLE
    window.tick()


def test_it_is_refined_frame_by_frame_at_rest(dragged):
    window, thing, frames = dragged
    full, lowered = frames[0], frames[-1]
    assert lowered['triangles'] < 0.25 * full['triangles']
    assert not thing.refined
    moving = len(frames)
    release(window)
    while window.timers and len(frames) < moving + 30:
        rest(window)
    counts = [frame['triangles'] for frame in frames[moving - 1 :]]
    assert 3 < len(counts) < 25
    assert counts == sorted(counts)
    # All detail may come at once, where the one step before had none.
    assert max(b / a for a, b in itertools.pairwise(counts)) < 4
    assert thing.refined
    assert frames[-1]['error'] == 0.5
    assert counts[-1] == pytest.approx(full['triangles'], rel=0.1)
    rest(window)
    assert len(frames) == moving + len(counts) - 1


def test_a_press_stops_it(dragged):
    window, thing, _ = dragged
    release(window)
    rest(window)
    press(window)
    assert not window.timers
    assert not thing.refined
    event(window, 'MouseMoveEvent', 60)
    assert not thing.refined
    release(window)
    while window.timers:
        rest(window)
    assert thing.refined
