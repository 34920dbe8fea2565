"""Translucent parts in images: their layers, what is inside of them, and what they follow."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk
from tests.pictures import place, plotter, shot, uncut

TUBE = pv.CylinderStructured(
    radius=[0.5, 0.9], height=2.0, theta_resolution=40, z_resolution=2
).extract_surface(algorithm=None)
RING = pv.ParametricTorus(u_res=40, v_res=40, w_res=40).extract_surface(algorithm=None)
WALL = pv.Cube(center=(0, 2, 0), x_length=8, y_length=0.2, z_length=4)


def add_parts(pl):
    """Add translucent parts with opaque ones inside, before and behind them."""
    lines = {'show_edges': True, 'line_width': 2, 'edge_color': 'darkred'}
    parts = [
        (pv.Sphere(radius=1.2), (-3, 0, 0), {'color': 'red', 'opacity': 0.4}),
        (pv.Cube(), (-3, 0, 0), {'color': 'blue'}),
        (RING.rotate_x(70), (0, 0, 0), {'color': 'green', 'opacity': 0.4}),
        (pv.Cylinder(radius=0.3, height=4, direction=(1, 1, 0)), (0, 0, 0), {'color': 'orange'}),
        (TUBE, (3, 0, 0), {'color': 'tan', 'opacity': 0.5, **lines}),
        (pv.Cube(), (3, -2, -1), {'color': 'cyan', 'opacity': 0.3, 'lighting': False}),
        (WALL, (0, 0, 0), {'color': 'gray'}),
    ]
    return [pl.add_mesh(mesh.translate(where), **look) for mesh, where, look in parts]


def in_perspective(pl):
    place(pl, (4, -19, 6))


def in_parallel(pl):
    place(pl, (4, -19, 6), parallel=4.0)


def peeled(pl):
    in_perspective(pl)
    pl.enable_depth_peeling(12)


def supersampled(pl):
    in_perspective(pl)
    pl.enable_anti_aliasing('ssaa')


@pytest.mark.parametrize('hierarchical', [False, True])
@pytest.mark.parametrize('look', [in_perspective, in_parallel, peeled, supersampled])
def test_layers_look_as_the_surfaces_of_meshes(look, hierarchical):
    pl = plotter((320, 240))
    actors = add_parts(pl)
    look(pl)
    pl.show(auto_close=False)
    plain = uncut(pl)
    how = {'only_if_faster': False, 'hierarchical': hierarchical}
    impostor = pl.ibr.add_impostor(actors, **how)
    for _ in range(2):
        off = np.abs(uncut(pl) - plain).max(-1)
        assert impostor.report()['meshes'] == {}
        assert off.mean() < 1.2
        assert (off > 40).mean() < 0.012


def test_smooth_windows_and_turning_eyes():
    plotters = [pv.Plotter(off_screen=True, window_size=(320, 240)) for _ in range(2)]
    actors = [add_parts(pl) for pl in plotters]
    impostor = plotters[1].ibr.add_impostor(actors[1], only_if_faster=False)
    for pl in plotters:
        pl.show(auto_close=False)
    rendered = []
    for step in range(12):
        for pl in plotters:
            place(pl, (4 + 0.05 * step, -19, 6))
        plain, images = map(uncut, plotters)
        rendered.append(impostor.rendered)
        off = np.abs(images - plain).max(-1)
        assert off.mean() < 1.5
        assert (off > 60).mean() < 0.01
    assert rendered[-1] < 4 * len(actors[1])


def test_opacity_colour_and_light_are_followed():
    pl = plotter((160, 120))
    ball = pl.add_mesh(pv.Sphere(), color='red', opacity=0.3)
    pl.camera_position = [(0, -5, 1), (0, 0, 0), (0, 0, 1)]
    impostor = pl.ibr.add_impostor(ball, only_if_faster=False)
    pl.show(auto_close=False)

    def check():
        images = uncut(pl)
        assert impostor.report()['images'] >= 1
        impostor.enabled = False
        plain = uncut(pl)
        impostor.enabled = True
        assert np.abs(images - plain).max(-1).mean() < 1.0
        return plain

    seen = [check()]
    for change in (
        lambda: setattr(ball.prop, 'opacity', 0.7),
        lambda: setattr(ball.prop, 'color', 'blue'),
        lambda: pl.add_light(pv.Light(position=(5, 0, 0), intensity=0.5)),
        lambda: setattr(ball.prop, 'opacity', 1.0),
        lambda: setattr(ball.prop, 'opacity', 0.2),
        lambda: setattr(ball, 'position', (0.4, 0, 0)),
    ):
        change()
        seen.append(check())
        assert np.abs(seen[-1] - seen[-2]).max() > 20


def test_planes_cut_layers():
    pl = plotter((320, 240))
    actors = add_parts(pl)
    in_perspective(pl)
    plane = _vtk.vtkPlane()
    plane.SetNormal(0, 0.2, -1)
    for actor in actors:
        actor.mapper.AddClippingPlane(plane)
    pl.show(auto_close=False)
    plain = uncut(pl)
    pl.ibr.add_impostor(actors, only_if_faster=False)
    for _ in range(3):
        off = np.abs(uncut(pl) - plain).max(-1)
        assert (off > 60).mean() < 0.01


def test_only_even_opacities_have_layers():
    pl = plotter()
    mesh = pv.Sphere()
    uneven = pl.add_mesh(mesh, scalars=mesh.points[:, 2], opacity='linear', show_scalar_bar=False)
    even = pl.add_mesh(pv.Sphere(center=(2, 0, 0)), opacity=0.5)
    pl.camera_position = [(1, -9, 1), (1, 0, 0), (0, 0, 1)]
    impostor = pl.ibr.add_impostor([uneven, even], only_if_faster=False)
    pl.show(auto_close=False)
    told = impostor.report()
    assert told['meshes'] == {'translucent': 1}
    assert told['images'] == 1
    assert shot(pl).min() < 250
    impostor.remove()
    assert even.visibility
    assert uneven.visibility
