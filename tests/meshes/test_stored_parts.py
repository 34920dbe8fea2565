"""Parts that go to another process and come back look the same."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv

from pvibr.gl.feature import replacements
from pvibr.instances.cache import pack, unpack
from pvibr.instances.levels import content_key
from pvibr.meshes.parts import as_parts
from pvibr.meshes.stored_parts import from_arrays, to_arrays
from pvibr.meshes.turntable import Turns
from pvibr.scenes.trees import tree_parts


def ball():
    mesh = pv.Sphere(theta_resolution=20, phi_resolution=20)
    mesh['height'] = mesh.points[:, 2]
    mesh['words'] = np.array(['low', 'high'])[(mesh.points[:, 2] > 0).astype(int)]
    mesh['vectors'] = mesh.points.astype(float)
    mesh.cell_data['number'] = np.arange(mesh.n_cells, dtype=float)
    return mesh.texture_map_to_sphere()


def texture(channels):
    texels = np.random.default_rng(0).integers(0, 255, (16, 16, channels), dtype=np.uint8)
    return pv.Texture(texels)


LOOKS = {
    'color': {'color': 'tan', 'specular': 0.3, 'smooth_shading': True},
    'points': {'scalars': 'height', 'cmap': 'viridis', 'clim': [-0.2, 0.4], 'below_color': 'red'},
    'cells': {'scalars': 'number', 'log_scale': True, 'clim': [1, 300], 'nan_color': 'blue'},
    'words': {'scalars': 'words'},
    'vectors': {'scalars': 'vectors'},
    'values': {'scalars': np.arange(3 * ball().n_points).reshape(-1, 3) % 255, 'rgb': True},
    'texture': {'texture': texture(3)},
    'cut out': {'texture': texture(4), 'alpha_cutoff': 0.5},
    'physical': {'pbr': True, 'metallic': 0.4, 'roughness': 0.2},
    'culled': {'culling': 'back'},
    'back': {'backface_params': {'color': 'blue'}},
    'translucent': {'opacity': 0.4},
}


def through_a_file(parts):
    arrays, meta = to_arrays(parts)
    entry = unpack(np.frombuffer(b''.join(map(bytes, pack(arrays, meta))), np.uint8))
    return from_arrays(entry, entry.meta)


def assert_same(parts):
    restored = through_a_file(parts)
    assert content_key(restored) == content_key(parts)
    for before, after in zip(parts, restored, strict=True):
        shaders = [replacements(p.actor.GetShaderProperty()) for p in (before, after)]
        assert shaders[0] == shaders[1]
        assert after.actor.GetMapper().GetInput() is after.mesh
        assert (after.alpha_cutoff, after.turns) == (before.alpha_cutoff, before.turns)
        assert after.polydata_mapper().GetInput().GetNumberOfCells() == before.mesh.n_cells


@pytest.mark.parametrize('look', LOOKS)
def test_looks_come_back(look):
    values = LOOKS[look].get('scalars')
    options = LOOKS[look]
    if isinstance(values, np.ndarray):
        options = options | {'scalars': values.astype(np.uint8)}
    assert_same(as_parts(ball(), **options))


def test_several_parts_come_back():
    assert_same(as_parts(tree_parts()))
    assert_same(as_parts(pv.MultiBlock([pv.Cone(), pv.Cube()])))


def test_supplied_levels_and_turntables_come_back():
    (part,) = as_parts(ball(), color='tan')
    levels = tuple(as_parts(pv.Sphere(theta_resolution=n)) for n in (12, 6))
    part = replace(part, supplied_levels=levels, turns=Turns((0.0, 0.0, 1.0), 12))
    assert_same([part])
    (restored,) = through_a_file([part])
    counts = [level[0].mesh.n_cells for level in restored.supplied_levels]
    assert counts == [level[0].mesh.n_cells for level in levels]


def test_a_mesh_that_is_drawn_differs_by_nothing():
    """The picture of what came back is the picture."""
    pictures = []
    for parts in (given := as_parts(ball(), **LOOKS['points']), through_a_file(given)):
        plotter = pv.Plotter(off_screen=True, window_size=(120, 120))
        for part in parts:
            plotter.add_actor(part.new_actor(part.polydata_mapper()))
        pictures.append(plotter.screenshot())
        plotter.close()
    assert np.array_equal(*pictures)
    assert np.ptp(pictures[0]) > 100


def test_texts_of_others_raise():
    arrays, meta = to_arrays(as_parts(pv.Cone()))
    swapped = [row | {'actor': row['mesh'], 'mesh': row['actor']} for row in meta['parts']]
    with pytest.raises(ValueError, match='an actor and a mesh'):
        from_arrays(arrays, meta | {'parts': swapped})
