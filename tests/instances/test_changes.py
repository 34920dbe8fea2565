"""Changes of meshes and materials after the bake are seen."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr import PvibrWarning
from pvibr.instances.mesh_sources import Sources
from pvibr.meshes.parts import as_parts

POSES = [[0, 0, 0], [1.6, 0, 0.2]]
CAMERA = {'eye': (0.8, -9.0, 3.0), 'focus': (0.8, 0.2, 0.0)}


@pytest.fixture
def beans(scenes, bean):
    """A function that returns a plotter, its instances and the mesh."""

    def make(level='blended', **look):
        mesh = bean.copy()
        look = {'color': 'tan'} | look
        return *scenes.instances(mesh, POSES, level=level, camera=CAMERA, **look), mesh

    return make


def off(scenes, see, pl, mesh, **look):
    """Return by how much a plotter's picture is off from that of meshes, in the mean."""
    truth = see.reduce(see.grab(scenes.actors(mesh, POSES, scale=4, camera=CAMERA, **look)), 4)
    return np.abs(see.grab(pl) - truth).mean() / (truth < 0.99).any(-1).mean()


MATERIALS = {
    'color': {'color': 'blue'},
    'unlit': {'lighting': False},
    'ambient': {'ambient': 0.6, 'diffuse': 0.3},
    'specular': {'specular': 1.0, 'specular_power': 30.0},
}


@pytest.mark.parametrize('change', MATERIALS.values(), ids=MATERIALS)
def test_lights_and_colours_need_no_bake(scenes, see, beans, change, monkeypatch):
    pl, things, mesh = beans(smooth_shading=True)
    see.grab(pl)
    monkeypatch.setattr('pvibr.instances.levels.bake_parts', None)
    for name, value in change.items():
        setattr(things.prop, name, value)
    look = {'color': 'tan', 'smooth_shading': True} | change
    assert off(scenes, see, pl, mesh, **look) < 0.03
    assert 'not baked' not in things.report()['atlas 0']


def test_what_images_do_not_show_is_drawn_as_meshes_until_it_is_as_before(scenes, see, beans):
    pl, things, mesh = beans()
    before = see.grab(pl)
    things.prop.interpolation = 'Gouraud'
    things.prop.opacity = 0.5
    see.grab(pl)
    assert 'material has changed' in things.report()['atlas 0']
    things.prop.interpolation = 'Flat'
    things.prop.opacity = 1.0
    np.testing.assert_array_equal(see.grab(pl), before)
    assert 'not baked' not in things.report()['atlas 0']
    things.prop = pv.Property(color='red')
    assert off(scenes, see, pl, mesh, color='red') < 0.03


def moved(mesh):
    mesh.points[:, 2] *= 1.5


def replaced(mesh):
    mesh.points = mesh.points * [1.0, 1.0, 1.5]


def scalars(mesh):
    mesh['height'] = -mesh['height']


@pytest.mark.sampled
@pytest.mark.parametrize('change', [moved, replaced, scalars])
def test_a_changed_mesh_is_drawn_as_it_is_until_baked_again(scenes, see, beans, change):
    look = {'scalars': 'height', 'color': None} if change is scalars else {}
    pl, things, mesh = beans(**look)
    before = see.grab(pl)
    mesh['other'] = np.arange(mesh.n_points)
    np.testing.assert_array_equal(see.grab(pl), before)
    assert 'not baked' not in things.report()['atlas 0']
    change(mesh)
    look = {'color': 'tan', 'show_scalar_bar': False} | look
    truth = scenes.actors(
        mesh, POSES, camera=CAMERA, **{k: v for k, v in look.items() if k != 'show_scalar_bar'}
    )
    np.testing.assert_allclose(see.grab(pl), see.grab(truth), atol=1.01 / 255)
    assert 'mesh has changed' in things.report()['atlas 0']
    points = np.concatenate([mesh.points + at for at in POSES])
    low_high = np.array(things.bounds).reshape(3, 2)
    np.testing.assert_allclose(low_high.T, [points.min(0), points.max(0)], atol=1e-6)
    if change is moved:
        things.bake()
        assert off(scenes, see, pl, mesh, color='tan') < 0.03
        assert 'not baked' not in things.report()['atlas 0']


def test_blocks_that_come_and_go_in_place(scenes, see):
    older = pv.Cube(center=(0, 0, 1.5))
    blocks = pv.MultiBlock([pv.Cube(), pv.Sphere(center=(0, 0, 2.5))])
    pl, _ = scenes.instances(blocks, POSES, camera=CAMERA, bake=False)
    see.grab(pl)
    for change in (lambda: blocks.pop(0), lambda: blocks.append(older)):
        change()
        truth = scenes.actors(blocks, POSES, camera=CAMERA)
        np.testing.assert_allclose(see.grab(pl), see.grab(truth), atol=1.01 / 255)


def test_a_changed_mesh_has_the_material_that_is_set_later(scenes, see):
    mesh = pv.Sphere()
    pl, things = scenes.instances(mesh, [[0, 0, 0]], bake=False, color='tan', lighting=False)
    see.grab(pl)
    mesh.points *= 0.7
    see.grab(pl)
    things.prop = pv.Property(color='red', lighting=False)
    assert see.grab(pl)[45, 60].tolist() == [1.0, 0.0, 0.0]


def test_a_change_that_cannot_be_shown_is_not_forgotten():
    mesh, made = pv.Sphere(), as_parts(pv.Sphere())

    def parts_of(found):
        if not found.n_points:
            raise LookupError
        return as_parts(found)

    sources = Sources([mesh], parts_of, [made])
    mesh.copy_from(pv.PolyData())
    for _ in range(2):
        with pytest.raises(LookupError):
            sources.changed()
    mesh.copy_from(pv.Cube())
    assert list(sources.changed()) == [0]
    assert not sources.changed()


def test_textures_that_could_not_be_made_are_made_later(scenes, see, beans, monkeypatch):
    def refuse(*_args):
        raise MemoryError

    pl, things, mesh = beans('flat')
    with monkeypatch.context() as patch:
        patch.setattr('pvibr.instances.cards.AtlasTextures.of', refuse)
        with pytest.warns(PvibrWarning, match='is off'):
            see.grab(pl)
    things.enabled = True
    assert off(scenes, see, pl, mesh, color='tan') < 0.05
