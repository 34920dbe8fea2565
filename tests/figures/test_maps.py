"""Normal maps and emission of figures, beside meshes that have these normals and colours."""

from __future__ import annotations

import copy
import dataclasses
import io
import pickle

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from pvibr import Figure
from pvibr.animation import Pose, Skeleton, Skin
from pvibr.gl import set_fragment_uniforms
from pvibr.gl.hidden_window import rasterize
from pvibr.instances.bake import unlit_actor
from pvibr.instances.levels import content_key
from pvibr.maths.quaternions import from_axis_angle, to_matrices
from pvibr.maths.tones import to_display, to_light
from pvibr.maths.views import orthographic
from pvibr.meshes.parts import as_parts
from tests import pictures

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2.0
CORNERS = [[0, 1], [1, 1], [1, 0], [0, 0]]  # glTF's v goes down
#: Normals of the four quarters of the square, from the top left on, as a glTF map has them.
NORMALS = np.array([[[-0.6, 0, 0.8], [0, 0.6, 0.8]], [[0.48, -0.36, 0.8], [0, 0, 1.0]]])


def read(glb, tmp_path, image, material, corners=CORNERS, size=(1, 1, 1), **options):
    """The only mesh of a file of a square with a picture."""
    data = io.BytesIO()
    Image.fromarray(image).resize((64, 64), Image.Resampling.NEAREST).save(data, 'PNG')
    (tmp_path / 'map.png').write_bytes(data.getvalue())
    glb.add('images', uri='map.png')
    glb.add('samplers', magFilter=9728, minFilter=9728)
    glb.add('textures', source=0, sampler=0)
    glb.add('materials', **material)
    uv = {'TEXCOORD_0': glb.array(corners)}
    glb.shown(glb.primitive(points=SQUARE * size, material=0, attributes=uv))
    return pvibr.read_gltf(glb.write(), **options).meshes[0]


def pixels(values):
    return np.clip(np.asarray(values) * 127.5 + 128, 0, 255).astype(np.uint8)


def stage():
    pl = pictures.plotter((80, 60), lighting='none')
    pl.add_light(pv.Light(position=(4, 2, 6), light_type='scene light', intensity=0.8))
    pl.set_background('black')
    return pl


def shot(pl):
    return pictures.shown(pictures.place(pl, (0.3, -0.4, 3.0), up=(0, 1, 0)))


def quarters(turn, normals, size=(1, 1, 1), **look):
    """A picture of four squares with these normals, turned about the origin."""
    pl = stage()
    for row in range(2):
        for column in range(2):
            points = (SQUARE / 2 + [0.5 * column - 0.25, 0.25 - 0.5 * row, 0]) * size
            made = pv.PolyData.from_regular_faces(points @ turn.T, [[0, 1, 2], [0, 2, 3]])
            made.point_data['Normals'] = np.tile(normals[row, column] @ turn.T, (4, 1))
            made.point_data.active_normals_name = 'Normals'
            pl.add_mesh(made, smooth_shading=True, split_sharp_edges=False, **look)
    return shot(pl)


@pytest.mark.parametrize('pbr', [False, True], ids=['phong', 'pbr'])
@pytest.mark.parametrize('mirrored', [False, True], ids=['plain', 'mirrored'])
@pytest.mark.parametrize('size', [(1, 1, 1), (1.5, 0.5, 1)], ids=['square', 'long'])
def test_a_normal_map_leans_the_normals_of_a_posed_skin(glb, tmp_path, pbr, mirrored, size):
    rough = {'metallicFactor': 0.0, 'roughnessFactor': 0.7, 'baseColorFactor': [0.5, 0.5, 0.5, 1]}
    material = {'normalTexture': {'index': 0}, 'pbrMetallicRoughness': rough}
    corners = [[1 - u, v] for u, v in CORNERS] if mirrored else CORNERS
    body = read(glb, tmp_path, pixels(NORMALS), material, corners, size, pbr=pbr)
    ones = np.ones((4, 1))
    skin = Skin([0], [np.eye(4)], ones.astype(int) * 0, ones)
    figure = Figure([dataclasses.replace(body, node=-1, skin=skin)], Skeleton([-1], [np.eye(4)]))
    spin = from_axis_angle([1.0, 0.5, 0.2], 0.5)
    pl = stage()
    actor = pl.ibr.add_animated(figure)
    actor.pose = Pose([[0.0, 0, 0]], [spin])
    normals = NORMALS[:, ::-1] * [-1, 1, 1] if mirrored else NORMALS
    look = {k: v for k, v in body.look.items() if k not in ('smooth_shading', 'pbr_textures')}
    theirs = quarters(to_matrices(np.array(spin)), normals, size, **look)
    ours = shot(pl)
    assert len(np.unique(theirs.reshape(-1, 3), axis=0)) >= 4
    assert (np.abs(ours - theirs).max(-1) > 4).sum() <= 60  # the borders of the quarters
    actor.pose = Pose([[0.0, 0, 0]])
    assert (np.abs(shot(pl) - ours).max(-1) > 4).sum() > 300


