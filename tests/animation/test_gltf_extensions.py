"""Extensions of nodes and animations: instances, visibility, pointers."""

import numpy as np
import pytest

import pvibr
from pvibr.animation import GltfError
from pvibr.maths.transforms import trs
from pvibr.meshes.gltf_as_meshes import gltf_instances
from tests.animation.conftest import refused

RNG = np.random.default_rng(8)


def instanced(glb, count=5, **node):
    moves, sizes = RNG.normal(size=(count, 3)), RNG.uniform(0.5, 2, (count, 3))
    spins = RNG.normal(size=(count, 4))
    spins /= np.linalg.norm(spins, axis=1, keepdims=True)
    attributes = {
        'TRANSLATION': glb.array(moves),
        'ROTATION': glb.array(spins),
        'SCALE': glb.array(sizes),
    }
    extensions = {'EXT_mesh_gpu_instancing': {'attributes': attributes}}
    glb.shown(glb.primitive(), extensions=extensions, **node)
    glb.json['extensionsUsed'] = glb.json['extensionsRequired'] = ['EXT_mesh_gpu_instancing']
    return trs(moves, spins[:, [3, 0, 1, 2]], sizes)


@pytest.mark.parametrize('up', ['y', 'z'])
def test_instances_are_meshes_on_joints_of_their_own(glb, up):
    matrices = instanced(glb, translation=[1, 2, 3])
    figure = pvibr.read_gltf(glb.write(), up=up)
    assert len(figure.meshes) == 5
    assert len({id(mesh.mesh) for mesh in figure.meshes}) == 1
    square = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]])
    for i, matrix in enumerate(matrices):
        wanted = (square @ matrix.T)[:, :3] + [1, 2, 3]
        if up == 'z':
            wanted = wanted[:, [0, 2, 1]] * [1, -1, 1]
        np.testing.assert_allclose(figure.posed(i)[0], wanted, atol=1e-5)
    joint_names = figure.skeleton.names[: -1 if up == 'z' else None]
    assert joint_names[-1] == 'node0.4'


def test_instances_move_with_their_node_and_are_those_of_add_instances(glb):
    instanced(glb)
    glb.animate(0, 'translation', [0, 1, 2], [[0, 0, 0], [4, 0, 0], [4, 0, 0]])
    path = glb.write()
    figure = pvibr.read_gltf(path)
    still, moved = figure.posed(3)[0], figure.posed(3, figure.sample(1.5))[0]
    np.testing.assert_allclose(moved - still, [[4, 0, 0]] * 4, atol=1e-6)
    _, _, matrices = gltf_instances(path)
    world = figure.world()[[mesh.node for mesh in figure.meshes]]
    np.testing.assert_allclose(world, matrices, atol=1e-6)


def test_morphed_instances_share_the_weights_of_their_node(glb):
    instanced(glb)
    target = {'POSITION': glb.array(np.ones((4, 3)))}
    glb.json['meshes'][0]['primitives'][0]['targets'] = [target]
    glb.animate(0, 'weights', [0, 1], [0.25, 0.25])
    figure = pvibr.read_gltf(glb.write())
    assert figure.sample(0.5).weights.tolist() == [0.25] * 5


def test_many_instances_are_refused(glb):
    zeros = glb.add('accessors', componentType=5126, type='VEC3', count=10**9)
    extensions = {'EXT_mesh_gpu_instancing': {'attributes': {'TRANSLATION': zeros}}}
    glb.shown(glb.primitive(), extensions=extensions)
    refused('may need', pvibr.read_gltf, glb.write(), kind=GltfError)


def test_more_than_a_hundred_instances_are_left_to_add_instances(glb):
    instanced(glb, 101)
    with pytest.warns(pvibr.PvibrWarning, match=r'101 instances .*add_instances\(path\)'):
        assert len(pvibr.read_gltf(glb.write()).meshes) == 1


HIDDEN = {'KHR_node_visibility': {'visible': False}}


