"""What a material does not have is not computed, and the picture is the same to the bit."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.gl.feature import replacements
from pvibr.large import large_mesh
from pvibr.large.left_out import leave_out_unused
from pvibr.things.shader_draws import DULL_FEATURE
from tests.large.looks import NEAR, drawn
from tests.large.surfaces import terrain
from tests.pictures import shot


def with_arrays():
    """Return a terrain with colours that have alpha, and values that are not everywhere."""
    mesh = terrain().copy()
    heights = mesh['height']
    ramp = np.linspace(0, 255, mesh.n_points).astype(np.uint8)
    mesh['rgba'] = np.stack([ramp, 255 - ramp, ramp, ramp], 1)
    mesh['holes'] = np.where(heights > 0.5, np.nan, heights)
    return mesh


def both(monkeypatch, change, **look):
    """Return pictures of all that VTK computes and of what is left, before and after a change."""
    pictures = []
    for leaves_out in (False, True):
        with monkeypatch.context() as patch:
            if not leaves_out:
                patch.setattr(large_mesh, 'leave_out_unused', lambda *actors: None)
            pl, thing = drawn(with_arrays(), view=NEAR, max_error=2.0, **look)
            shot(pl)
            own = [shot(pl)]
            change(thing)
            pictures.append([*own, shot(pl)])
    return zip(*pictures, strict=True)


LOOKS = {
    'colour': {'color': 'tan'},
    'smooth scalars': {'scalars': 'pattern', 'smooth_shading': True},
    'shiny': {'color': 'tan', 'specular': 0.7, 'smooth_shading': True},
    'pbr': {'color': 'tan', 'pbr': True, 'smooth_shading': True},
    'translucent': {'color': 'tan', 'opacity': 0.5},
    'colours with alpha': {'scalars': 'rgba', 'rgb': True},
    'holes': {'scalars': 'holes', 'nan_opacity': 0.0},
    'edges': {'color': 'tan', 'show_edges': True},
}


@pytest.mark.parametrize('look', LOOKS)
def test_the_picture_is_the_same(look, monkeypatch):
    for whole, left in both(monkeypatch, lambda thing: None, **LOOKS[look]):
        np.testing.assert_array_equal(whole, left)


def fade_table(thing):
    """Let the colours of low values be transparent."""
    table = thing.mapper.lookup_table
    values = np.array(table.values)
    values[: len(values) // 2, 3] = 0
    table.values = values


CHANGES = {
    'shiny': lambda thing: setattr(thing.prop, 'specular', 0.8),
    'translucent': lambda thing: setattr(thing.prop, 'opacity', 0.4),
    'table': fade_table,
}


@pytest.mark.parametrize('change', CHANGES)
def test_changes_of_the_material_show_at_once(change, monkeypatch):
    look = {'scalars': 'pattern', 'smooth_shading': True}
    before, after = both(monkeypatch, CHANGES[change], **look)
    for whole, left in (before, after):
        np.testing.assert_array_equal(whole, left)
    assert np.abs(after[1].astype(int) - before[1]).max() > 30


def test_highlights_of_back_faces_are_drawn():
    _, thing = drawn(terrain(), color='tan')

    def is_dull():
        return DULL_FEATURE.mark in ''.join(replacements(thing.GetShaderProperty()).values())

    assert is_dull()
    thing.SetBackfaceProperty(pv.Property(specular=0.5))
    leave_out_unused(thing)
    assert not is_dull()
