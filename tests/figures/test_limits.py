"""Figures for which the driver or the memory has no room are drawn all the same, and say how."""

import pytest

import pvibr
from pvibr.gl import Texture
from tests.figures.test_crowd_draws import COUNT, FIGURES, crowd_of
from tests.pictures import off, place, plotter, shot


@pytest.mark.parametrize('make', ['skinned', 'morphed', 'mirrored', 'key frames', 'rigid'])
def test_what_does_not_fit_a_texture_is_posed_by_the_cpu(make, monkeypatch):
    figure, options = FIGURES[make][0](), FIGURES[make][1]

    def pictures():
        pl = plotter((200, 150))
        actor = pl.ibr.add_animated(figure, show_scalar_bar=False, **options)
        place(pl, (6, -8, 4))
        pl.show(auto_close=False)
        shots = []
        for time in (0.0, 0.6, 1.3):
            pl.ibr.time = time
            shots.append(shot(pl))
        return pl, actor, shots

    pl, actor, exact = pictures()
    assert 'posed by' not in actor.report()
    pl.close()
    for module in ('posing', 'pose_sheet'):
        monkeypatch.setattr(f'pvibr.figures.{module}.texture_limit', lambda _window: 0)
    if actor._posed:
        with pytest.warns(pvibr.PvibrWarning, match='posed by the CPU'):
            pl, actor, drawn = pictures()
        assert 'must have at most 0 vertices' in actor.report()['posed by']
        monkeypatch.undo()
        pl.ibr.remove(actor)
        pl.ibr.add(actor)  # there is room now
        drawn.append(shot(pl))
        exact.append(exact[-1])
        assert 'posed by' not in actor.report()
    else:
        pl, actor, drawn = pictures()
    pl.close()
    for a, b in zip(exact, drawn, strict=True):
        assert (off(a, b) > 3).mean() < 1e-3
        assert (off(a, a[0, 0]) > 9).mean() > 0.01


@pytest.fixture
def small(monkeypatch):
    """Set the texture limit."""

    def limit(texels):
        for module in ('posing', 'pose_sheet'):
            monkeypatch.setattr(f'pvibr.figures.{module}.texture_limit', lambda _window: texels)

    return limit


def own_actors(monkeypatch):
    """Let every member of a crowd have actors of its own."""
    monkeypatch.setattr('pvibr.figures.crowd_group.can_share_draws', lambda *_: False)


@pytest.mark.parametrize('name', ['skinned', 'morphed', 'mirrored'])
def test_members_with_actors_of_their_own_share_poses(name, small, monkeypatch):
    own_actors(monkeypatch)
    pl, crowd = crowd_of(name, together=False)
    exact = shot(pl)
    pl.close()
    rows = sum(-(-(mesh.mesh.n_points + 2) // 1024) for mesh in crowd.figure.meshes)
    small(6 * rows)
    pl, crowd = crowd_of(name, together=False)
    drawn = shot(pl)
    assert 'there is room for' in crowd.report()['poses']
    covered, covered_exactly = (off(p, p[0, 0]) > 9 for p in (drawn, exact))
    assert (covered & covered_exactly).sum() > 0.7 * covered_exactly.sum()
    pl.close()


@pytest.mark.parametrize('together', [True, False])
@pytest.mark.parametrize('name', ['skinned', 'dual', 'morphed', 'mirrored', 'culled'])
def test_members_that_fit_no_texture_are_posed_by_the_cpu(name, together, small, monkeypatch):
    if not together:
        own_actors(monkeypatch)
    exact = []
    pl, crowd = crowd_of(name, together=together)
    for time in (0.0, 0.7):
        pl.ibr.time = time
        exact.append(shot(pl))
    pl.close()
    small(0)
    pl, crowd = crowd_of(name, together=None)
    for time, expected in zip((0.0, 0.7), exact, strict=True):
        pl.ibr.time = time
        drawn = shot(pl)
        assert (off(drawn, expected) > 3).mean() < 2e-3
        assert (off(drawn, drawn[0, 0]) > 9).mean() > 0.02
    assert 'by the CPU' in crowd.report()['poses']
    pl.close()


@pytest.mark.parametrize('together', [True, False])
@pytest.mark.parametrize('room', [0, 3])
def test_a_driver_that_refuses_textures_leaves_no_member_out(room, together, monkeypatch):
    """The memory is full: fewer poses, and the CPU where there is no room for one."""
    if not together:
        own_actors(monkeypatch)
    pl, crowd = crowd_of('skinned', together=together)
    exact = shot(pl)
    pl.close()
    rows = sum(-(-(mesh.mesh.n_points + 2) // 1024) for mesh in crowd.figure.meshes)
    allocate = Texture.allocate

    def refuse(texture, width, height, form='rgba8'):
        if form == 'rgba32f' and width == 1024 and height > room * rows:
            raise RuntimeError('the driver refused')
        return allocate(texture, width, height, form)

    monkeypatch.setattr(Texture, 'allocate', refuse)
    pl, crowd = crowd_of('skinned', together=None)
    drawn = shot(pl)
    assert ('there is room for' if room else 'by the CPU') in crowd.report()['poses']
    covered, covered_exactly = (off(p, p[0, 0]) > 9 for p in (drawn, exact))
    assert 0.7 < covered.sum() / covered_exactly.sum() < 1.4
    if not room:
        assert (off(drawn, exact) > 3).mean() < 2e-3
    pl.close()


def test_the_memory_is_for_the_levels_in_view(monkeypatch):
    """Levels that no member shows take none of it from the others."""
    pl, crowd = crowd_of('smooth')
    exact = shot(pl)
    rows = crowd.groups[0].near.poses[0].needed_rows(COUNT)
    pl.close()
    monkeypatch.setattr('pvibr.figures.posing.pose_budget', lambda: 32 * 1024 * (rows + 0.5))
    pl, crowd = crowd_of('smooth')
    assert off(shot(pl), exact).max() == 0
    assert 'poses' not in crowd.report()
    pl.close()
