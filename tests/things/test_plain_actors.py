"""Props that are no plain actor: every buffer and effect takes them for equal plain ones."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from tests.marks import slow
from tests.pictures import depth_buffer, depths, place, plotter, shot

SIZE = (132, 96)
CUBE = pv.Cube()
CONE = pv.Cone(resolution=12, height=1.2)
BALL = pv.Sphere(radius=0.6, theta_resolution=24, phi_resolution=24)


def mapper_of(mesh, kind=_vtk.vtkPolyDataMapper):
    mapper = kind()
    mapper.SetInputDataObject(mesh)
    return mapper


def actor_of(mesh, matrix=None):
    actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
    actor.prop.color = 'tan'
    if matrix is not None:
        actor.user_matrix = matrix
    return actor


def matrix_of(prop):
    return pv.array_from_vtkmatrix(prop.GetMatrix())


def moved(*position):
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


def facing(camera, position):
    """The matrix that turns z to the eye, y up in the picture."""
    position, eye = np.array(position, float), np.array(camera.position)
    z = (eye - position) / np.linalg.norm(eye - position)
    right = np.cross(camera.direction, camera.up)
    y = np.cross(z, right / np.linalg.norm(right))
    y /= np.linalg.norm(y)
    matrix = moved(*position)
    matrix[:3, :3] = np.stack([np.cross(y, z), y, z], 1)
    return matrix


def colored(prop, mesh):
    prop.GetProperty().SetColor(*pv.Color('tan').float_rgb)
    prop.SetMapper(mapper_of(mesh))
    return prop


# Each returns a prop and the meshes and matrices of the plain actors that it is like.


def follower(pl, kind=pv.DataSetMapper):
    prop = pv.Follower(mapper=mapper_of(CUBE, kind))
    prop.prop.color, prop.position, prop.camera = 'tan', (0.2, 0.1, 0.3), pl.camera
    return prop, [(CUBE, facing(pl.camera, prop.position))]


def follower_by_polydata(pl):
    return follower(pl, _vtk.vtkPolyDataMapper)


def lod_actor(pl):
    prop = colored(_vtk.vtkLODActor(), BALL)
    prop.SetPosition(0.3, 0, 0.2)
    return prop, [(BALL, moved(0.3, 0, 0.2))]


def quadric_lod_actor(pl):
    prop = colored(_vtk.vtkQuadricLODActor(), BALL)
    prop.SetPosition(0.3, 0, 0.2)
    return prop, [(BALL, moved(0.3, 0, 0.2))]


def lod_prop(pl):
    prop, look = _vtk.vtkLODProp3D(), _vtk.vtkProperty()
    look.SetColor(*pv.Color('tan').float_rgb)
    prop.AddLOD(mapper_of(CUBE), look, 0.0)
    shown = prop.AddLOD(mapper_of(CONE), look, 0.0)
    prop.AutomaticLODSelectionOff()
    prop.SetSelectedLODID(shown)
    prop.SetPosition(0, 0.2, 0.3)
    prop.RotateZ(30)
    return prop, [(CONE, matrix_of(prop))]


def assembly(pl, kind=_vtk.vtkAssembly):
    prop = kind()
    prop.AddPart(actor_of(CUBE, moved(-0.6, 0, 0)))
    prop.AddPart(actor_of(CONE, moved(0.6, 0, 0.3)))
    hidden = actor_of(BALL)
    hidden.visibility = False
    prop.AddPart(hidden)
    return prop, [(CUBE, moved(-0.6, 0, 0)), (CONE, moved(0.6, 0, 0.3))]


def prop_assembly(pl):
    return assembly(pl, _vtk.vtkPropAssembly)


def nested_assembly(pl):
    """One actor twice, under two matrices, one of which mirrors."""
    inner, other, outer = (_vtk.vtkAssembly() for _ in range(3))
    leaf = actor_of(CONE, moved(0, 0, 0.4))
    for part, x in ((inner, -0.7), (other, 0.7)):
        part.AddPart(leaf)
        part.SetPosition(x, 0, 0)
        outer.AddPart(part)
    other.SetScale(-0.8, 0.8, 0.8)
    outer.RotateZ(25)
    world = [matrix_of(outer) @ matrix_of(part) @ moved(0, 0, 0.4) for part in (inner, other)]
    return outer, [(CONE, matrix) for matrix in world]


def assembly_of_followers(pl):
    prop = _vtk.vtkAssembly()
    prop.AddPart(follower(pl)[0])
    prop.AddPart(lod_actor(pl)[0])
    prop.SetPosition(0, 0.4, 0.2)
    return prop, None  # VTK turns the follower as it likes: about the world's origin


def following_assembly(pl):
    prop, (inner, parts) = _vtk.vtkProp3DFollower(), assembly(pl)
    prop.SetProp3D(inner)
    prop.SetCamera(pl.camera)
    prop.SetPosition(0, 0, 0.3)
    turned = facing(pl.camera, (0, 0, 0.3))
    return prop, [(mesh, turned @ matrix) for mesh, matrix in parts]


def composite_follower(pl):
    blocks = pv.MultiBlock([CUBE.translate((-0.5, 0, 0)), CONE.translate((0.7, 0, 0))])
    prop = colored(_vtk.vtkFollower(), CUBE)
    prop.SetMapper(mapper_of(blocks, _vtk.vtkCompositePolyDataMapper))
    prop.SetCamera(pl.camera)
    turned = facing(pl.camera, (0, 0, 0))
    return prop, [(block, turned) for block in blocks]


def multiblock(pl):
    blocks = pv.MultiBlock([CUBE.translate((-0.5, 0, 0)), CONE.translate((0.7, 0, 0))])
    prop = colored(_vtk.vtkActor(), CUBE)
    prop.SetMapper(mapper_of(blocks, _vtk.vtkCompositePolyDataMapper))
    return prop, [(block, np.eye(4)) for block in blocks]


def glyphs(pl):
    mapper = mapper_of(pv.PolyData([[-0.6, 0, 0], [0.6, 0, 0.3]]), _vtk.vtkGlyph3DMapper)
    mapper.SetSourceData(CONE)
    prop = colored(_vtk.vtkActor(), CUBE)
    prop.SetMapper(mapper)
    return prop, [(CONE, moved(-0.6, 0, 0)), (CONE, moved(0.6, 0, 0.3))]


#: Those whose inner actors VTK hides receive nothing that is drawn by their shader.
HIDDEN = (
    follower,
    follower_by_polydata,
    lod_actor,
    quadric_lod_actor,
    composite_follower,
)
OPEN = (lod_prop, assembly, prop_assembly, nested_assembly, following_assembly)
COMPOSED = HIDDEN + OPEN


def scene(size=SIZE, **options):
    """A plotter with a wall and a floor, and its camera and light."""
    pl = plotter(size, lighting='none', **options)
    pl.add_light(pv.Light(position=(2, -3, 6), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=6, j_size=6, center=(0, 0, -0.7)), color='w')
    pl.add_mesh(pv.Cube(center=(0, 1.6, -0.3), x_length=3, y_length=0.3), color='lightblue')
    place(pl, (1.5, -6, 2.6), (0, 0, 0), angle=38)
    return pl


def pair(make, prepare=lambda pl, props: None, **options):
    """A plotter with a prop, one with equal plain actors, and the props of each."""
    plotters = scene(**options), scene(**options)
    prop, parts = make(plotters[0])
    plain = [actor_of(mesh, matrix) for mesh, matrix in parts]
    for actor in plain if prop.IsA('vtkActor') else ():
        actor.GetProperty().DeepCopy(prop.GetProperty())
    for pl, props in zip(plotters, ([prop], plain), strict=True):
        for each in props:
            pl.add_actor(each)
        place(pl, (1.5, -6, 2.6), (0, 0, 0), angle=38)
        prepare(pl, props)
        pl.show(auto_close=False)
    return *plotters, prop, plain


def shapes(pl, props):
    """Which pixels of the ids are of some props."""
    ids, objects = pl.ibr.buffer('id'), pl.ibr.buffer_objects
    return np.isin(ids, [k for k, item in enumerate(objects) if item in props]), ids


@pytest.mark.parametrize('make', [*COMPOSED, multiblock, glyphs], ids=lambda f: f.__name__)
def test_buffers_are_those_of_equal_plain_actors(make):
    pl, plain_pl, prop, plain = pair(make)
    covered, ids = shapes(pl, [prop])
    truth, _ = shapes(plain_pl, plain)
    assert truth.sum() > 250
    np.testing.assert_array_equal(covered, truth)
    assert set(np.unique(ids)) == {-1, 0, 1, 2}, 'an object each, however many parts it has'
    normal, true_normal = (p.ibr.buffer('normal') for p in (pl, plain_pl))
    np.testing.assert_allclose(normal, true_normal, atol=1e-4)
    depth = pl.ibr.buffer('depth')
    np.testing.assert_allclose(np.where(np.isinf(depth), np.nan, depth), depths(pl), rtol=3e-4)
    np.testing.assert_allclose(depth, plain_pl.ibr.buffer('depth'), rtol=3e-4)
    np.testing.assert_array_equal(pl.ibr.buffer('color'), plain_pl.ibr.buffer('color'))


def mirror(pl, props):
    floor = pv.Plane(i_size=6, j_size=6, center=(0, 0, -0.69))
    glass = pl.add_mesh(floor, lighting=False)
    live = pl.ibr.add(pvibr.Mirror(glass, actors=lambda actor: actor is not glass))
    glass.SetTexture(live.texture)


def outlined(pl, props):
    pl.ibr.add(pvibr.Outline(list(props), color='m', width=3))


def outline(pl, props, **settings):
    pl.ibr.add(pvibr.Outline(color='m', **settings))


def dashed(pl, props):
    pl.ibr.add(pvibr.Outline(list(props), color='m', hidden='dashed'))


def occlusion(pl, props):
    pl.ibr.add(pvibr.AmbientOcclusion(0.8, strength=2.0))


def lit_occlusion(pl, props):
    pl.ibr.add(pvibr.AmbientOcclusion(0.8, strength=2.0, unlit=False))


def defocus(pl, props):
    pl.ibr.add(pvibr.DepthOfField())


def fog(pl, props):
    pl.ibr.add(pvibr.Fog())


def glow(pl, props):
    pl.ibr.add(pvibr.Glow(list(props), intensity=2.0))


def solid_glow(pl, props):
    pl.ibr.add(pvibr.Glow(list(props), intensity=2.0, source='alpha'))


def translucent(pl, props):
    """Each prop half transparent among half transparent spheres, which blend by depth."""
    for prop in props:
        for actor in actors_in(prop):
            actor.GetProperty().SetOpacity(0.5)
    centers = np.mgrid[-1:2, -1:2, 0:2].reshape(3, -1).T * (0.6, 0.9, 0.7)
    pl.ibr.add(pvibr.Spheres(centers, 0.25, opacity=0.5, color='r'))


def actors_in(prop):
    if prop.IsA('vtkActor'):
        return [prop]
    found = _vtk.vtkPropCollection()
    (prop.GetProp3D() if prop.IsA('vtkProp3DFollower') else prop).GetActors(found)
    return list(found)


IN_PICTURE = (
    outline,
    outlined,
    dashed,
    mirror,
    occlusion,
    lit_occlusion,
    defocus,
    fog,
    glow,
    solid_glow,
)
COMBINED = [
    slow(make, add, when=(i + j) % 4)
    for i, make in enumerate(COMPOSED)
    for j, add in enumerate(IN_PICTURE)
]


@pytest.mark.parametrize(('make', 'add'), COMBINED)
def test_pictures_are_those_of_equal_plain_actors(make, add):
    pl, plain_pl, *_ = pair(make, add)
    picture, truth = shot(pl), shot(plain_pl)
    np.testing.assert_array_equal(shot(pl), picture)
    # One outline is around all parts of an assembly, and none is between them.
    between = 0.004 * picture.size if add in (outline, outlined, dashed) and make in OPEN else 0
    assert (picture != truth).sum() <= between


@pytest.mark.parametrize('make', [*HIDDEN[::2], lod_prop], ids=lambda f: f.__name__)
def test_translucent_ones_blend_in_the_order_of_depth(make):
    pl, plain_pl, *_ = pair(make, translucent)
    np.testing.assert_array_equal(shot(pl), shot(plain_pl))


@pytest.mark.parametrize('make', [assembly, follower], ids=lambda f: f.__name__)
def test_tiles_share_the_light_of_the_whole_picture(make):
    """VTK marks the parts of an assembly as changed in each frame."""
    pl, plain_pl, *_ = pair(make, lambda pl, _: pl.ibr.add(pvibr.Bloom(threshold=0.5)))
    tiled, truth = pl.ibr.screenshot(scale=2), plain_pl.ibr.screenshot(scale=2)
    np.testing.assert_array_equal(tiled, truth)


@pytest.mark.parametrize('make', [follower, lod_actor], ids=lambda f: f.__name__)
def test_no_image_replaces_what_turns_or_changes_by_itself(make):
    pl = scene()
    prop, _ = make(pl)
    pl.add_actor(prop)
    place(pl, (1.5, -6, 2.6), angle=38)
    pl.show(auto_close=False)
    pl.camera.azimuth = 25
    truth = shot(pl)
    pl.camera.azimuth = 0
    impostor = pl.ibr.add_impostor([prop], only_if_faster=False)
    layers = pl.ibr.add_image_layers()
    shot(pl)
    layers.enabled = False
    pl.camera.azimuth = 25
    np.testing.assert_array_equal(shot(pl), truth)
    assert impostor.report()['meshes'] == {'drawn by another actor': 1}
    assert prop.GetVisibility()


def shadows(method, **settings):
    def add(pl, props):
        pl.ibr.add(pvibr.Shadows(method=method, **settings))

    return add


def own_shadow(pl, props):
    """Shadows of the prop alone, chosen by the prop."""
    pl.ibr.add(pvibr.Shadows(casts=list(props)))


def no_shadow(pl, props):
    pl.ibr.add(pvibr.Shadows(casts=lambda actor: actor.GetProperty().GetColor()[2] > 0.8))


def projector(pl, props):
    picture = np.zeros((16, 16, 3), np.uint8)
    picture[::2, 1::2], picture[1::2, ::2] = (255, 0, 0), (0, 0, 255)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (3, -5, 4), (0, 0, 0), (0, 0, 1)
    pl.ibr.add(pvibr.Projector(picture, camera))


ON_SURFACES = {
    'hard': shadows('hard'),
    'pcf': shadows('pcf'),
    'pcss': shadows('pcss', angle=4.0),
    'msm': shadows('msm'),
    'volume': shadows('volume'),
    'own': own_shadow,
    'none': no_shadow,
    'projector': projector,
}


@pytest.mark.parametrize(
    ('make', 'name'),
    [
        slow(make, name, when=(i + j) % 4)
        for i, make in enumerate(COMPOSED)
        for j, name in enumerate(ON_SURFACES)
    ],
)
def test_shadows_and_projections_are_those_of_equal_plain_actors(make, name):
    pl, plain_pl, prop, _ = pair(make, ON_SURFACES[name])
    picture, truth = shot(pl), shot(plain_pl)
    np.testing.assert_array_equal(shot(pl), picture)
    if make in HIDDEN:  # they keep their own light, as without the effect
        pl.ibr.clear()
        bare = shot(pl)
        covered, _ = shapes(pl, [prop])
        np.testing.assert_array_equal(picture[covered], bare[covered])
        truth[covered] = bare[covered]
        assert name == 'none' or (truth != bare).any()
    assert (picture != truth).sum() <= 3 * 4  # along edges, where filters round


@pytest.mark.parametrize('make', [*COMPOSED, assembly_of_followers], ids=lambda f: f.__name__)
def test_ids_cover_what_vtk_draws(make):
    pl = scene()
    pl.show(auto_close=False)
    without = depth_buffer(pl)
    prop, _ = make(pl)
    pl.add_actor(prop, reset_camera=False)
    pl.render()
    drawn = depth_buffer(pl) != without
    covered, _ = shapes(pl, [prop])
    assert drawn.sum() > 250
    np.testing.assert_array_equal(covered, drawn)


def test_stand_ins_follow_their_prop():
    pl = scene()
    prop, _ = assembly(pl)
    part = actor_of(BALL, moved(0, 0, 0.9))
    pl.add_actor(prop)
    place(pl, (1.5, -6, 2.6), angle=38)
    pl.ibr.add(pvibr.Outline())
    shadows = pl.ibr.add(pvibr.Shadows())
    pl.show(auto_close=False)
    changes = {
        'moved': lambda: prop.SetPosition(0, 0, 0.3),
        'grew': lambda: prop.AddPart(part),
        'part hidden': lambda: part.SetVisibility(False),
        'part shown': lambda: part.SetVisibility(True),
        'part moved': lambda: part.SetPosition(0.4, 0, 0),
        'look': lambda: part.SetMapper(pv.DataSetMapper(CONE)),
        'shrank': lambda: prop.RemovePart(part),
    }
    for name, change in changes.items():
        before = shadows.report()['views drawn']
        change()
        pl.render()
        depth = depth_buffer(pl)
        assert shadows.report()['views drawn'] == before + 1, name
        pl.render()
        covered, _ = shapes(pl, [prop])
        assert shadows.report()['views drawn'] == before + 1, 'and nothing while it is still'
        prop.SetVisibility(False)
        pl.render()
        np.testing.assert_array_equal(covered, depth_buffer(pl) != depth, name)
        prop.SetVisibility(True)
        pl.render()
    pl.remove_actor(prop)
    assert not shapes(pl, [prop])[0].any()
    pl.add_actor(prop)
    assert shapes(pl, [prop])[0].any()


def test_an_assembly_in_two_subplots_has_shadows_in_one():
    pl = pv.Plotter(shape=(1, 2), window_size=(240, 90), lighting='none')
    prop, _ = assembly(pl)
    for column in range(2):
        pl.subplot(0, column)
        pl.add_light(pv.Light(position=(2, -3, 6), light_type='scene light'))
        pl.add_mesh(pv.Plane(i_size=6, j_size=6, center=(0, 0, -0.7)), color='w')
        pl.add_actor(prop)
        place(pl, (1.5, -6, 2.6), angle=38)
    pl.show(auto_close=False)
    bare = shot(pl)
    pl.subplot(0, 0)
    pl.ibr.add(pvibr.Shadows())
    picture = shot(pl)
    assert (picture != bare)[:, :120].any()
    np.testing.assert_array_equal(picture[:, 120:], bare[:, 120:])


# What is left out whole: drawn, but in no buffer.


def placed(prop):
    prop.RotateX(90)
    prop.SetPosition(-0.5, -0.5, 0)
    return prop


def image_actor(pl):
    image = pv.ImageData(dimensions=(20, 20, 1), spacing=(0.06, 0.06, 1))
    image['v'] = np.arange(400, dtype=np.uint8)
    prop = placed(_vtk.vtkImageActor())
    prop.SetInputData(image)
    return pl.add_actor(prop)


def text_actor(pl):
    prop = placed(_vtk.vtkTextActor3D())
    prop.SetInput('text')
    prop.SetScale(0.05)
    return pl.add_actor(prop)


def billboard_text(pl):
    prop = _vtk.vtkBillboardTextActor3D()
    prop.SetInput('text')
    return pl.add_actor(prop)


def volume(pl):
    grid = pv.ImageData(dimensions=(9, 9, 9), spacing=(0.1, 0.1, 0.1))
    grid['v'] = np.linspace(0, 255, 729).astype(np.uint8)
    return pl.add_volume(grid, show_scalar_bar=False)


def axis_follower(pl):
    prop, axis = _vtk.vtkAxisFollower(), _vtk.vtkAxisActor()
    axis.SetPoint2(1, 0, 0)
    prop.SetAxis(axis)
    prop.SetCamera(pl.camera)
    prop.SetMapper(mapper_of(CUBE))
    pl.add_actor(prop)
    return axis


def own_program(pl):
    actor = actor_of(CUBE)
    actor.GetShaderProperty().SetFragmentShaderCode(
        '//VTK::System::Dec\n//VTK::Output::Dec\nvoid main() { gl_FragData[0] = vec4(1.0); }'
    )
    return pl.add_actor(actor)


def emissive_points(pl):
    points = np.random.default_rng(0).random((30, 3)) - 0.5
    return pl.add_points(points, style='points_gaussian', emissive=True, point_size=20)


def chart(pl):
    made = pv.Chart2D(size=(0.4, 0.4), loc=(0.1, 0.1))
    made.line([0, 1], [1, 10])
    pl.add_chart(made)
    return made


def labels(pl):
    return pl.add_point_labels([[0.0, 0.0, 0.5]], ['a'], show_points=False)


def axes(pl):
    return pl.add_actor(_vtk.vtkAxesActor())


def bounds(pl):
    return pl.show_bounds()


def orientation_widget(pl):
    return pl.add_camera_orientation_widget()


def skybox(pl):
    prop = _vtk.vtkSkybox()
    prop.SetTexture(pv.Texture(np.full((8, 8, 3), 200, np.uint8)))
    prop.SetProjectionToSphere()
    return pl.add_actor(prop)


LEFT_OUT = (
    image_actor,
    text_actor,
    billboard_text,
    volume,
    axis_follower,
    own_program,
    emissive_points,
    chart,
    labels,
    axes,
    bounds,
    orientation_widget,
    skybox,
)


@pytest.mark.parametrize('add', LEFT_OUT, ids=lambda f: f.__name__)
def test_what_cannot_be_drawn_again_is_in_no_buffer(add):
    buffers = []
    for adds in (True, False):
        pl = scene()
        pl.show(auto_close=False)
        held = add(pl) if adds else None
        place(pl, (1.5, -6, 2.6), angle=38)
        pl.render()
        buffers.append([pl.ibr.buffer(name) for name in ('id', 'normal')])
        if held is not None:
            pl.ibr.add(pvibr.Outline(color='m'))
            np.testing.assert_array_equal(shot(pl), shot(pl))
    np.testing.assert_array_equal(buffers[0][0] + 1, buffers[1][0] + 1)
    np.testing.assert_allclose(*(normal for _, normal in buffers), atol=1e-4)


def test_highlight_of_a_picker_is_a_surface_of_its_own():
    pl = scene()
    pl.show(auto_close=False)
    style = _vtk.vtkInteractorStyle()
    style.SetCurrentRenderer(pl.renderer)
    style.HighlightProp3D(pl.add_mesh(CUBE))
    first, second = (pl.ibr.buffer('id') for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert len(pl.ibr.buffer_objects) == 4
    style.HighlightProp3D(None)