def test_the_scale_of_a_normal_map(glb, tmp_path):
    material = {'normalTexture': {'index': 0, 'scale': 0.5}}
    body = read(glb, tmp_path, pixels(NORMALS), material)
    leaning = NORMALS * [0.5, 0.5, 1]
    leaning /= np.linalg.norm(leaning, axis=-1, keepdims=True)
    pl = stage()
    pl.ibr.add_animated(Figure([dataclasses.replace(body, node=-1)]))
    look = {k: v for k, v in body.look.items() if k not in ('smooth_shading', 'pbr_textures')}
    apart = np.abs(shot(pl) - quarters(np.eye(3), leaning, **look)).max(-1)
    assert (apart > 4).sum() <= 60


@pytest.mark.parametrize('textured', [False, True], ids=['factor', 'texture'])
@pytest.mark.parametrize('pbr', [False, True], ids=['phong', 'pbr'])
def test_emitted_light_is_added_to_that_which_is_reflected(glb, tmp_path, pbr, textured):
    image = np.uint8([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]])
    glow = {'emissiveFactor': [0.2, 0.4, 0.1]}
    glow |= {'emissiveTexture': {'index': 0}} if textured else {}
    rough = {'metallicFactor': 0.0, 'baseColorFactor': [0.3, 0.3, 0.3, 1]}
    body = read(glb, tmp_path, image, glow | {'pbrMetallicRoughness': rough}, pbr=pbr)
    dark = {k: v for k, v in body.look.items() if k not in ('pbr_textures', 'emissive_factor')}
    found = []
    for look in (body.look, dark):
        pl = stage()
        pl.ibr.add_animated(Figure([dataclasses.replace(body, node=-1, look=look)]))
        found.append(shot(pl)[[24, 24, 36, 36], [33, 47, 33, 47]])
    lit, without = (to_light(p / 255.0) for p in found)
    light = to_light(image.reshape(4, 3) / 255.0) if textured else np.ones((4, 3))
    assert np.abs(to_display(without + light * glow['emissiveFactor']) * 255 - found[0]).max() <= 4
    assert (lit > without + 0.05).any()


def test_emission_maps_of_users_are_taken_as_pictures(glb, tmp_path):
    """VTK refuses those that are not said to be in sRGB; what has none of it shines white."""
    image = np.uint8([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]])
    glow = {'emissiveFactor': [0.6, 0.6, 0.6], 'emissiveTexture': {'index': 0}}
    body = read(glb, tmp_path, image, glow)
    plain = body.look['pbr_textures']['emissiveTex'].copy()
    plain.SetUseSRGBColorSpace(False)
    look = body.look | {'pbr_textures': {'emissiveTex': plain}}
    ours, theirs = stage(), stage()
    ours.ibr.add_animated(Figure([dataclasses.replace(body, node=-1, look=look)]))
    theirs.ibr.add_animated(Figure([dataclasses.replace(body, node=-1)]))
    assert np.array_equal(shot(ours), shot(theirs))
    assert not plain.GetUseSRGBColorSpace()


