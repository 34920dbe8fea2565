"""Several features share an actor and leave it as it was."""

import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from pvibr.gl.feature import Feature, FeatureSet, replacements

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


def test_a_set_has_features_on_exactly_the_actors_of_its_last_match():
    actors, found = [pv.Actor() for _ in range(3)], FeatureSet()
    a, b = feature('a'), feature('b')
    assert found.match(actors[:2], lambda _: (a,)) == actors[:2]
    assert found.match(actors[1:], lambda actor: (a, b) if actor is actors[1] else (b,))
    assert [text(actor) is None for actor in actors] == [True, False, False]
    assert [text(actors[1]).count(f.mark) for f in (a, b)] == [1, 1]
    assert [text(actors[2]).count(f.mark) for f in (a, b)] == [0, 1]
    found.clear()
    assert len(found) == 0
    assert {text(actor) for actor in actors} == {None}


def test_a_set_asks_again_only_for_another_version():
    actor, found, asked = pv.Actor(), FeatureSet(), []

    def features_of(_):
        asked.append(1)
        return (feature('a'),)

    for version in (1, 1, 2):
        found.match([actor], features_of, lambda _, version=version: version)
    assert len(asked) == 2
