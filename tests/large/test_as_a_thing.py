"""A large mesh is a thing like any other, with all of its attributes."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.visibility.surface_samples import surfaces_of
from tests.large.looks import NEAR, OVER, SIZE, drawn, pictures
from tests.large.surfaces import terrain
from tests.large.test_cell_values import with_cells
from tests.large.textured import charts, checks, globe
from tests.pictures import off, place, plotter, shot

BALL = {'eye': (3, -1.2, 1.4), 'focus': (0, 0, 0)}
SPOT = {'position': (2, 1, 1.5), 'focal_point': (0.5, 0.5, 0), 'cone_angle': 30}
WAYS = ('hard', 'pcf', 'pcss', 'vsm', 'volume')


def lit(add, *, large, mesh=None, **look):
    """Return a plotter with a spot on a ground and a ball over it."""
    pl = plotter(SIZE)
    pl.remove_all_lights()
    pl.add_light(pv.Light(light_type='scene light', positional=True, **SPOT))
    look = {'show_scalar_bar': False, 'smooth_shading': True} | look
    adding = pl.ibr.add_large_mesh if large else pl.add_mesh
    added = adding(terrain() if mesh is None else mesh, **look)
    pl.add_mesh(pv.Sphere(radius=0.08, center=(0.5, 0.4, 0.25)), color='red')
    add(pl)
    place(pl, **OVER)
    pl.show(auto_close=False)
    assert {row.state for row in pl.ibr.report().rows} <= {'ran'}
    return pl, added


@pytest.mark.parametrize('look', ['values of cells', 'image'])
@pytest.mark.parametrize('way', WAYS)
def test_shadows_are_those_of_the_mesh(way, look):
    mesh, look = {
        'values of cells': (with_cells(), {'scalars': 'kind'}),
        'image': (charts(), {'texture': pv.Texture(checks()), 'smooth_shading': False}),
    }[look]

    def add(pl):
        pl.ibr.add(pvibr.Shadows(method=way))

    large, _ = lit(add, large=True, mesh=mesh, max_error=0, **look)
    plain, _ = lit(add, large=False, mesh=mesh, **look)
    assert (off(shot(large), shot(plain)) > 24).mean() < 0.02
    assert (
        off(shot(large), shot(lit(lambda pl: None, large=False, mesh=mesh, **look)[0])) > 24
    ).mean() > 0.02


def test_shadow_volumes_are_cast_by_what_is_drawn():
    def dark(pl):
        return (shot(pl).mean(-1) < 8).mean()

    def add(pl):
        pl.ibr.add(pvibr.Shadows(method='volume'))

    look = {'color': 'white', 'smooth_shading': False}
    large, thing = lit(add, large=True, max_error=0.5, **look)
    plain, _ = lit(add, large=False, **look)
    without, _ = lit(lambda pl: None, large=False, **look)
    assert dark(large) == pytest.approx(dark(plain), rel=0.25)
    assert dark(without) < 0.8 * dark(plain)
    row = next(row for row in large.ibr.report().rows if row.effect == 'Shadows')
    assert row.details['casters without volume'] == 0
    thing.position = (0, 0, 5)
    assert thing.solids()[0].GetBounds()[4] > 4


@pytest.mark.parametrize('max_error', [0.0, 1.0])
def test_photographs_are_projected_on_it(max_error):
    def add(pl):
        camera = pv.Camera()
        camera.position, camera.focal_point, camera.up = (0.5, 0.2, 1.6), (0.5, 0.5, 0), (0, 1, 0)
        pl.ibr.add(pvibr.Projector(checks(), camera, occlusion=True))

    look = {'color': 'white', 'lighting': False}
    large, _ = lit(add, large=True, max_error=max_error, **look)
    plain, _ = lit(add, large=False, **look)
    assert (off(shot(large), shot(plain)) > 40).mean() < (0.02 if max_error else 0.005)


def test_what_is_hit_has_the_value_that_is_seen():
    mesh = with_cells()
    look = {'scalars': 'kind', 'cmap': 'viridis', 'lighting': False, 'view': NEAR}
    pl, thing = drawn(mesh, **look)
    picture, table = shot(pl), thing.mapper.lookup_table
    for x in range(40, 300, 40):
        hit = pl.ibr.pick(x, 60)
        color = np.array(table.map_value(mesh.cell_data['kind'][hit.index])[:3])
        assert (
            np.abs(picture[SIZE[1] - 1 - 60, x] / 255 - color / max(color.max(), 1)).max() < 0.02
        )
    ids = pl.ibr.buffer('id')
    assert pl.ibr.buffer_objects[ids[SIZE[1] - 1 - 60, 160]] is thing


LOOKS = {
    'cells': (with_cells, OVER, {'scalars': 'wave'}),
    'edges': (with_cells, NEAR, {'scalars': 'wave', 'show_edges': True}),
    'image': (globe, BALL, {'texture': 'checks'}),
}


def with_textures(look):
    return look | ({'texture': pv.Texture(checks())} if 'texture' in look else {})


@pytest.mark.parametrize('look', LOOKS)
def test_translucent_clipped_and_peeled(look):
    make, view, look = LOOKS[look]
    look = with_textures(look)

    def shown(*, large):
        pl, added = drawn(make(), view=view, large=large, opacity=0.5, max_error=0, **look)
        plane, planes = pvibr.core._vtk.vtkPlane(), pvibr.core._vtk.vtkPlaneCollection()
        plane.SetOrigin(added.center)
        plane.SetNormal(1, 0.3, 0)
        planes.AddItem(plane)
        added.mapper.SetClippingPlanes(planes)
        pl.enable_depth_peeling()
        return shot(pl)

    assert (off(shown(large=True), shown(large=False)) > 12).mean() < 0.01


@pytest.mark.parametrize('look', ['cells', 'image'])
def test_exports_look_like_it(look, tmp_path):
    make, view, look = LOOKS[look]
    pl, thing = drawn(make(), view=view, **with_textures(look))
    copy = pl.ibr.to_plain_plotter()
    place(copy, **view)
    copy.show(auto_close=False)
    assert np.abs(shot(copy) - shot(pl)).mean() < 6
    pl.ibr.export_glb(tmp_path / 'it.glb')
    found = pv.read(tmp_path / 'it.glb').combine()
    assert found.n_cells == thing.report()['triangles']


def test_state_files(tmp_path):
    pl, thing = drawn(terrain(), name='ground', max_error=2.0, moving=40)
    thing.visibility = False
    pl.ibr.save_state(tmp_path / 'state.json')
    other, found = drawn(terrain(), name='ground')
    other.ibr.load_state(tmp_path / 'state.json')
    assert (found.max_error, found.moving, found.visibility) == (2.0, 40.0, False)
    assert other.ibr.state() == pl.ibr.state()


def test_instances_stand_on_it_in_daylight():
    def scene(*, large):
        pl = plotter(SIZE)
        adding = pl.ibr.add_large_mesh if large else pl.add_mesh
        options = {'max_error': 0.5} if large else {}
        adding(terrain(), color='tan', smooth_shading=True, **options)
        places = np.asarray(terrain().points)[:: terrain().n_points // 40]
        tree = pv.Cone(direction=(0, 0, 1), height=0.08, radius=0.02, center=(0, 0, 0.04))
        pl.ibr.add_instances(tree, places, color='green')
        pl.ibr.look('daylight')
        place(pl, **OVER)
        pl.show(auto_close=False)
        assert {row.state for row in pl.ibr.report().rows} <= {'ran', 'skipped'}
        return shot(pl)

    picture, truth = scene(large=True), scene(large=False)
    assert np.abs(picture - truth).mean() < 10
    assert np.abs(picture.mean((0, 1)) - truth.mean((0, 1))).max() < 3


def test_rays_meet_it():
    _, thing = drawn(terrain(), max_error=0)
    (surface,) = surfaces_of([thing])
    assert surface.n_cells == terrain().n_cells
    np.testing.assert_allclose(surface.bounds, terrain().bounds, atol=1e-5)


def test_taken_out_added_again_and_shown_twice():
    image = pv.Texture(checks())
    first, thing = drawn(globe(), view=BALL, texture=image, max_error=0)
    picture = shot(first)
    thing.remove()
    first.ibr.add(thing)
    np.testing.assert_array_equal(shot(first), picture)
    second, _ = drawn(globe(), view=BALL, texture=image, max_error=0)
    first.close()
    np.testing.assert_array_equal(shot(second), picture)


def test_far_origin_with_cells_and_images():
    offset = np.array((500_000.0, 5_000_000.0, 100.0))
    for make, view, look in (LOOKS['cells'], LOOKS['image']):
        far = make().copy()
        far.points = 1000 * np.asarray(far.points, float) + offset
        near = make().copy()
        near.points = 1000 * np.asarray(near.points, float)
        shots = []
        for mesh, shift in ((near, np.zeros(3)), (far, offset)):
            own_view = {k: 1000 * np.array(v) + shift for k, v in view.items()}
            shots.append(shot(drawn(mesh, view=own_view, **with_textures(look))[0]))
        assert (off(*shots) > 24).mean() < 0.01


def test_parallel_projection():
    make, _, look = LOOKS['edges']
    view = {'eye': (0.5, 0.5, 2), 'focus': (0.5, 0.5, 0), 'parallel': 0.06}
    picture, truth, _ = pictures(make(), view=view, **look)
    assert (off(picture, truth) > 24).mean() < 0.03