def test_a_material_that_is_replaced_draws_without_maps(glb, tmp_path):
    material = {'normalTexture': {'index': 0}, 'emissiveFactor': [0.2, 0, 0]}
    body = read(glb, tmp_path, pixels(NORMALS), material)
    pl = stage()
    actor = pl.ibr.add_animated(Figure([dataclasses.replace(body, node=-1)]))
    before = shot(pl)
    (drawn,) = actor.actors()
    drawn.prop = pv.Property(color='white')
    after = shot(pl)
    assert len(np.unique(after[25:36, 35:46].reshape(-1, 3), axis=0)) < 4
    assert np.abs(before - after).max() > 20
    drawn.prop.lighting = False
    assert shot(pl).max() > 200


@pytest.mark.parametrize('textured', [False, True], ids=['factor', 'texture'])
def test_images_are_brighter_where_light_is_emitted(glb, tmp_path, textured):
    image = np.uint8([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [0, 0, 0]]])
    emitted = np.array([0.3, 0.1, 0.2])
    glow = {'emissiveFactor': emitted.tolist()}
    glow |= {'emissiveTexture': {'index': 0}} if textured else {}
    rough = {'metallicFactor': 0.0, 'baseColorFactor': [0.2, 0.2, 0.2, 1]}
    body = read(glb, tmp_path, image, glow | {'pbrMetallicRoughness': rough})
    (part,) = as_parts(body.mesh, **body.look)
    actor = unlit_actor(part)
    set_fragment_uniforms((actor,), {'ibr_object_from_view': np.eye(3)})
    size = np.ptp(body.points, axis=0).max() / 2
    view = orthographic(np.eye(3), (-size, -size, -1.0), (size, size, 1.0))
    found, _ = rasterize([actor], view, (8, 8), ('rgba8', 'rgba8'), samples=1)
    found = found[[6, 6, 1, 1], [1, 6, 1, 6]] / 255.0
    light = to_light(image.reshape(4, 3) / 255.0) if textured else np.ones((4, 3))
    base = to_light(np.array(body.look['color'], float))
    assert (found[:, 3] == 1).all()
    assert np.abs(to_display(base + light * emitted) - found[:, :3]).max() < 0.02
    other = dict(body.look, emissive_factor=(0.3, 0.1, 0.3))
    keys = [content_key(as_parts(body.mesh, **look)) for look in (body.look, body.look, other)]
    assert keys[0] == keys[1] != keys[2]


def test_instances_have_the_maps(glb, tmp_path):
    """Meshes of instances are drawn many at once, and one by one."""
    material = {'normalTexture': {'index': 0}, 'emissiveFactor': [0.1, 0, 0]}
    read(glb, tmp_path, pixels(NORMALS), material)
    figure = pvibr.read_gltf(tmp_path / 'figure.glb')
    pl = stage()
    pl.ibr.add_animated(figure)
    ours = shot(pl)
    for count in (1, 3):
        many = stage()
        places = [[0.0, 0, 0], [50, 0, 0], [60, 0, 0]][:count]
        many.ibr.add_instances(tmp_path / 'figure.glb', places, bake=False)
        assert (np.abs(shot(many) - ours).max(-1) > 2).sum() <= 5


@pytest.mark.parametrize('copied', [lambda f: pickle.loads(pickle.dumps(f)), copy.deepcopy])  # noqa: S301
def test_pickles_and_copies_of_figures_keep_their_textures(glb, tmp_path, copied):
    material = {'normalTexture': {'index': 0}, 'emissiveTexture': {'index': 0}}
    material |= {'pbrMetallicRoughness': {'baseColorTexture': {'index': 0}}}
    read(glb, tmp_path, pixels(NORMALS), material)
    glb.add('nodes', mesh=0, translation=[5, 0, 0])
    figure = pvibr.read_gltf(glb.write())
    again = copied(figure)
    first, second = (mesh.look['texture'] for mesh in again.meshes)
    assert first is second
    assert first is not figure.meshes[0].look['texture']
    found = []
    for shown in (figure, again):
        pl = stage()
        pl.ibr.add_animated(shown)
        found.append(shot(pl))
    assert np.ptp(found[0]) > 50
    assert np.array_equal(*found)