def test_hidden_nodes_and_all_below_them_are_left_out(glb):
    glb.add('nodes', extensions=HIDDEN, children=[1])
    glb.shown(glb.primitive())
    glb.shown(glb.primitive(), extensions={'KHR_node_visibility': {'visible': True}}, name='seen')
    glb.json['extensionsUsed'] = ['KHR_node_visibility']
    figure = pvibr.read_gltf(glb.write())
    assert [mesh.name for mesh in figure.meshes] == ['seen']
    assert len(figure.skeleton) == 3


def point(glb, pointer, times, values, interpolation='LINEAR', kind='f'):
    number = glb.animate(0, 'pointer', times, values, interpolation, kind)
    extension = {'KHR_animation_pointer': {'pointer': pointer}}
    target = glb.json['animations'][number]['channels'][0]['target']
    target.pop('node')
    target['extensions'] = extension
    glb.json['extensionsUsed'] = ['KHR_animation_pointer', 'KHR_node_visibility']


def test_visibility_that_is_animated(glb):
    glb.shown(glb.primitive(), extensions=HIDDEN, scale=[2, 3, 4])
    pointer = '/nodes/0/extensions/KHR_node_visibility/visible'
    point(glb, pointer, [0, 1, 2], [0, 1, 1], 'STEP', 'B')
    figure = pvibr.read_gltf(glb.write())
    assert figure.rest.scale.tolist() == [[0, 0, 0]]
    assert figure.sample(0.9).scale.tolist() == [[0, 0, 0]]
    assert figure.sample(1.1).scale.tolist() == [[2, 3, 4]]


@pytest.mark.parametrize(
    ('path', 'values', 'name'),
    [
        ('translation', [[0, 0, 0], [2, 0, 0]], 'translation'),
        ('scale', [[1, 1, 1], [2, 2, 2]], 'scale'),
        ('rotation', [[0, 0, 0, 1], [0, 0, 1, 0]], 'rotation'),
    ],
)
def test_pointers_to_what_joints_have(glb, path, values, name):
    node = glb.shown(glb.primitive())
    glb.animate(node, path, [0, 1], values)
    point(glb, f'/nodes/0/{path}', [0, 1], values)
    plain, pointed = pvibr.read_gltf(glb.write()).clips
    assert pointed.tracks[0].path == name
    np.testing.assert_array_equal(plain.tracks[0].values, pointed.tracks[0].values)


@pytest.mark.parametrize(
    'pointer', ['/materials/0/pbrMetallicRoughness/baseColorFactor', '/nodes/x/scale', '']
)
def test_other_pointers_are_named(glb, pointer):
    glb.shown(glb.primitive())
    point(glb, pointer, [0, 1], [[0] * 4] * 2)
    with pytest.warns(pvibr.PvibrWarning, match=f'animation of {pointer!r}'):
        assert pvibr.read_gltf(glb.write()).clips[0].tracks == ()


def test_a_pointer_to_no_node(glb):
    glb.shown(glb.primitive())
    point(glb, '/nodes/7/scale', [0, 1], [[1] * 3] * 2)
    with pytest.raises(GltfError, match=r'target.node must be below 1 .nodes., got 7'):
        pvibr.read_gltf(glb.write())


@pytest.mark.parametrize('order', [1, -1])
def test_visibility_and_scale_of_one_node(glb, order):
    glb.shown(glb.primitive())
    point(glb, '/nodes/0/scale', [0, 1], [[1] * 3] * 2)
    point(glb, '/nodes/0/extensions/KHR_node_visibility/visible', [0, 1], [0, 1], 'STEP', 'B')
    first, second = glb.json['animations']
    first['channels'].append(second['channels'][0] | {'sampler': 1})
    first['samplers'].append(second['samplers'][0])
    first['channels'] = first['channels'][::order]
    del glb.json['animations'][1]
    with pytest.warns(pvibr.PvibrWarning, match='scale and visibility of one node'):
        assert len(pvibr.read_gltf(glb.write()).clips[0].tracks) == 1
