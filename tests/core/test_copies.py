"""Effects are copied and pickled by what they were made of; things say why they are not."""

import copy
import pickle

import pytest
import pyvista as pv

import pvibr
from pvibr.core.params import params_of
from tests.pictures import plotter, shot
from tests.refusals import refused

pytestmark = pytest.mark.sampled

EFFECTS = [name for name in pvibr.EFFECTS if name != 'Projector']
WAYS = {
    'deepcopy': copy.deepcopy,
    'copy': copy.copy,
    'pickle': lambda effect: pickle.loads(pickle.dumps(effect)),  # noqa: S301
}


@pytest.mark.parametrize('name', EFFECTS)
@pytest.mark.parametrize('way', WAYS)
def test_copies_are_equal_and_of_their_own(name, way):
    pl = plotter((40, 30))
    ball = pl.add_mesh(pv.Sphere())
    effect = pl.ibr.add(getattr(pvibr, name).sample([ball]))
    effect.name = 'it'
    for setting, param in params_of(type(effect)).items():
        if param.kind is bool:
            setattr(effect, setting, not getattr(effect, setting))
            break
    effect.enabled = False
    shot(pl)
    if way == 'pickle' and 'Actor' in repr(effect._made_of):
        refused("cannot pickle 'Actor'", WAYS[way], effect, kind=TypeError)
        return
    made = WAYS[way](effect)
    assert type(made) is type(effect)
    assert made is not effect
    assert (made.state(), made.name, made.enabled) == (effect.state(), 'it', False)
    assert made.pipeline is None
    other = plotter((40, 30))
    made.enabled = True
    if 'Actor' not in repr(effect._made_of):
        other.add_mesh(pv.Sphere())
        other.ibr.add(made)
        shot(other)
        assert made.enabled


def test_a_copy_follows_what_was_set_and_is_independent():
    bloom = pvibr.Bloom(intensity=0.3)
    bloom.threshold = 0.7
    made = copy.deepcopy(bloom)
    assert (made.intensity, made.threshold) == (0.3, 0.7)
    made.threshold = 0.1
    assert bloom.threshold == 0.7


def test_things_say_why_they_are_not_copied():
    balls = pvibr.Spheres([[0.0, 0, 0]], name='balls')
    for way in WAYS.values():
        refused('balls cannot be copied or pickled: create another', way, balls, kind=TypeError)


@pytest.mark.parametrize('way', WAYS)
def test_effects_with_uniforms_of_their_own_are_copied(way):
    effect = pvibr.ShaderEffect('vec4 effect(vec2 uv) { return color_at(uv) * k; }', k=0.5)
    effect.k = 0.25
    made = WAYS[way](effect)
    assert (made.k, made.state()) == (0.25, effect.state())
    assert type(made).__name__ == 'ShaderEffect'
