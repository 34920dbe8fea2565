"""What is baked is what VTK shows, and what no image can show is drawn as meshes."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk
from pvibr.instances.atlas import MARGIN
from pvibr.instances.bake import bake_parts
from pvibr.instances.levels import content_key
from pvibr.maths.octahedral import frame
from pvibr.meshes.parts import as_parts
from tests.instances.test_bake import tiles
from tests.meshes.test_parts import IMAGE
from tests.pictures import grab

VIEWS, TILE = 3, 64


def prism(sides=6):
    """Return a closed prism with a normal at each point, as if it were round."""
    return pv.Cylinder(resolution=sides, capping=True).triangulate().compute_normals()


def bowl():
    """Return an open surface with texture coordinates and arrays of points and cells."""
    ball = pv.Sphere(theta_resolution=24, phi_resolution=24).texture_map_to_sphere()
    ball.active_texture_coordinates = ball.active_texture_coordinates * 2.5
    bowl = ball.clip('z', invert=False, origin=(0, 0, -0.1)).extract_surface(algorithm=None)
    bowl['height'] = bowl.points[:, 0] + 0.3 * bowl.points[:, 1]
    bowl['height'][::40] = np.nan
    bowl.cell_data['cells'] = np.sin(np.arange(bowl.n_cells) * 0.7)
    bowl['paint'] = (np.abs(bowl.points) * 500).clip(0, 255).astype(np.uint8)
    bowl.set_active_scalars(None)
    return bowl


def repeated(repeat):
    texture = pv.Texture(IMAGE)
    texture.repeat = repeat
    return texture


LOOKS = {
    'color': {'color': 'orange'},
    'back faces': {'color': 'w', 'backface_params': {'color': 'red'}},
    'backs culled': {'color': 'w', 'culling': 'back'},
    'fronts culled': {'color': 'w', 'culling': 'front'},
    'scalars': {'scalars': 'height', 'clim': (-0.3, 0.4), 'nan_color': 'lime', 'n_colors': 7},
    'beyond': {'scalars': 'height', 'clim': (-0.2, 0.2), 'below_color': 'b', 'above_color': 'r'},
    'mapped after': {'scalars': 'height', 'interpolate_before_map': False, 'cmap': 'prism'},
    'mapped before': {'scalars': 'height', 'interpolate_before_map': True, 'cmap': 'prism'},
    'cells': {'scalars': 'cells', 'cmap': 'viridis'},
    'rgb': {'scalars': 'paint', 'rgb': True},
    'repeated': {'texture': repeated(True)},
    'clamped': {'texture': repeated(False)},
}


def shown(atlas, row, column, meshes, **look):
    """Return colour times coverage, and coverage, that VTK draws unlit in a view of the grid."""
    _, up, toward = frame(atlas.directions()[row, column])
    samples = 8
    pl = pv.Plotter(off_screen=True, window_size=(TILE * samples,) * 2, lighting='none')
    pl.disable_anti_aliasing()
    for mesh in meshes:
        pl.add_mesh(mesh, lighting=False, show_scalar_bar=False, **look)
    pl.camera.position = atlas.center + 5 * atlas.radius * toward
    pl.camera.focal_point, pl.camera.up = atlas.center, up
    pl.camera.parallel_projection, pl.camera.parallel_scale = True, atlas.radius * MARGIN
    pl.renderer.ResetCameraClippingRange()
    pictures = []
    for ground in ('black', 'white'):
        pl.set_background(ground)
        picture = grab(pl)[::-1]
        pictures.append(picture.reshape(TILE, samples, TILE, samples, 3).mean((1, 3)))
    pl.close()
    dark, light = pictures
    return dark, 1 - (light - dark).mean(-1)


@pytest.mark.sampled
@pytest.mark.parametrize('look', LOOKS.values(), ids=LOOKS)
def test_colours_are_those_that_vtk_draws(look):
    mesh = bowl()
    atlas = bake_parts(as_parts(mesh, **look), views=VIEWS, tile=TILE, supersample=8)
    albedo, geometry = tiles(atlas.albedo, atlas), tiles(atlas.geometry, atlas)
    for row, column in ((0, 0), (1, 1), (1, 2)):  # of the outside, and of the inside
        color, coverage = shown(atlas, row, column, [mesh], **look)
        assert np.abs(geometry[row, column, ..., 1] - coverage).mean() < 2e-3
        assert np.abs(albedo[row, column, ..., :3] - color).mean() < 2e-3


def faces_of(atlas):
    """Return the normals of texels within faces, off the edges."""
    geometry, albedo = tiles(atlas.geometry, atlas), tiles(atlas.albedo, atlas)
    normals = np.concatenate([geometry[..., 2:], albedo[..., 3:]], -1) * 2 - 1
    normals = normals[geometry[..., 1] > 0.999]
    return normals[np.linalg.norm(normals, axis=1) > 0.99]


def test_flat_faces_stay_flat_although_points_have_normals():
    mesh = prism()
    atlas = bake_parts(as_parts(mesh), views=6, tile=TILE)
    truth = np.unique(np.round(mesh.compute_normals(point_normals=False)['Normals'], 6), axis=0)
    found = faces_of(atlas)
    assert len(truth) == 8
    assert np.quantile((found @ truth.T).max(1), 0.02) > 0.995
    smooth = faces_of(bake_parts(as_parts(mesh, smooth_shading=True), views=6, tile=TILE))
    assert np.quantile((smooth @ truth.T).max(1), 0.02) < 0.95


def plane(origin, normal):
    made = _vtk.vtkPlane()
    made.SetOrigin(origin)
    made.SetNormal(normal)
    return made


def test_clipping_planes_of_an_actor_cut_what_is_baked_and_drawn():
    pl = pv.Plotter(off_screen=True)
    actor = pl.add_mesh(pv.Sphere(), color='w')
    actor.position = (0, 0, 1)
    whole = as_parts(actor)
    actor.mapper.AddClippingPlane(plane((0, 0, 1.2), (0, 0, 1)))
    parts = as_parts(actor)
    pl.close()
    assert parts[0].mesh.bounds.z_min == pytest.approx(1.2)
    assert parts[0].actor.mapper.dataset is parts[0].mesh
    assert actor.mapper.GetClippingPlanes().GetNumberOfItems() == 1
    assert parts[0].actor.mapper.GetClippingPlanes().GetNumberOfItems() == 0
    assert content_key(parts) != content_key(whole)
    actor.mapper.AddClippingPlane(plane((0, 0, 0), (0, 0, -1)))
    with pytest.raises(ValueError, match='clipped away'):
        as_parts(actor)


POSES = np.array([[0.0, 0, 0], [1.4, 0, 0.2], [0, 2, 0]])
CAMERA = {'eye': (0.5, -7.0, 3.0), 'focus': (0.5, 0.5, 0.0)}


def with_lines():
    mesh = pv.Sphere(theta_resolution=12, phi_resolution=12)
    mesh.lines = [2, 0, 60, 2, 10, 100]
    return mesh


MORE = {
    'edges': (pv.Cylinder(resolution=6), {'show_edges': True}, 'edges'),
    'wireframe': (pv.Cylinder(resolution=6), {'style': 'wireframe'}, 'wireframe'),
    'points': (pv.Sphere(), {'style': 'points', 'smooth_shading': True}, 'points'),
    'flat points': (prism(), {'style': 'points', 'point_size': 6}, 'points'),
    'lines': (with_lines(), {'line_width': 3}, 'lines'),
    'only lines': (pv.Spline(prism().points, 40), {'line_width': 2}, 'lines'),
    'only points': (pv.PolyData(prism().points), {'point_size': 6}, 'vertices'),
    'material of backs': (
        pv.Plane(),
        {'backface_params': {'color': 'red', 'ambient': 0.5}},
        'back faces',
    ),
}


@pytest.mark.parametrize(('mesh', 'look', 'why'), MORE.values(), ids=MORE)
def test_what_images_cannot_show_is_drawn_as_meshes(scenes, see, mesh, look, why):
    pl, things = scenes.instances(mesh, POSES, camera=CAMERA, **look)
    drawn = see.grab(pl)
    assert 'not baked: ' in things.report()['atlas 0']
    assert why in things.report()['atlas 0']
    pl.close()
    plain = see.grab(scenes.actors(mesh, POSES, camera=CAMERA, **look))
    assert np.ptp(plain) > 0
    np.testing.assert_allclose(drawn, plain, atol=1.01 / 255)


@pytest.mark.parametrize('mesh', [MORE['only lines'][0], MORE['only points'][0]])
def test_lines_and_points_are_picked_where_they_are_seen(scenes, see, mesh):
    pl, things = scenes.instances(mesh, POSES, camera=CAMERA, line_width=2, point_size=2)
    picture = pl.screenshot()
    rows, columns = np.nonzero((picture != picture[0, 0]).any(-1))
    hit = pl.ibr.pick(int(columns[0]), len(picture) - 1 - int(rows[0]))
    missed = pl.ibr.pick(1, 1)
    assert hit is not None
    assert hit.index in range(len(things))
    assert missed is None


def with_arrays(**arrays):
    ball = pv.Sphere(theta_resolution=9, phi_resolution=9)
    for name, values in arrays.items():
        ball[name] = values(ball.points)
    return ball


def height(points):
    return points[:, 2]


def same(points):
    return points


BARS = {
    'active': (with_arrays(h=height), {}, ['h']),
    'colour': (with_arrays(h=height), {'color': 'red'}, []),
    'vectors': (with_arrays(wind=same), {}, ['wind']),
    'hidden': (with_arrays(h=height), {'show_scalar_bar': False}, []),
    'blocks': (pv.MultiBlock([with_arrays(h=height), with_arrays(h=height)]), {}, ['h']),
    'blocks unlike': (pv.MultiBlock([with_arrays(h=height), with_arrays(k=height)]), {}, []),
}


@pytest.mark.parametrize(('mesh', 'look', 'bars'), BARS.values(), ids=BARS)
def test_scalar_bars_are_those_of_add_mesh(mesh, look, bars):
    pictures = []
    for add in ('add_mesh', 'add_instances'):
        pl = pv.Plotter(off_screen=True, window_size=(160, 160))
        args = {'poses': [[0, 0, 0]], 'bake': False} if add == 'add_instances' else {}
        getattr(pl.ibr if args else pl, add)(mesh.copy(), **args, **look)
        assert list(pl.scalar_bars.keys()) == bars
        pl.camera_position = 'iso'
        pictures.append(grab(pl))
        pl.close()
    assert np.abs(pictures[0] - pictures[1]).mean() < 1e-3


def test_an_actor_keeps_its_own_scalar_bar():
    pl = pv.Plotter(off_screen=True)
    actor = pl.add_mesh(with_arrays(h=height))
    assert list(pl.scalar_bars.keys()) == ['h']
    pl.ibr.add_instances(actor, [[3, 0, 0]])
    assert list(pl.scalar_bars.keys()) == ['h']
    pl.remove_actor(actor)
    pl.ibr.add_instances(actor, [[3, 0, 0]], show_scalar_bar=True)
    assert list(pl.scalar_bars.keys()) == ['h']
    pl.close()
