"""Costs of glTF files: equal things are read once, unlike ones count against the file's size."""

import numpy as np
import pytest

import pvibr
from pvibr.animation import GltfError, Pose, Skeleton
from pvibr.animation import gltf_meshes as gltf_meshes
from pvibr.animation import gltf_nodes as gltf_nodes
from pvibr.io import gltf_file
from tests.makers import png

FLAT = {'NORMAL': None}


@pytest.fixture
def calls(monkeypatch):
    """Count calls of a function of a module."""

    def count(module, name):
        found, plain = [], getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, **k: found.append(a) or plain(*a, **k))
        return found

    return count


def test_equal_primitives_are_one_surface(glb):
    glb.shown(*[glb.primitive()] * 5000, {'attributes': {'POSITION': 0}, 'mode': 6})
    figure = pvibr.read_gltf(glb.write())
    assert len({id(mesh.mesh) for mesh in figure.meshes}) == 2
    assert figure.meshes[4999].mesh.n_points == 4
    assert figure.meshes[4999].name == 'node0.4999'


@pytest.mark.parametrize('painted', [False, True])
def test_materials_share_points_but_looks_and_vertex_colours_are_their_own(glb, painted):
    colors = {'COLOR_0': glb.array(np.ones((4, 3)))} if painted else {}
    one = glb.primitive()
    one['attributes'] = one['attributes'] | colors
    for color in ([1, 0, 0, 1], [0, 0, 1, 1]):
        glb.add('materials', pbrMetallicRoughness={'baseColorFactor': color})
    glb.shown(*[one | {'material': k} for k in (0, 1, 0)])
    meshes = pvibr.read_gltf(glb.write()).meshes
    assert len({id(mesh.mesh) for mesh in meshes}) == 1 + painted
    names = [mesh.look.get('scalars') for mesh in meshes]
    found = [
        mesh.mesh[name][0] / 255 if name else mesh.look['color']
        for mesh, name in zip(meshes, names, strict=True)
    ]
    np.testing.assert_array_equal(found, np.array([[1, 0, 0], [0, 0, 1], [1, 0, 0]]))


def test_unlike_primitives_beyond_the_size_of_the_file_are_refused(glb, monkeypatch):
    monkeypatch.setattr(gltf_file, '_BASE_BUDGET', 2**22)
    points = [glb.array(np.eye(3) * k) for k in range(1, 21)]
    corners = [glb.array([0, 1, 2], 'B') for _ in range(20)]
    every = [{'attributes': {'POSITION': p}, 'indices': c} for p in points for c in corners]
    glb.shown(*every)
    with pytest.raises(GltfError, match=r'primitives\[\d+\] needs (\d+) MiB.* may need \1 MiB'):
        pvibr.read_gltf(glb.write())


def test_equal_targets_share_their_differences(glb, calls):
    target = {'POSITION': glb.array(np.ones((4, 3)))}
    other = {'POSITION': glb.array(np.eye(4)[:, 1:])}
    glb.shown(glb.primitive(targets=[target, other] * 5000, attributes=FLAT))
    flat = calls(gltf_meshes, '_flat_normals')
    figure = pvibr.read_gltf(glb.write())
    (mesh,) = figure.meshes
    assert len(mesh.morphs) == 10_000
    for what in ('positions', 'normals'):
        kept = {id(mesh.morphs.target(what, i)[1]) for i in range(10_000)}
        assert len(kept) == 2
    assert len(flat) < 10
    weights = np.zeros(10_000)
    weights[-1] = 0.5
    lower, upper = figure.bounds(figure.rest.replaced(weights=weights)).reshape(3, 2).T
    assert (upper - lower)[2] == pytest.approx(0.5, rel=1e-4)


