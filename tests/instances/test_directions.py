"""Levels follow the direction from which each instance is seen."""

from itertools import pairwise

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.instances.card_layers import PATCH_SIDE, PATCHES
from pvibr.instances.cards import ALL_CARD_SHADERS
from pvibr.instances.limits import SIDE_SHADERS, Limits, limits_of
from pvibr.maths import octahedral
from pvibr.things.frame import Frame

SIDE = 9
COLORS = {
    'flat': (1.0, 0.0, 0.0),
    'blended': (0.0, 1.0, 0.0),
    'mesh': (0.0, 0.0, 1.0),
    'lighter mesh': (1.0, 0.0, 1.0),
}
SIZE = 10.0  # px on the screen, about


def limits(first, second):
    """Return limits by which patches show flat cards, blended ones or meshes at SIZE."""
    ends = np.array([[2, 2, 0.5], [0.5, 2, 2], [0.5, 0.5, 0.5], [0.5, 0.5, 2]]) * SIZE
    rng = np.random.default_rng([first, second])
    flat, blended, lighter = ends[rng.permuted(np.arange(PATCHES) % 4)].T
    zero = np.zeros(PATCHES)
    cards = {
        'splat': np.stack([zero, zero]),
        'flat': np.stack([zero, flat]),
        'parallax': np.stack([flat, flat]),
        'blended': np.stack([flat, blended]),
    }
    meshes = np.where(lighter > SIZE, 'lighter mesh', 'mesh')
    names = np.where(flat > SIZE, 'flat', np.where(blended > SIZE, 'blended', meshes))
    return Limits(cards, blended, np.stack([np.full(PATCHES, np.inf), lighter])), names


@pytest.mark.sampled
@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('kind', ['turned', 'mirrored', 'sheared', 'points'])
@pytest.mark.parametrize('views', ['full', 'half'])
def test_each_has_the_level_of_its_direction(scenes, see, kind, views, parallel, monkeypatch):
    rng = np.random.default_rng(len(kind))
    poses = np.tile(np.eye(4), (SIDE * SIDE, 1, 1))
    if kind != 'points':
        turns = Rotation.random(len(poses), random_state=3).as_matrix()
        poses[:, :3, :3] = turns * ([1, 1, -1] if kind == 'mirrored' else 1)
    if kind == 'sheared':
        poses[:, :3, :3] = turns @ (np.eye(3) + rng.uniform(-0.2, 0.2, (3, 3)))
    grid = (np.stack(np.meshgrid(*2 * [np.arange(SIDE)]), -1).reshape(-1, 2) - SIDE / 2 + 0.5) * 2
    poses[:, :2, 3] = grid
    where = {'eye': (3.0, -2.0, 25.0), 'angle': 54.0, 'parallel': 1.4 * SIDE if parallel else None}
    pl, things = scenes.instances(
        pv.Sphere(theta_resolution=20, phi_resolution=20),
        poses[:, :3, 3] if kind == 'points' else poses,
        views=views,
        lighting=False,
        size=(20 * SIDE, 20 * SIDE),
        camera=where,
    )
    direction = np.array([3.0, -2.0, 25.0])
    toward = direction - (0 if parallel else poses[:, :3, 3])
    toward = np.broadcast_to(toward, (len(poses), 3))
    seen = np.linalg.solve(poses[:, :3, :3], toward[..., None])[..., 0]
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    patches, inside = octahedral.cells(seen, PATCH_SIDE, views == 'half')
    group = things.groups[0]
    group.tint(COLORS)
    chosen, names = limits(len(views), len(kind))
    monkeypatch.setattr(group.model, 'limits', lambda *_: chosen)
    image, frame = see.grab(pl), Frame.of(pl.renderer)
    sure = inside > 1e-3
    assert sure.sum() > (0.4 if kind == 'points' else 0.9) * len(poses)
    sure &= (views == 'full') | (seen[:, 2] > 0)  # half of the views do not show it from below
    assert kind == 'points' or len(set(names[patches[sure]])) == 4
    view, clip = frame.view_from_world, frame.clip_from_view
    places = np.column_stack([poses[sure, :3, 3], np.ones(sure.sum())]) @ (clip @ view).T
    x, y = (10 * SIDE * (places[:, :2] / places[:, 3:] * [1, -1] + 1)).astype(int).T
    found = image[y, x]
    expected = np.array([COLORS[name] for name in names[patches[sure]]])
    np.testing.assert_allclose(found, expected, atol=0.02)
    pl.close()


@pytest.mark.parametrize('seed', [0, 1])
def test_a_plant_is_an_image_as_far_as_each_direction_allows(seed):
    rng, sizes = np.random.default_rng(seed), np.array([8.0, 16, 32, 64, 128])
    errors = {'sizes': sizes}
    for shader in ALL_CARD_SHADERS:
        flip = rng.uniform(0.5, 2.5, PATCHES) * sizes[:, None] / 128
        errors[shader.name] = np.stack([0 * flip, flip, 0 * flip + 0.9, 0 * flip], -1)
    found = limits_of(errors, 1, 1.0)
    # The worst direction alone decides where a turntable serves, which has others of its own.
    image = {k: v for k, v in errors.items() if k not in SIDE_SHADERS}
    assert np.array_equal(found.mesh_from, limits_of(image, 1, 1.0).mesh_from)
    assert np.ptp(found.mesh_from) > 10
    spans = list(found.side_cards.values())
    for (_, high), (low, _) in pairwise(spans):
        assert np.array_equal(high, low)
    assert np.array_equal(spans[-1][1], found.mesh_from)
    assert (spans[0][0] == 0).all()
    assert all(
        np.ptp(found.side_cards[name], axis=1).max() < np.ptp(found.mesh_from)
        for name in SIDE_SHADERS
    )
    low, high = found.varying
    assert high == max(span[1].max() for span in spans if np.ptp(span[1]))


def test_an_export_has_lighter_meshes_where_they_serve_from_everywhere(scenes, bean):
    far = {'eye': (0.0, -60.0, 9.0), 'focus': (0.0, 0.0, 0.0)}
    pl, beans = scenes.instances(bean, [[x, 0, 0] for x in range(4)], size=(200, 150), camera=far)
    pl.render()
    full = beans.groups[0].model.levels[0].triangles
    assert len(beans.groups[0].model.levels) > 1
    made = pl.ibr.to_plain_plotter()
    counts = [actor.mapper.dataset.n_cells for actor in made.actors.values()]
    assert 0 < sum(counts) < 4 * full
    made.close()
    pl.close()
