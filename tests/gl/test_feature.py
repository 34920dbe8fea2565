"""Several features share an actor and leave it as it was."""

from __future__ import annotations

import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from pvibr.gl.feature import Feature, replacements

TAG = '//VTK::Light::Impl'
OWN = f'  // of the user\n{TAG}\n'


def feature(name):
    return Feature(name, fragment={'VTK::Light::Impl': f'{{ // {name}\n{TAG}\n}}\n'})


def text(actor):
    return replacements(actor.GetShaderProperty()).get(('Fragment', TAG))


@given(st.permutations('abc'), st.permutations('abc'), st.booleans())
def test_features_come_and_go_in_any_order(coming, going, users):
    actor = pv.Actor()
    if users:
        actor.GetShaderProperty().AddFragmentShaderReplacement(TAG, True, OWN, False)
    features = {name: feature(name) for name in 'abc'}
    for name in coming:
        features[name].attach(actor)
        features[name].attach(actor)
    for name in going:
        found = text(actor)
        assert found.count(TAG) == 1
        assert found.count(features[name].mark) == 1
        features[name].detach(actor)
    assert text(actor) == (OWN if users else None)


def test_a_later_feature_stands_within_the_earlier():
    actor = pv.Actor()
    feature('a').attach(actor)
    feature('b').attach(actor)
    found = text(actor)
    assert found.index('{ // a') < found.index('{ // b') < found.index(TAG)