def test_flat_normals_of_targets_are_those_of_the_moved_points(glb):
    rng = np.random.default_rng(7)
    moves = rng.normal(size=(9, 4, 3)).astype(np.float32)
    targets = [{'POSITION': glb.array(move)} for move in moves]
    points = rng.normal(size=(4, 3)).astype(np.float32)
    glb.shown(glb.primitive(points, targets=targets, attributes=FLAT))
    (mesh,) = pvibr.read_gltf(glb.write()).meshes
    corners = [0, 1, 2, 0, 2, 3]
    for i, move in enumerate(moves):
        a, b, c = np.moveaxis((points.astype(float) + move)[corners].reshape(2, 3, 3), 1, 0)
        wanted = np.cross(b - a, c - a)
        wanted = np.repeat(wanted / np.linalg.norm(wanted, axis=1, keepdims=True), 3, 0)
        found = mesh.normals + mesh.morphs.total('normals', np.eye(9)[i], 6)
        np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_names_of_targets_and_joints_of_skins_are_read_once(glb, calls):
    target = {'POSITION': glb.array(np.ones((4, 3)))}
    everywhere = glb.array(np.zeros((4, 4)), 'B'), glb.array(np.tile([1, 0, 0, 0], (4, 1)))
    attributes = dict(zip(('JOINTS_0', 'WEIGHTS_0'), everywhere, strict=True))
    every = [glb.primitive(targets=[target], attributes=attributes) for _ in range(20)]
    glb.shown(*every, mesh={'extras': {'targetNames': ['smile']}}, skin=0)
    glb.add('skins', joints=[0])
    decoded = calls(gltf_meshes.msgspec.json, 'decode')
    bound = calls(gltf_meshes, 'bind_of')
    figure = pvibr.read_gltf(glb.write())
    assert {mesh.morphs.names for mesh in figure.meshes} == {('smile',)}
    assert len(bound) == 1
    assert len(decoded) == 2  # the file, and the names


def test_pictures_are_decoded_once(glb, calls):
    from pvibr.animation.gltf_images import Pictures

    image = glb.add('images', bufferView=glb.view(png([[[255, 0, 0]]])))
    for k in range(20):
        glb.add('samplers', magFilter=9728)
        glb.add('textures', source=image, sampler=k)
        color = {'baseColorTexture': {'index': k}}
        glb.add('materials', pbrMetallicRoughness=color)
    coordinates = {'TEXCOORD_0': glb.array(np.zeros((4, 2)))}
    one = glb.primitive(attributes=coordinates)
    glb.shown(*[one | {'material': k} for k in range(20)])
    decoded = calls(Pictures, '_decoded')
    figure = pvibr.read_gltf(glb.write())
    assert len({id(mesh.look['texture']) for mesh in figure.meshes}) == 20
    assert len(decoded) == 1


@pytest.mark.parametrize('seed', range(3))
def test_levels_and_children_of_any_forest(seed):
    rng = np.random.default_rng(seed)
    n = 200
    place = rng.permutation(n)
    parents = np.full(n, -1)
    for i in range(1, n):
        if rng.random() < 0.9:
            parents[place[i]] = place[rng.integers(max(0, i - 5), i)]
    skeleton = Skeleton(parents, Pose(rng.normal(size=(n, 3))))

    def depth(joint):
        return 0 if parents[joint] < 0 else 1 + depth(parents[joint])

    found = {joint: k for k, level in enumerate(skeleton.levels) for joint in level.tolist()}
    assert found == {joint: depth(joint) for joint in range(n)}
    for joint, children in enumerate(skeleton.children):
        assert children.tolist() == np.flatnonzero(parents == joint).tolist()


def test_many_nodes_are_checked_at_once(glb, calls):
    glb.json['nodes'] = [{'children': list(range(1, 3001))}, *({} for _ in range(3000))]
    followed = calls(gltf_nodes, 'follow')
    figure = pvibr.read_gltf(glb.write())
    assert (figure.skeleton.parents == [-1] + [0] * 3000).all()
    assert len(followed) == 0
