"""Every stand-in after every change: the next frame is that of the changed scene."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from pvibr.gl.mipmaps import MipTexture
from pvibr.gl.texture import Texture
from tests.effects.test_accumulation import stale
from tests.pictures import off, place, plotter, shot

EYE, SIZE = (0.5, -6.0, 3.0), (100, 75)


def slope(*color):
    """Return an image that brightens from left to right."""
    return np.rint(np.linspace(0.3, 1, 8)[:, None] * color * np.ones((8, 1, 1))).astype(np.uint8)


def ball():
    mesh = pv.Sphere(radius=0.9, center=(-0.9, 0, 0), theta_resolution=16, phi_resolution=12)
    mesh['s'] = mesh.points[:, 2].copy()
    mesh['t'] = mesh.points[:, 0].copy()
    return mesh


def scene():
    """Return a plotter with a coloured ball, a textured plate, a floor and three lights."""
    pl = plotter(SIZE, lighting='none')
    pl.set_background('midnightblue')
    mesh, image = ball(), pv.Texture(slope(250, 80, 60))
    made = SimpleNamespace(pl=pl, mesh=mesh, image=image, twins=[])
    looks = {'scalars': 's', 'cmap': 'viridis', 'show_scalar_bar': False, 'specular': 0.4}
    made.ball = pl.add_mesh(mesh, name='ball', smooth_shading=False, **looks)
    plate = pv.Plane(center=(0.9, 0, 0), direction=(0.2, -1, 0.3), i_size=1.4, j_size=1.4)
    made.facade = plate
    made.plate = pl.add_mesh(plate, texture=image, name='plate')
    made.floor = pl.add_mesh(pv.Plane(center=(0, 0, -1.2), i_size=9, j_size=9), color='gray')
    made.sun = pv.Light(position=(3, -5, 9), light_type='scene light', intensity=0.4)
    made.lamp = pv.Light(
        position=(-3, -4, 3),
        positional=True,
        cone_angle=35,
        light_type='scene light',
        intensity=0.5,
    )
    made.camera_light = pv.Light(light_type='camera light', position=(1, 0, 1), intensity=0.2)
    made.turn = _vtk.vtkMatrix4x4()
    made.turn.SetElement(0, 0, -1.0)
    for light in (made.sun, made.lamp, made.camera_light):
        pl.add_light(light)
    place(pl, EYE)
    pl.show(auto_close=False)
    shot(pl)
    return made


def user_matrix(actor):
    matrix = np.eye(4)
    matrix[0, 3] = 0.2
    actor.user_matrix = matrix


def moved_matrix(actor):
    actor.GetUserMatrix().SetElement(2, 3, 0.25)


def user_transform(actor):
    actor.transform = _vtk.vtkTransform()
    actor.SetUserTransform(actor.transform)


def clip(actor):
    plane = _vtk.vtkPlane()
    plane.SetOrigin(-0.9, 0, 0)
    plane.SetNormal(0.3, 0, -1)
    actor.mapper.AddClippingPlane(plane)


def drag(actor):
    actor.mapper.GetClippingPlanes().GetItem(0).SetOrigin(-0.9, 0, 0.5)


def table_value(actor):
    for k in range(128):
        actor.mapper.lookup_table.SetTableValue(k, 1, 0, 1)


def another_mesh(actor):
    actor.mapper.dataset = pv.Cube(center=(-0.9, 0, 0), x_length=1.2)


def backface(actor):
    actor.prop.culling = 'front'
    actor.backface_prop = pv.Property(color='lime')


def each(name, value):
    """Return a change of a part of what is given, by its path."""
    *path, last = name.split('.')

    def change(owner):
        for part in path:
            owner = getattr(owner, part)
        setattr(owner, last, value)

    return change


ACTOR = {
    'color map': each('mapper.lookup_table.cmap', 'autumn'),
    'scalar range': each('mapper.scalar_range', (-0.5, 0.5)),
    'table in place': table_value,
    'other array': lambda actor: actor.mapper.set_scalars(actor.mapper.dataset['t'], 't'),
    'clipping plane': clip,
    'clipping plane in place': drag,
    'no clipping planes': lambda actor: actor.mapper.RemoveAllClippingPlanes(),
    'no scalars': each('mapper.scalar_visibility', False),
    'color': each('prop.color', 'orange'),
    'ambient': each('prop.ambient', 0.4),
    'diffuse': each('prop.diffuse', 0.6),
    'specular': each('prop.specular', 0.9),
    'specular power': each('prop.specular_power', 4.0),
    'specular color': each('prop.specular_color', 'cyan'),
    'interpolation': each('prop.interpolation', 'Gouraud'),
    'position': each('position', (0, -0.3, 0.2)),
    'orientation': each('orientation', (20, 0, 30)),
    'scale': each('scale', (1, 1, 1.3)),
    'user matrix': user_matrix,
    'user matrix in place': moved_matrix,
    'user transform': user_transform,
    'user transform in place': lambda actor: actor.transform.Translate(0, 0, -0.3),
    'culling': backface,
    'back': each('backface_prop.color', 'red'),
    'no culling': each('prop.culling', 'none'),
    'unlit': each('prop.lighting', False),
    'lit': each('prop.lighting', True),
    'hidden': each('visibility', False),
    'shown': each('visibility', True),
}
#: What is followed by all that has a material, and by all that has a place.
LOOKS = {'color', 'ambient', 'diffuse', 'specular', 'unlit', 'lit', 'hidden', 'shown'}
PLACES = {k for k in ACTOR if k.split()[0] in ('position', 'orientation', 'scale', 'user')}
PLACES |= {'hidden', 'shown', 'clipping plane', 'clipping plane in place', 'no clipping planes'}
#: What is drawn as a mesh while it moves, and as an image afterwards.
COMES_TO_REST = {'clipping plane', 'clipping plane in place'}
MESH = {
    'points in place': lambda mesh: mesh.points.__setitem__(..., mesh.points * [1, 1, 1.2]),
    'points': lambda mesh: setattr(mesh, 'points', mesh.points * [1, 1, 0.7]),
    'scalars in place': lambda mesh: mesh['s'].__setitem__(..., -mesh['s']),
    'cells': lambda mesh: setattr(mesh, 'faces', mesh.faces[: len(mesh.faces) // 8 * 4]),
}
TEXTURE = {
    'image in place': lambda s: (
        s.image.GetInput().GetPointData().GetScalars().Fill(90) or s.image.GetInput().Modified()
    ),
    'image': lambda s: s.image.SetInputData(pv.Texture(slope(60, 250, 60)).GetInput()),
    'texture': each('plate.texture', pv.Texture(slope(40, 90, 250))),
}
LIGHT = {
    'sun moves': each('sun.position', (-4, -5, 6)),
    'sun aims': each('sun.focal_point', (2, 1, 0)),
    'sun dims': each('sun.intensity', 0.2),
    'sun color': each('sun.diffuse_color', (1.0, 0.8, 0.3)),
    'lamp moves': each('lamp.position', (-2, -7, 2)),
    'lamp cone': each('lamp.cone_angle', 8.0),
    'lamp aims': each('lamp.focal_point', (-0.9, 0, 0.5)),
    'lamp wide': each('lamp.cone_angle', 25.0),
    'lamp exponent': each('lamp.exponent', 4.0),
    'lamp attenuation': each('lamp.attenuation_values', (0.5, 0.1, 0.0)),
    'lamp off': each('lamp.on', False),
    'lamp on': each('lamp.on', True),
    'camera light moves': each('camera_light.position', (-1.5, 0.5, 1)),
    'camera light': each('camera_light.intensity', 0.5),
    'transform': lambda s: s.sun.SetTransformMatrix(s.turn),
    'light to camera': lambda s: s.sun.set_camera_light(),
    'light to head': lambda s: s.sun.set_headlight(),
    'another light': lambda s: s.pl.add_light(
        pv.Light(position=(0, -9, 1), light_type='scene light', intensity=0.4)
    ),
    'a light less': lambda s: s.pl.renderer.RemoveLight(s.lamp),
}


def plain(s, standin):
    """Return the picture without the stand-in."""
    standin.enabled = False
    found = shot(s.pl)
    standin.enabled = True
    shot(s.pl)
    return found


def afresh(s, standin):
    """Return the picture with all made anew."""
    standin.release()
    return shot(s.pl)


def through_camera(s, _standin):
    """Return the picture of the scene by the camera of a live texture."""
    s.pl.camera.parallel_projection = False
    place(s.pl, EYE)
    found = shot(s.pl)
    look_at_screen(s.pl)
    return found


def look_at_screen(pl):
    place(pl, (0, 0, 60), (0, 0, 50), (0, 1, 0), parallel=0.5 * SIZE[1] / SIZE[0])


def screen(s, live):
    """Fill the view with a live texture."""
    plate = pv.Plane(center=(0, 0, 50), i_size=1, j_size=SIZE[1] / SIZE[0])
    s.pl.add_mesh(plate, color='white', lighting=False).texture = live.texture
    look_at_screen(s.pl)
    return live


def impostor(s, **settings):
    return s.pl.ibr.add_impostor([s.ball, s.plate], only_if_faster=False, **settings)


def live_texture(s):
    camera = pv.Camera()
    camera.position, camera.up, camera.view_angle = EYE, (0, 0, 1), 30.0
    actors = [s.ball, s.plate, s.floor]
    return screen(s, s.pl.ibr.add(pvibr.LiveTexture(camera, actors, size=SIZE)))


def mirror(s):
    s.floor.visibility = False
    live = s.pl.ibr.add(pvibr.Mirror((-2, -2, -1), (4, 0, 0), (0, 4, 0), size=SIZE))
    s.pl.add_mesh(
        pv.Plane(center=(0, 0, -1), i_size=4, j_size=4), lighting=False
    ).texture = live.texture
    return live


def projector(s):
    above = pvibr.Orthographic.from_extent(-3, 3, -3, 3, zmax=4)
    picture = np.tile(np.uint8([250, 60, 10]), (16, 16, 1))
    return s.pl.ibr.add(pvibr.Projector(picture, above, resolution=256))


def shadows(s, **settings):
    return s.pl.ibr.add(pvibr.Shadows(resolution=256, **settings))


def beside(s, things, share=0.0):
    """Hide the actors that things are drawn beside, which change as these do."""
    s.twins = [s.ball, s.plate] if len(things) > 1 else [s.ball]
    s.ball, s.things = things[0], things
    for twin in s.twins:
        twin.visibility = False
    return things[0]


def twins(s, _standin):
    """Return the picture with the actors themselves."""
    shown = s.ball.visibility
    for thing, twin in zip(s.things, s.twins, strict=True):
        thing.visibility, twin.visibility = False, shown or thing is not s.ball
    found = shot(s.pl)
    for thing, twin in zip(s.things, s.twins, strict=True):
        thing.visibility, twin.visibility = shown or thing is not s.ball, False
    return found


def instances(s):
    looks = {'show_scalar_bar': False, 'bake': True, 'force_level': 'blended', 'progress': False}
    colors = {'scalars': 's', 'cmap': 'viridis', 'specular': 0.4, 'smooth_shading': False}
    balls = s.pl.ibr.add_instances(s.mesh, [[0, 0, 0]], **colors, **looks)
    plates = s.pl.ibr.add_instances(s.facade, [[0, 0, 0]], texture=s.image, **looks)
    return beside(s, [balls, plates])


def cloud(s):
    found = s.mesh.ibr.billboard_cloud(epsilon=0.03, size=256, scalars='s', cmap='viridis')
    return beside(s, [found.add_to(s.pl)])


CASES = {
    'impostor': (impostor, plain, 0.03),
    'hierarchy': (lambda s: impostor(s, hierarchical=True), plain, 0.03),
    'layers': (
        lambda s: s.pl.ibr.add_image_layers([[s.ball, s.plate]], only_if_faster=False),
        plain,
        0.01,
    ),
    'live texture': (live_texture, through_camera, 0.06),
    'mirror': (mirror, afresh, 0.0),
    'projector': (projector, afresh, 0.0),
    'shadows': (lambda s: shadows(s, method='hard'), afresh, 0.0),
    'volumes': (lambda s: shadows(s, method='volume'), afresh, 0.0),
    'instances': (instances, twins, 0.02),
    'billboard cloud': (cloud, twins, 0.06),
}


def counts(standin):
    """Return how often anything was drawn for a stand-in."""
    if not hasattr(standin, 'report'):
        return {}
    names = 'rendered', 'taken', 'draws', 'views drawn', 'masks drawn'
    return {k: v for k, v in standin.report().items() if k in names}


def changes(s, name):
    """Yield the changes that a stand-in follows."""
    looks = {k: change for k, change in ACTOR.items() if k in LOOKS}
    places = {k: change for k, change in ACTOR.items() if k in PLACES}
    groups = {'instances': (looks, MESH, {'image in place': TEXTURE['image in place']}, LIGHT)}
    groups['billboard cloud'] = places, {}, {}, LIGHT
    actor, mesh, texture, light = groups.get(name, (ACTOR, MESH, TEXTURE, LIGHT))
    actors = [s.ball, *s.twins[:1]]
    for owners, group in (([s.mesh], mesh), (actors, actor), ([s], texture), ([s], light)):
        for what, change in group.items():
            yield what, lambda change=change, owners=owners: [change(owner) for owner in owners]


def counted_uploads(monkeypatch) -> list:
    """Return a list that gets the bytes of each upload from now on."""
    uploads: list = []
    for kind in (Texture, MipTexture):
        upload = kind.upload
        monkeypatch.setattr(
            kind,
            'upload',
            lambda self, array, upload=upload: uploads.append(array.nbytes) or upload(self, array),
        )
    return uploads


@pytest.mark.sampled
@pytest.mark.parametrize('name', CASES)
def test_many_frames_without_change_take_nothing(name, monkeypatch):
    s = scene()
    standin = CASES[name][0](s)
    uploads = counted_uploads(monkeypatch)
    for move in (lambda: None, lambda: setattr(s.pl.camera, 'azimuth', 20.0)):
        move()
        for _ in range(6):
            s.pl.render()  # costs are measured, and what is cheaper is chosen
        before, count = shot(s.pl), counts(standin)
        uploads.clear()
        for _ in range(30):
            s.pl.render()
        assert (counts(standin), uploads) == (count, [])
        assert np.array_equal(shot(s.pl), before)


@pytest.mark.sampled
@pytest.mark.parametrize('name', CASES)
def test_the_next_frame_shows_it(name, monkeypatch):
    make, reference, share = CASES[name]
    s = scene()
    standin = make(s)
    assert standin is not None
    shot(s.pl)
    uploads = counted_uploads(monkeypatch)
    wrong, idle, before = {}, {}, shot(s.pl)
    for what, change in changes(s, name):
        change()
        found = shot(s.pl)
        rested = shot(s.pl)  # what VTK's first drawing of something new changes
        uploads.clear()
        count, again = counts(standin), shot(s.pl)
        last = rested if what in COMES_TO_REST else found
        if counts(standin) != count or uploads or (off(again, last) > 2).any():
            idle[what] = count, counts(standin), sum(uploads), int(off(again, last).max())
        truth = reference(s, standin)
        if (off(found, truth) > 40).mean() > share or np.abs(
            found - truth
        ).mean() > 2 + 50 * share:
            wrong[what] = round((off(found, truth) > 40).mean(), 3), np.abs(found - truth).mean()
        if reference in (plain, twins) and (off(truth, before) > 4).mean() < 0.002:
            idle[f'{what} shows nothing'] = 0
        before = truth
    assert all(row.state != 'off' for row in s.pl.ibr.report().rows), s.pl.ibr.report()
    assert (wrong, idle) == ({}, {})


@pytest.mark.parametrize('name', ['impostor', 'layers'])
def test_images_show_a_live_texture_as_it_is_now(name):
    s = scene()
    standin = CASES[name][0](s)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (-1, -6, 1), (-0.9, 0, 0), (0, 0, 1)
    live = s.pl.ibr.add(pvibr.LiveTexture(camera, [s.ball], size=(64, 64)))
    s.plate.texture = live.texture
    for change in ('position', 'no scalars'):
        ACTOR[change](s.ball)
        found, draws = shot(s.pl), live.draws
        shot(s.pl)
        assert live.draws == draws
        assert np.abs(found - plain(s, standin)).mean() < 1  # also of what it sees itself


@pytest.mark.slow
def test_nothing_is_drawn_again_for_what_others_have_drawn():
    """Points and lines are scaled while they are drawn in other views."""
    s = scene()
    dots = pv.PolyData([[0.0, 0, 1], [0.5, 0, 1]])
    s.pl.add_mesh(dots, point_size=6, render_points_as_spheres=True)
    s.pl.add_mesh(pv.Line(), line_width=4)
    standins = [CASES[name][0](s) for name in ('projector', 'shadows', 'mirror', 'layers')]
    for _ in range(3):
        shot(s.pl)
    before = [counts(standin) for standin in standins]
    shot(s.pl)
    assert [counts(standin) for standin in standins] == before


def test_a_still_view_begins_again():
    s = scene()
    still = s.pl.ibr.add(pvibr.Accumulation(2))
    assert stale(s.pl, still, changes(s, '')) == {}
