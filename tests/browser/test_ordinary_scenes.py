"""What users of PyVista draw every day, as pages: the pictures are those of the plotter."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from pyvista import examples

from tests.browser.test_pages import flip_of, opened, picture, plotter

pytestmark = pytest.mark.browser

#: Largest FLIP of a page, whose fonts are those of the browser, and of one with lines of axes.
LIMIT, LIMIT_OF_AXES = 0.035, 0.04
#: Texts of axes are elsewhere than VTK's, which overlap.
UNWRITTEN = dict.fromkeys(('xtitle', 'ytitle', 'ztitle'), ' ') | dict.fromkeys(
    ('show_xlabels', 'show_ylabels', 'show_zlabels'), False
)


def logarithms(pl):
    mesh = pv.Plane(i_resolution=40, j_resolution=40)
    mesh['v'] = 10 ** (4 * mesh.points[:, 0])
    pl.add_mesh(mesh, log_scale=True, cmap='plasma')


def ends_and_nan(pl):
    mesh = pv.Plane(i_resolution=20, j_resolution=20)
    values = mesh.points[:, 0].copy()
    values[::7] = np.nan
    mesh['v'] = values
    looks = {'nan_color': 'magenta', 'below_color': 'blue', 'above_color': 'red'}
    pl.add_mesh(mesh, clim=[-0.3, 0.3], scalar_bar_args={'position_y': 0.3}, **looks)
    pl.view_xy()


def slices(pl):
    pl.add_mesh(examples.load_uniform().slice_orthogonal(), cmap='jet')


def blocks(pl):
    meshes = {'a': pv.Cube(), 'b': pv.Sphere(center=(2, 0, 0)), 'c': pv.Cone(center=(4, 0, 0))}
    _, mapper = pl.add_composite(pv.MultiBlock(meshes), color='white')
    mapper.block_attr[1].color = 'red'
    mapper.block_attr[2].opacity = 0.5
    mapper.block_attr[3].visible = False


def backs(pl):
    pl.add_mesh(pv.Sphere().clip(), color='white', backface_params={'color': 'red'})


def far_away(pl):
    mesh = examples.load_random_hills()
    mesh.points = mesh.points + np.array([5e5, 4.5e6, 0])
    pl.add_mesh(mesh, cmap='terrain')


def tubes_of_lines(pl):
    mesh = examples.load_spline()
    pl.add_mesh(mesh, color='blue', line_width=4, render_lines_as_tubes=True)
    pl.add_mesh(pv.Sphere(radius=0.5), color='white')


def legend(pl):
    pl.add_mesh(pv.Sphere(center=(2, 0, 0)), color='red', label='ball')
    pl.add_mesh(pv.Cube(), color='green', label='cube')
    pl.add_legend(bcolor='#eeeeee', border=True)


def grid(pl):
    pl.add_mesh(pv.ParametricRandomHills(), color='tan')
    pl.show_grid(**UNWRITTEN)


def bounds(pl):
    pl.add_mesh(pv.Cube(x_length=3), color='tan')
    pl.show_bounds(grid='front', location='outer', all_edges=True, **UNWRITTEN)


def ruler(pl):
    pl.add_mesh(pv.Cube(), color='tan')
    pl.add_ruler((-0.5, -0.5, 0.5), (0.5, -0.5, 0.5), title='Width')


SCENES = [logarithms, ends_and_nan, slices, blocks, backs, far_away, tubes_of_lines, legend]


@pytest.mark.parametrize('scene', [*SCENES, grid, bounds, ruler], ids=lambda f: f.__name__)
def test_ordinary_scenes_look_as_here(scene, page, tmp_path, until):
    pl = plotter()
    scene(pl)
    here = opened(page, pl, tmp_path / 'scene.html', until)
    assert flip_of(picture(page), here) <= (LIMIT if scene in SCENES else LIMIT_OF_AXES)
    pl.close()


def test_axes_go_to_other_edges_as_the_view_turns(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.ParametricRandomHills(), color='tan')
    pl.show_grid()
    opened(page, pl, tmp_path / 'scene.html', until)
    axes = page.locator('svg [aria-label^="Axes: X Axis, Y Axis, Z Axis"]')
    texts = axes.locator('text')
    assert {'X Axis', 'Y Axis', 'Z Axis'} <= set(texts.all_text_contents())
    before = [texts.nth(i).get_attribute('x') for i in range(texts.count())]
    lines = (
        'pvibr.subplots[0].things.filter(t => t.cube && t.visible)'
        '.map(t => `${Object.values(t.cube)}`)'
    )
    shown = page.evaluate(lines)
    assert len(shown) == 6  # an edge of each axis, three faces behind
    page.locator('.view').focus()
    for _ in range(12):
        page.keyboard.press('ArrowLeft')
    picture(page)
    assert page.evaluate(lines) != shown
    after = [texts.nth(i).get_attribute('x') for i in range(texts.count())]
    assert before != after
    pl.close()


def test_lines_between_subplots_are_drawn(page, tmp_path, until):
    pl = plotter(shape=(1, 2), border=True, border_color='black', border_width=4)
    pl.add_mesh(pv.Sphere())
    pl.subplot(0, 1)
    pl.add_mesh(pv.Cube())
    here = opened(page, pl, tmp_path / 'scene.html', until)
    there = picture(page)
    assert flip_of(there, here) <= LIMIT
    middle = there[:, there.shape[1] // 2 - 2 : there.shape[1] // 2 + 2].min(axis=(1, 2))
    assert np.median(middle) < 100
    pl.close()


def test_a_refused_shader_costs_its_thing_alone(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Sphere(), color='red', name='ball')
    pl.add_mesh(pv.Cube(center=(2, 0, 0)), color='green', name='box')
    opened(page, pl, tmp_path / 'scene.html', until)
    page.evaluate("""() => {
      const { programs, things } = pvibr.subplots[0];
      const ball = things.find(({ name }) => name === 'ball').programs.faces;
      programs[ball] = { ...programs[ball], fragment: 'no shader' };
      pvibr.changed();
    }""")
    there = picture(page).astype(int)
    assert (there[..., 0] > there[..., 1] + 50).sum() == 0
    assert (there[..., 1] > there[..., 0] + 30).sum() > 1000
    assert page.locator('#message').inner_text() == 'This browser cannot draw ball.'
    pl.close()
