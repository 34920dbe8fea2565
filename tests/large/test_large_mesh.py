"""A large mesh looks like the mesh, in whatever it is shown with."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_dilation, binary_erosion, median_filter

import pvibr
from pvibr.large import drawn_surface
from pvibr.large.cut import patches_in_view
from pvibr.things.frame import STEP, Frame
from tests.large.surfaces import blob, terrain
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

SIZE = (320, 240)
EYE = (0.4, -1.0, 0.9)
OVER = {'eye': EYE, 'focus': (0.5, 0.5, 0.0)}
LOOK = {'show_scalar_bar': False}


def drawn(mesh=None, *, view=OVER, size=SIZE, large=True, **kwargs):
    """Return a plotter that shows a mesh, within an error of places, and what was added."""
    pl = plotter(size)
    pl.set_background('magenta')
    mesh = terrain() if mesh is None else mesh
    kwargs = LOOK | kwargs
    if large:
        added = pl.ibr.add_large_mesh(mesh, **{'detail': 'none'} | kwargs)
    else:  # add_mesh stores arrays passed by value in the mesh
        added = pl.add_mesh(mesh.copy(deep=False), **kwargs)
    place(pl, **view)
    pl.show(auto_close=False)
    return pl, added


def pictures(mesh=None, *, max_error=0.0, view=OVER, **kwargs):
    """Return pictures of a large mesh and of the mesh itself."""
    large, thing = drawn(mesh, view=view, max_error=max_error, **kwargs)
    plain, _ = drawn(mesh, view=view, large=False, **kwargs)
    return shot(large), shot(plain), thing


LOOKS = {
    'scalars': {'scalars': 'pattern', 'cmap': 'viridis'},
    'active': {},
    'clim': {'scalars': 'height', 'clim': [-1, 1], 'below_color': 'red', 'above_color': 'white'},
    'few colours': {'scalars': 'height', 'n_colors': 5},
    'one colour': {'color': 'tomato'},
    'smooth': {'color': 'tomato', 'smooth_shading': True},
    'shiny': {'color': 'tomato', 'smooth_shading': True, 'specular': 0.8, 'specular_power': 20},
    'unlit': {'scalars': 'height', 'lighting': False},
    'translucent': {'color': 'tomato', 'opacity': 0.5},
    'culled': {'color': 'tomato', 'culling': 'back'},
    'physically based': {'color': 'tomato', 'pbr': True, 'metallic': 0.5, 'smooth_shading': True},
    'colours': {'scalars': 'colours', 'rgb': True},
    'values': {'scalars': np.linspace(0, 1, terrain().n_points)},
}


def with_colours():
    mesh = terrain().copy()
    shares = (mesh.points - mesh.points.min(0)) / np.ptp(mesh.points, axis=0)
    mesh['colours'] = np.rint(255 * shares).astype(np.uint8)
    mesh.set_active_scalars('height')
    return mesh


@pytest.mark.parametrize('look', LOOKS)
def test_without_error_it_is_the_mesh(look):
    mesh = with_colours() if look == 'colours' else terrain()
    picture, truth, _ = pictures(mesh, **LOOKS[look])
    # Triangles that meet at a pixel's centre are drawn in another order.
    assert (off(picture, truth) > 3).mean() < 2e-3
    assert off(truth, np.full_like(truth, (255, 0, 255))).mean() > 20


@pytest.mark.parametrize('look', LOOKS)
def test_within_a_pixel_it_looks_alike(look):
    mesh = with_colours() if look == 'colours' else terrain()
    picture, truth, thing = pictures(mesh, max_error=1.0, **LOOKS[look])
    assert thing.report()['triangles'] < 0.6 * thing.n_triangles
    assert np.abs(picture - truth).mean() < 12


VIEWS = [
    OVER,
    {'eye': (0.2, 0.1, 0.16), 'focus': (0.5, 0.7, 0.0)},
    {'eye': (2.0, -3.0, 2.0), 'focus': (0.5, 0.5, 0)},
    OVER | {'parallel': 0.4},
]


ERRORS = (0.5, 1.0, 2.0, 4.0)


@pytest.mark.parametrize('make', [terrain, blob])
def test_nothing_shows_through_from_outside(make):
    """Where the mesh covers a pixel and those in reach of the error, no background is seen."""
    look = {'color': 'white', 'lighting': False}
    large, thing = drawn(make(), max_error=1.0, **look)
    plain, _ = drawn(make(), large=False, **look)
    rng = np.random.default_rng(7)
    low, high = np.reshape(make().bounds, (3, 2)).T
    middle, reach, outlines = (low + high) / 2, np.linalg.norm(high - low), 0
    for k in range(20):
        direction = rng.normal(size=3)
        direction[2] = abs(direction[2]) + 0.5
        eye = middle + reach * (0.6 + k / 6) * direction / np.linalg.norm(direction)
        for pl in (large, plain):
            place(pl, eye, middle)
        thing.max_error = ERRORS[k % 4]
        covered, truth = ((shot(pl)[..., 1] > 128) for pl in (large, plain))
        wide = np.ones((2 * int(np.ceil(thing.max_error)) + 3,) * 2)
        inside = binary_erosion(truth, wide, border_value=1)
        assert not (inside & ~covered).any(), k
        outlines += (covered & ~binary_dilation(truth, wide)).sum()
    assert outlines == 0


def test_nothing_shows_through_from_inside():
    """A closed surface covers all that an eye within it sees."""
    pl, thing = drawn(blob(), max_error=1.0, color='white', lighting=False)
    rng, counts = np.random.default_rng(3), set()
    for k in range(20):
        eye, focus = 0.5 * rng.uniform(-1, 1, (2, 3))
        place(pl, eye, focus, angle=(30, 60, 90, 120)[k % 4])
        thing.max_error = ERRORS[k // 4 % 4]
        assert (shot(pl)[..., 1] == 255).all(), k
        counts.add(thing.report()['triangles'])
    assert min(counts) < 0.4 * max(counts)


@pytest.mark.parametrize('view', VIEWS)
def test_from_other_cameras(view):
    picture, truth, thing = pictures(view=view, max_error=0.5, color='white', smooth_shading=True)
    assert thing.report()['triangles'] < thing.n_triangles
    assert np.abs(picture - truth).mean() < 8


def test_nothing_is_gathered_while_nothing_moves():
    pl, thing = drawn(max_error=2.0)
    time = thing.GetMapper().GetInput().GetMTime()
    shot(pl)
    assert thing.GetMapper().GetInput().GetMTime() == time
    place(pl, (0.6, -0.4, 0.5), (0.5, 0.5, 0))
    shot(pl)
    assert thing.GetMapper().GetInput().GetMTime() > time


def test_bounds_are_those_of_the_mesh_before_and_after_a_frame():
    pl = plotter(SIZE)
    thing = pl.ibr.add_large_mesh(terrain(), **LOOK)
    np.testing.assert_allclose(thing.bounds, terrain().bounds, atol=1e-6)
    place(pl, (0.5, 0.5, 0.1), (0.5, 0.6, 0.05))
    pl.show(auto_close=False)
    np.testing.assert_allclose(pl.bounds, terrain().bounds, atol=1e-6)


def test_moved_turned_and_scaled_like_an_actor():
    mesh = terrain()
    pl, thing = drawn(max_error=0.0, color='white')
    other, actor = drawn(large=False, color='white')
    for added in (thing, actor):
        added.position = (0.1, 0.2, -0.1)
        added.scale = (1.5, 1.0, 2.0)
        added.orientation = (0, 20, 40)
    assert (off(shot(pl), shot(other)) > 3).mean() < 2e-3
    np.testing.assert_allclose(thing.bounds, actor.bounds, atol=1e-5)
    thing.max_error = 1.0
    shot(pl)
    assert thing.report()['triangles'] < mesh.n_cells
    thing.scale = 0.0
    shot(pl)
    assert thing.enabled


def test_far_origin_as_at_the_origin():
    mesh = terrain().copy()
    mesh.points = mesh.points * 1000
    far = mesh.copy()
    offset = np.array((500_000.0, 5_000_000.0, 100.0))
    far.points = far.points + offset
    eye, focus = np.array(EYE) * 1000, np.array((500.0, 500.0, 0.0))
    look = {'smooth_shading': True, 'max_error': 1.0}
    here, _ = drawn(mesh, view={'eye': eye, 'focus': focus}, **look)
    there, thing = drawn(far, view={'eye': eye + offset, 'focus': focus + offset}, **look)
    assert (off(shot(here), shot(there)) > 8).mean() < 5e-3
    hit, other = thing.pick(160, 100), here.ibr.pick(160, 100)
    assert hit.index == other.index


def test_scalars_set_anew():
    pl, thing = drawn(max_error=0.0, scalars='height', cmap='viridis')
    thing.set_scalars('pattern')
    other, _ = drawn(large=False, scalars='pattern', cmap='viridis')
    assert (off(shot(pl), shot(other)) > 3).mean() < 2e-3
    thing.set_scalars(terrain()['height'] * 2, clim=(-2, 2))
    other, _ = drawn(large=False, scalars=terrain()['height'] * 2, clim=(-2, 2), cmap='viridis')
    assert (off(shot(pl), shot(other)) > 3).mean() < 2e-3
    refused('one value per point', thing.set_scalars, np.zeros(3), kind=ValueError)
    refused('no array .* added since', thing.set_scalars, 'other', kind=KeyError)


@pytest.mark.parametrize('of', ['point', 'cell'])
@pytest.mark.parametrize('place', ['times', 'huge'])
def test_scalars_that_single_precision_does_not_hold(of, place):
    mesh = terrain()
    values = (mesh if of == 'point' else mesh.cell_centers()).points[:, 2].astype(float)
    precise = {'times': 1.7e9 + values, 'huge': 1e300 * values}[place]
    pl, _ = drawn(max_error=0.0, scalars=precise, show_scalar_bar=False)
    other, _ = drawn(max_error=0.0, scalars=values, show_scalar_bar=False)
    assert (off(shot(pl), shot(other)) > 3).mean() < 2e-3
    pl, _ = drawn(scalars=precise, show_scalar_bar=False)
    other, _ = drawn(scalars=values, show_scalar_bar=False)
    assert (off(shot(pl), shot(other)) > 3).mean() < 2e-3


@pytest.mark.parametrize(
    'look',
    [
        {'scalars': 'height'},
        {'scalars': np.arange(64_082)},
        {'scalars': 'vectors'},
        {'scalars': 'vectors', 'component': 1},
        {'scalars': np.zeros((32_400, 3))},
    ],
)
def test_bar_has_the_title_of_add_mesh(look):
    mesh = terrain().copy()
    mesh['vectors'] = np.asarray(mesh.points)
    titles = []
    for large in (True, False):
        pl, _ = drawn(mesh, large=large, show_scalar_bar=True, **look)
        titles.append([*pl.scalar_bars.keys()])
    assert titles[0] == titles[1]


def test_scalar_bar_and_its_range():
    pl, thing = drawn(scalars='height', show_scalar_bar=True)
    assert list(pl.scalar_bars.keys()) == ['height']
    pl.update_scalar_bar_range((-5, 5))
    changed = shot(pl)
    other, _ = drawn(large=False, scalars='height', clim=(-5, 5), show_scalar_bar=True)
    assert thing.mapper.scalar_range == (-5, 5)
    assert np.abs(changed - shot(other)).mean() < 12
    thing.set_scalars('pattern')
    assert list(pl.scalar_bars.keys()) == ['pattern']


def test_clipped_like_the_mesh():
    pl, thing = drawn(max_error=0.0, color='white')
    other, actor = drawn(large=False, color='white')
    for added in (thing, actor):
        plane = pv.Plane(center=(0.5, 0.5, 0), direction=(1, 0.3, 0))
        added.mapper.SetClippingPlanes(_planes((0.5, 0.5, 0), (1, 0.3, 0)))
        assert plane.n_cells
    assert (off(shot(pl), shot(other)) > 3).mean() < 4e-3
    column = 60
    assert thing.pick(column, 100) is None


def _planes(origin, normal):
    plane = pvibr.core._vtk.vtkPlane()
    plane.SetOrigin(origin)
    plane.SetNormal(normal)
    planes = pvibr.core._vtk.vtkPlaneCollection()
    planes.AddItem(plane)
    return planes


def test_picks_the_cell_of_the_mesh():
    mesh = terrain()
    pl, thing = drawn(max_error=8.0)
    assert thing.report()['triangles'] < 0.2 * mesh.n_cells
    for x, y in ((160, 120), (60, 90), (250, 60)):
        hit = pl.ibr.pick(x, y)
        pl.renderer.SetDisplayPoint(x, y, 0)
        start = np.array(pl.camera.position)
        end = start + 2 * (np.array(hit.point) - start)
        point, cells = mesh.ray_trace(start, end)
        assert hit.index in cells[:2]
        assert np.linalg.norm(point - hit.point, axis=1).min() < 1e-4
    assert pl.ibr.pick(5, 235) is None
    thing.pickable = False
    assert pl.ibr.pick(160, 120) is None


def test_picks_the_cells_of_quads_and_grids():
    grid = pv.ImageData(dimensions=(150, 150, 1), spacing=(1 / 149,) * 3)
    pl, thing = drawn(grid, max_error=4.0, color='white')
    hit = pl.ibr.pick(160, 100)
    column, row = (int(c * 149) for c in hit.point[:2])
    assert hit.index == 149 * row + column
    assert thing.n_triangles == 2 * grid.n_cells


def test_each_subplot_has_a_cut_of_its_own():
    pl = plotter((2 * SIZE[0], SIZE[1]), shape=(1, 2), border=False)
    things = []
    for column, eye in enumerate((EYE, (3, -7, 6))):
        pl.subplot(0, column)
        things.append(pl.ibr.add_large_mesh(terrain(), **LOOK))
        place(pl, eye, (0.5, 0.5, 0))
    pl.show(auto_close=False)
    near, far = (thing.report()['triangles'] for thing in things)
    assert far < 0.6 * near


def test_coarser_while_it_moves_and_exact_at_rest():
    pl, thing = drawn(max_error=1.0, scalars='height')
    at_rest = thing.report()['triangles']
    view = pl.ibr.pipeline.view()
    moving = replace(view, quality=0.25)
    thing.prepare(moving)
    assert thing.report()['error'] == pytest.approx(4 * STEP, abs=1e-3)
    assert thing.report()['triangles'] < 0.6 * at_rest
    assert not thing.refined
    thing.moving = 0
    thing.prepare(moving)
    assert thing.report()['triangles'] == at_rest
    assert thing.refined


def test_least_frame_time_applies():
    pl, thing = drawn()
    assert pl.ibr._frame_ms(pl.ibr._all_effects()) == 100
    thing.moving = 40
    assert pl.ibr._frame_ms(pl.ibr._all_effects()) == 40
    pl.ibr.interactive_frame_ms = 20
    assert pl.ibr._frame_ms(pl.ibr._all_effects()) == 20
    thing.moving, pl.ibr.interactive_frame_ms = 0, 0
    assert pl.ibr._frame_ms(pl.ibr._all_effects()) == 0


def test_cut_as_data():
    _, thing = drawn(max_error=1.0, scalars='height')
    coarse, fine = thing.cut(), thing.cut(max_error=0.25)
    assert coarse.n_cells == thing.report()['triangles']
    assert fine.n_cells > coarse.n_cells
    assert coarse.array_names == ['height', 'Normals']
    thing.position = (0, 0, 3)
    assert thing.cut().bounds[4] > 2
    thing.remove()
    refused('must be in a plotter', thing.cut, kind=RuntimeError)


def test_shadows_are_given_and_received():
    def scene(*, large):
        pl = plotter(SIZE)
        pl.remove_all_lights()
        pl.add_light(
            pv.Light(position=(3, 1, 1.0), focal_point=(0.5, 0.5, 0), light_type='scene light')
        )
        add = pl.ibr.add_large_mesh if large else pl.add_mesh
        extra = {'max_error': 1.0} if large else {}
        add(terrain(), color='white', smooth_shading=True, **extra, **LOOK)
        pl.add_mesh(pv.Sphere(radius=0.08, center=(0.5, 0.4, 0.25)), color='red')
        pl.ibr.add(pvibr.Shadows())
        place(pl, **OVER)
        pl.show(auto_close=False)
        return shot(pl), pl

    (picture, pl), (truth, _) = scene(large=True), scene(large=False)
    assert np.abs(picture - truth).mean() < 12
    assert _specks(picture) < 1.3 * _specks(truth), 'it casts shadows on itself where it is lit'
    np.testing.assert_array_equal(shot(pl), picture)


SPOT = {'position': (2, 1, 1.5), 'focal_point': (0.5, 0.5, 0), 'cone_angle': 30}


@pytest.mark.parametrize(
    'add',
    [
        lambda pl: pl.enable_shadows(),
        lambda pl: pl.ibr.add(pvibr.Shadows(method='pcf')),
        lambda pl: pl.ibr.add(pvibr.Outline()),
        lambda pl: pl.ibr.add(pvibr.AmbientOcclusion()),
        lambda pl: pl.ibr.add(pvibr.DepthOfField()),
    ],
    ids=['shadows of VTK', 'shadows', 'outlines', 'occlusion', 'lens'],
)
def test_effects_see_it_as_the_mesh(add):
    shots, mesh = [], terrain()
    for large in (True, False):
        pl = plotter(SIZE)
        pl.remove_all_lights()
        pl.add_light(pv.Light(light_type='scene light', positional=True, **SPOT))
        options = {'max_error': 0.0} if large else {}
        adding = pl.ibr.add_large_mesh if large else pl.add_mesh
        adding(mesh, color='white', smooth_shading=True, **options, **LOOK)
        pl.add_mesh(pv.Sphere(radius=0.08, center=(0.5, 0.4, 0.25)), color='red')
        add(pl)
        place(pl, **OVER)
        pl.show(auto_close=False)
        shots.append(shot(pl))
        assert {row.state for row in pl.ibr.report().rows} <= {'ran'}
    assert (off(*shots) > 12).mean() < 0.02


@pytest.mark.parametrize('name', ['depth', 'normal'])
def test_buffers_are_those_of_the_mesh(name):
    found = []
    for large in (True, False):
        options = {'max_error': 0.0} if large else {}
        pl, _ = drawn(large=large, color='white', smooth_shading=True, **options)
        found.append(np.asarray(pl.ibr.buffer(name), float))
    is_here = np.isfinite(found[0]) & np.isfinite(found[1])
    np.testing.assert_array_equal(np.isfinite(found[0]), np.isfinite(found[1]))
    difference = np.abs(np.where(is_here, found[0], 0) - np.where(is_here, found[1], 0))
    assert difference.mean() < 1e-3


def test_exported_as_the_mesh_of_the_view(tmp_path):
    pl, thing = drawn(max_error=2.0, scalars='height')
    pl.export_gltf(str(tmp_path / 'it.gltf'))
    found = pv.read(tmp_path / 'it.gltf').combine()
    assert found.n_cells == thing.report()['triangles']


def _specks(picture):
    """Return the number of dark pixels in bright surroundings."""
    light = picture.mean(-1)
    around = median_filter(light, 7)
    return ((light < 0.4 * around) & (around > 60)).sum()


REFUSED = {
    'no array': (KeyError, 'has no array', {'scalars': 'nothing'}),
    'component': (ValueError, 'component', {'scalars': 'vectors', 'component': 3}),
    'rgb of numbers': (ValueError, 'colours of shape', {'scalars': 'height', 'rgb': True}),
    'texture': (TypeError, 'pyvista.Texture', {'texture': 'a.png'}),
    'style': (TypeError, 'prop.style', {'style': 'wireframe'}),
    'sharp edges': (TypeError, 'smooth_shading=False', {'split_sharp_edges': True}),
    'negative': (ValueError, 'max_error', {'max_error': -1}),
    'part': (ValueError, r'part must be an index and a count', {'part': 3}),
    'part beyond': (ValueError, r'part\[0\]', {'part': (4, 4)}),
    'opacity': (ValueError, 'opacity', {'opacity': 2}),
    'opacities': (ValueError, 'Opacity', {'opacity': 'nothing', 'scalars': 'height'}),
    'rgb alone': (ValueError, 'rgb', {'rgb': True, 'color': 'red'}),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_it_does_not_draw_is_refused(case):
    kind, text, kwargs = REFUSED[case]
    mesh = terrain().copy()
    mesh['vectors'] = np.zeros((mesh.n_points, 3))
    mesh.set_active_scalars('height')
    pl = plotter(SIZE)
    with pytest.raises(kind, match=text):
        pl.ibr.add_large_mesh(mesh, **kwargs)
    assert pl.ibr.effects == ()


@pytest.mark.parametrize(
    ('mesh', 'text'),
    [
        (pv.PolyData(np.zeros((3, 3))), 'triangles'),
        (pv.PolyData(), 'points'),
        (pv.MultiBlock([pv.PolyData()]), 'no block'),
        (7, 'int'),
        (pv.Line(), 'triangles'),
    ],
)
def test_what_is_no_mesh_is_refused(mesh, text):
    with pytest.raises((TypeError, ValueError), match=text):
        plotter(SIZE).ibr.add_large_mesh(mesh)


def test_report_names_meshes_that_could_be_one(monkeypatch):
    monkeypatch.setattr('pvibr.core.plotters._HEAVY', 50_000)
    pl, _ = drawn(large=False, name='ground')
    pl.add_points(np.zeros((3, 3)))
    assert pl.ibr.report().large_meshes == {'ground': terrain().n_cells}
    assert 'ground: 64,082 cells; add_large_mesh' in str(pl.ibr.report())
    pl.ibr.add_large_mesh(terrain(), name='ground', max_error=0.0, **LOOK)
    pl.render()
    assert pl.ibr.report().large_meshes == {}


def test_triangles_are_counted_once_a_frame_where_it_is_asked(monkeypatch):
    counted = []

    def count(*args):
        counted.append(args)
        return patches_in_view(*args)

    monkeypatch.setattr(drawn_surface, 'patches_in_view', count)
    pl, thing = drawn(detail='normals')
    for _ in range(3):
        pl.render()
    triangles = thing.triangles_of(Frame.of(pl.renderer))
    assert not counted
    assert triangles(0.25) < triangles(1.0)
    assert len(counted) == 1
