"""Keywords of add_mesh: each works or is refused with its reason. `python -m` writes the page."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.plotter_component import IBRComponent
from pvibr.things.keywords import reason
from tests.pictures import plotter, shown
from tests.things.test_things import GRAY, THINGS, Scene

pytestmark = pytest.mark.sampled

PAGE = Path(__file__).parents[2] / 'docs' / 'keywords.md'
KEYWORDS = [
    n for n in inspect.signature(pv.Plotter.add_mesh).parameters if n not in ('self', 'mesh')
]
KEYWORDS.remove('kwargs')
ADDERS = {
    'add_instances': pvibr.Instances,
    'add_animated': pvibr.AnimatedActor,
    'add_spheres': pvibr.Spheres,
    'add_cylinders': pvibr.Cylinders,
    'add_ellipsoids': pvibr.Ellipsoids,
    'add_billboards': pvibr.Billboards,
    'add_large_mesh': pvibr.LargeMesh,
    'add_impostor': pvibr.Impostor,
    'add_image_layers': pvibr.ImageLayers,
}
PLACES = np.array([[-1.2, 0.0, 0.6], [1.2, 0.0, 0.6], [0.0, 0.0, -0.6]])


def takes(adder, keyword):
    return keyword in inspect.signature(getattr(IBRComponent, adder)).parameters


def page():
    """The table: what works is marked, what is refused has the number of its reason."""
    reasons = []
    rows = []
    for keyword in KEYWORDS:
        cells = []
        for adder, kind in ADDERS.items():
            why = '' if takes(adder, keyword) else reason(kind, keyword)
            if why and why not in reasons:
                reasons.append(why)
            cells.append(f'{reasons.index(why) + 1}' if why else 'yes')
        rows.append(f'| `{keyword}` | {" | ".join(cells)} |')
    head = f'| | {" | ".join(f"`{name}`" for name in ADDERS)} |\n|{"---|" * (len(ADDERS) + 1)}'
    notes = '\n'.join(f'{k}. {why}' for k, why in enumerate(reasons, 1))
    return (
        '# Keywords of `add_mesh`\n\n'
        "Which keywords of PyVista's `add_mesh` the methods `pl.ibr.add_*` accept, with the same "
        'meaning. A\n'
        'number refers to the reason for which a `TypeError` refuses one.\n\n'
        f'{head}\n' + '\n'.join(rows) + f'\n\n{notes}\n'
    )


def test_the_page_is_that_of_the_signatures():
    assert PAGE.read_text(encoding='utf-8') == page(), 'run python -m tests.things.test_keywords'


@pytest.mark.parametrize('adder', ADDERS)
def test_each_keyword_works_or_is_refused_with_a_reason(adder):
    scene = Scene()
    kind = ADDERS[adder]
    before = list(scene.plotter.actors.items())
    for keyword in (k for k in KEYWORDS if not takes(adder, k)):
        assert reason(kind, keyword), keyword
        with pytest.raises(TypeError, match=re.escape(reason(kind, keyword))):
            THINGS[kind.__name__](scene, **{keyword: True})
    with pytest.raises(TypeError, match='did you mean'):
        THINGS[kind.__name__](scene, reset_camra=True)
    assert list(scene.plotter.actors.items()) == before
    scene.plotter.close()


def mesh():
    made = pv.Sphere(theta_resolution=10, phi_resolution=8)
    made['h'] = made.points[:, 2].copy()
    made['h'][3] = np.nan
    made['colors'] = np.random.default_rng(17).integers(0, 255, (made.n_points, 3), np.uint8)
    made['far'] = made.points.copy()
    made.cell_data['h'] = np.arange(made.n_cells) * 0.01
    made.texture_map_to_sphere(inplace=True)
    made.set_active_scalars('h')
    return made


CHECKS = np.kron(np.indices((4, 4)).sum(0) % 2 * 255, np.ones((4, 4)))
CHECKS = CHECKS.astype(np.uint8)[..., None].repeat(3, 2)
MATRIX = np.array([[1.5, 0, 0, 0.2], [0, 0.5, 0, 0.3], [0, 0, 1, 0.1], [0, 0, 0, 1]])
PHONG = {'smooth_shading': True, 'color': 'r'}
WIRES = {'style': 'wireframe', 'line_width': 5}
POINTS = {'style': 'points', 'point_size': 9}
EDGES = {'show_edges': True}
NARROW = {'clim': (-0.2, 0.2)}
#: A value of each keyword of the mesh itself that shows, and what it needs to show.
SAMPLES = {
    'color': ({'color': 'tomato'}, {}),
    'style': ({'style': 'wireframe'}, {}),
    'scalars': ({'scalars': 'far'}, {}),
    'clim': (NARROW, {}),
    'show_edges': (EDGES, {}),
    'edge_color': ({'edge_color': 'red'}, EDGES),
    'edge_opacity': ({'edge_opacity': 0.2}, EDGES),
    'point_size': ({'point_size': 3}, POINTS),
    'line_width': ({'line_width': 2}, WIRES),
    'opacity': ({'opacity': 0.4}, {}),
    'flip_scalars': ({'flip_scalars': True}, {}),
    'lighting': ({'lighting': False}, {}),
    'n_colors': ({'n_colors': 3}, {}),
    'interpolate_before_map': ({'interpolate_before_map': False}, {'n_colors': 3}),
    'cmap': ({'cmap': 'plasma'}, {}),
    'texture': ({'texture': CHECKS}, {}),
    'render_points_as_spheres': ({'render_points_as_spheres': True}, POINTS),
    'render_lines_as_tubes': ({'render_lines_as_tubes': True}, WIRES),
    'smooth_shading': ({'smooth_shading': True}, {'color': 'w'}),
    'split_sharp_edges': ({'split_sharp_edges': True, 'feature_angle': 10}, PHONG),
    'ambient': ({'ambient': 0.9}, {}),
    'diffuse': ({'diffuse': 0.2}, {}),
    'specular': ({'specular': 1.0}, PHONG | {'specular_power': 2}),
    'specular_power': ({'specular_power': 30}, PHONG | {'specular': 1.0}),
    'nan_color': ({'nan_color': 'red'}, {}),
    'nan_opacity': ({'nan_opacity': 0.0}, {}),
    'culling': ({'culling': 'front'}, {}),
    'rgb': ({'rgb': True}, {'scalars': 'colors'}),
    'categories': ({'categories': True}, {}),
    'use_transparency': ({'use_transparency': True}, {'opacity': 0.2}),
    'below_color': ({'below_color': 'red'}, NARROW),
    'above_color': ({'above_color': 'red'}, NARROW),
    'preference': ({'preference': 'cell'}, {'scalars': 'h'}),
    'log_scale': ({'log_scale': True}, {'clim': (0.01, 1)}),
    'pbr': ({'pbr': True}, {'color': 'r'}),
    'metallic': ({'metallic': 1.0}, {'pbr': True, 'color': 'r'}),
    'roughness': ({'roughness': 0.1}, {'pbr': True, 'color': 'r'}),
    'user_matrix': ({'user_matrix': MATRIX}, {}),
    'component': ({'component': 1}, {'scalars': 'far'}),
    'backface_params': ({'backface_params': {'color': 'blue'}}, {'culling': 'front'} | PHONG),
    'force_opaque': ({'force_opaque': True}, {'opacity': 0.5}),
}  # fmt: skip
#: Keywords that show elsewhere, each with a test of its own here or in test_adding.
ELSEWHERE = {
    *('name', 'label', 'reset_camera', 'render', 'show_scalar_bar', 'scalar_bar_args'),
    *('pickable', 'annotations'),
}


def grid_of(rows, columns, size=40):
    pl = plotter((size * columns, size * rows), shape=(rows, columns), border=False)
    return pl, lambda k, row: pl.subplot(row, k)


def tiles(pl, rows, columns):
    for renderer in pl.renderers:
        renderer.camera.position, renderer.camera.focal_point = (1.0, -4, 1.5), (0, 0, 0)
        renderer.camera.up = 0, 0, 1
        renderer.camera_set = True
        renderer.ResetCameraClippingRange()
    picture = shown(pl)
    pl.close()
    return picture.reshape(rows, 40, columns, 40, 3).swapaxes(1, 2)


def test_instances_look_as_the_mesh_does_with_each_keyword():
    assert {k for k in KEYWORDS if takes('add_instances', k)} == set(SAMPLES) | ELSEWHERE
    pl, at = grid_of(3, len(SAMPLES))
    for k, (sample, needed) in enumerate(SAMPLES.values()):
        at(k, 0)
        pl.add_mesh(mesh(), show_scalar_bar=False, **needed)
        at(k, 1)
        pl.add_mesh(mesh(), show_scalar_bar=False, **needed | sample)
        at(k, 2)
        how = {'bake': False, 'show_scalar_bar': False} | needed | sample
        pl.ibr.add_instances(mesh(), [[0.0, 0, 0]], **how)
    before, wanted, found = tiles(pl, 3, len(SAMPLES))
    for k, name in enumerate(SAMPLES):
        assert np.abs(found[k] - wanted[k]).max() <= 2, name
        assert np.abs(wanted[k] - before[k]).max() > 8, name


VALUES = np.array([-1.0, 2.0, np.nan])
TABLES = [
    {'cmap': 'plasma'},
    {'cmap': ['red', 'green', 'blue']},
    {'clim': (0.0, 1.5)},
    {'n_colors': 3},
    {'nan_color': 'tomato'},
    {'below_color': 'b', 'above_color': '#ff0000', 'clim': (0, 1)},
    {'log_scale': True, 'clim': (0.1, 10)},
    {'flip_scalars': True},
    {'categories': True},
    {'categories': 5},
    {'annotations': {2.0: 'high'}},
    {'cmap': pv.LookupTable('magma', scalar_range=(-3, 3))},
]
OF_ITEMS = {
    'Instances': lambda ibr, **how: ibr.add_instances(pv.Cone(), PLACES, **how),
    'Spheres': lambda ibr, **how: ibr.add_spheres(PLACES, **how),
    'Cylinders': lambda ibr, **how: ibr.add_cylinders(PLACES, PLACES + 0.5, 0.3, **how),
    'Ellipsoids': lambda ibr, **how: ibr.add_ellipsoids(PLACES, (0.5, 0.3, 0.4), **how),
    'Billboards': lambda ibr, **how: ibr.add_billboards(PLACES, GRAY, **how),
}


@pytest.mark.parametrize('kind', OF_ITEMS)
@pytest.mark.parametrize('themed', ['global', 'plotter', ''])
def test_scalars_of_items_are_coloured_as_those_of_a_mesh(kind, themed, monkeypatch):
    theme = pv.themes.DarkTheme()
    theme.cmap, theme.nan_color, theme.color = 'cividis', 'red', 'seagreen'
    if themed == 'global':
        monkeypatch.setattr(pv.global_theme, '_cmap', 'cividis')
        monkeypatch.setattr(pv.global_theme, '_nan_color', pv.Color('red'))
    for options in TABLES if not themed else TABLES[3:4]:
        pl = pv.Plotter(off_screen=True, theme=theme if themed == 'plotter' else None)
        thing = OF_ITEMS[kind](pl.ibr, scalars=VALUES, **options)
        mapper = pl.add_mesh(pv.PolyData(PLACES), scalars=VALUES.copy(), **options).mapper
        rows = [pv.Color(mapper.lookup_table.map_value(v)).int_rgb for v in VALUES]
        np.testing.assert_array_equal(thing.colors, rows, err_msg=str(options))
        assert thing.table.annotations == mapper.lookup_table.annotations
        pl.close()


def annotations_of(table):
    """Return what `LookupTable.annotations` raises for: more than one, and those of words."""
    values, names = table.GetAnnotatedValues(), table.GetAnnotations()
    pairs = range(names.GetNumberOfValues())
    return {float(str(values.GetVariantValue(k))): names.GetValue(k) for k in pairs}


@pytest.mark.parametrize('kind', OF_ITEMS)
@pytest.mark.parametrize('values', [['oak', 'ash', 'oak'], [True, False, True]])
def test_words_and_flags_have_a_colour_each_as_those_of_a_mesh(kind, values):
    for options in ({}, {'cmap': 'tab10'}, {'flip_scalars': True, 'annotations': {0: 'no'}}):
        pl, plain = pv.Plotter(off_screen=True), pv.Plotter(off_screen=True)
        options = options | {'scalar_bar_args': {'title': 'kind'}}
        thing = OF_ITEMS[kind](pl.ibr, scalars=np.array(values), **options)
        mesh = pv.PolyData(PLACES)
        mesh['kind'] = values
        mapper = plain.add_mesh(mesh, scalars='kind', **options).mapper
        codes = mapper.dataset[mapper.array_name].astype(float)
        rows = [pv.Color(mapper.lookup_table.map_value(v)).int_rgb for v in codes]
        np.testing.assert_array_equal(thing.colors, rows, err_msg=str(options))
        assert thing.scalars.tolist() == values
        assert annotations_of(thing.table) == annotations_of(mapper.lookup_table)
        assert thing.clim == mapper.scalar_range
        bars = [p.scalar_bars['kind'] for p in (pl, plain)]
        assert bars[0].GetDrawTickLabels() == bars[1].GetDrawTickLabels() == 0
        thing.scalars = ['elm', 'fir', 'yew']  # other words, as many colours
        assert len(np.unique(thing.colors, axis=0)) == 3
        thing.scalars = VALUES  # and numbers, as if they had been given first
        wanted = OF_ITEMS[kind](pl.ibr, scalars=VALUES, **options)
        np.testing.assert_array_equal(thing.colors, wanted.colors)
        pl.close()
        plain.close()


@pytest.mark.parametrize('kind', ['Instances', 'Spheres', 'Cylinders', 'Ellipsoids'])
def test_colours_come_from_the_cycle_of_the_plotter(kind):
    pl = pv.Plotter(off_screen=True)
    pl.set_color_cycler(['red', 'lime', 'blue'])
    found = [OF_ITEMS[kind](pl.ibr, **({'color': c} if c else {})) for c in ('', '', 'k', True)]
    assert [thing.prop.color.name for thing in found] == ['red', 'lime', 'black', 'blue']
    assert pl.add_mesh(pv.Cone()).prop.color == 'red'


@pytest.mark.parametrize('name', ['Spheres', 'Cylinders', 'Ellipsoids', 'Billboards', 'Ground'])
@pytest.mark.parametrize('whose', ['global', 'plotter', 'handle'])
def test_edges_lines_and_points_of_a_theme_are_those_of_meshes(name, whose, monkeypatch):
    """Cards and the ground have none: themes for meshes leave them as they are."""
    looks = {'show_edges': True, 'line_width': 5.0, 'point_size': 9.0}
    looks |= {'render_points_as_spheres': True, 'render_lines_as_tubes': True}

    def picture(theme=None, **own):
        pl = pv.Plotter(off_screen=True, window_size=(120, 90), theme=theme)
        far = OF_ITEMS['Spheres'](pl.ibr, color='r') if name == 'Ground' else None
        thing = pl.ibr.add(pvibr.Ground('w')) if far else OF_ITEMS[name](pl.ibr)
        for key, value in own.items():
            setattr(thing.prop, key, value)
        pl.view_isometric()
        return pl.screenshot()

    plain = picture()
    own = looks if whose == 'handle' and name != 'Ground' else {}
    if whose == 'global':
        for key, value in looks.items():
            monkeypatch.setattr(pv.global_theme, f'_{key}', value)
    theme = pv.themes.Theme()
    theme.load_theme(pv.global_theme)
    for key, value in looks.items() if whose == 'plotter' else ():
        setattr(theme, key, value)
    np.testing.assert_array_equal(picture(theme if whose == 'plotter' else None, **own), plain)


@pytest.mark.parametrize('kind', ['Spheres', 'Cylinders', 'Ellipsoids'])
def test_themes_are_followed(kind, monkeypatch):
    theme = pv.themes.DarkTheme()
    theme.color, theme.lighting = 'seagreen', False
    for pl in (pv.Plotter(off_screen=True, theme=theme), pv.Plotter(off_screen=True)):
        wanted = pl.add_mesh(pv.Sphere()).prop
        prop = OF_ITEMS[kind](pl.ibr).prop
        assert prop.color == wanted.color
        assert prop.lighting == wanted.lighting
        own = OF_ITEMS[kind](pl.ibr, color='b', lighting=True, pbr=True, metallic=0.7).prop
        assert (own.color, own.lighting, own.metallic) == (pv.Color('b'), True, 0.7)
        assert own.interpolation == pv.opts.InterpolationType.PBR
        pl.close()


@pytest.mark.parametrize('kind', [k for k in THINGS if k not in ('Impostor', 'ImageLayers')])
def test_labels_are_in_the_legend_until_it_goes(kind):
    scene = Scene()
    thing = scene.add(kind, name='it', label='things')
    scene.plotter.add_mesh(pv.Cube(), label='cube', color='red')
    legend = scene.plotter.add_legend()
    assert [legend.GetEntryString(k) for k in range(2)] == ['things', 'cube']
    assert legend.GetEntryColor(0) == thing.GetProperty().GetColor()
    scene.plotter.remove_actor('it')
    legend = scene.plotter.add_legend()
    assert legend.GetNumberOfEntries() == 1
    with pytest.raises(TypeError, match=r'label.* must be a str'):
        scene.add(kind, label=3)
    scene.plotter.close()


BAD = [
    {'nan_color': 'no color'},
    {'below_color': 7},
    {'clim': 'wide'},
    {'clim': (2, 1)},
    {'n_colors': 0},
    {'categories': 'many'},
    {'annotations': [1]},
    {'flip_scalars': 'yes'},
    {'log_scale': 3},
]


@pytest.mark.parametrize('kind', OF_ITEMS)
def test_bad_values_are_named_and_leave_nothing_behind(kind):
    pl = pv.Plotter(off_screen=True)
    for bad in BAD:
        (name,) = bad
        with pytest.raises((TypeError, ValueError), match=f'{name} '):
            OF_ITEMS[kind](pl.ibr, scalars=VALUES, **bad)
    assert not pl.actors
    assert not pl.ibr.effects
    pl.close()


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
