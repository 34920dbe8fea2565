"""Textures of photographs as data: in tiles, with an atlas, with what each texel is worth."""

import tracemalloc
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from scipy import ndimage

import pvibr
from pvibr.photos import photo_bake, projector
from pvibr.visibility.unwrap import tiles_of, unwrapped
from tests.photos.test_photo_mesh import SIZE, colour_of, ground, photographs, settled
from tests.refusals import refused


@pytest.fixture(scope='module')
def terrain():
    """Hills whose texture coordinates are the places seen from above."""
    plane = pv.Plane(i_size=4, j_size=4, i_resolution=40, j_resolution=40).triangulate()
    points = np.array(plane.points, float)
    points[:, 2] = 0.2 * np.sin(2 * points[:, 0]) * np.cos(1.5 * points[:, 1])
    plane.points = points
    # VTK writes no double ones into glTF.
    plane.active_texture_coordinates = np.asarray(plane.active_texture_coordinates, float)
    return plane


@pytest.fixture(scope='module')
def painted(terrain, tmp_path_factory):
    folder = tmp_path_factory.mktemp('photos')
    return pvibr.PhotoMesh(terrain, photographs(terrain, folder, 5, 11, exposures=False))


def read(path):
    if path.suffix == '.npy':
        return np.load(path, mmap_mode='r')
    with pytest.importorskip('rasterio').open(path) as file:
        assert file.profile['tiled']
        bands = file.read()
    return np.moveaxis(bands, 0, 2) if len(bands) > 1 else bands[0]


@pytest.mark.filterwarnings('ignore:Dataset has no geotransform')
@pytest.mark.parametrize('suffix', ['.npy', '.tif'])
def test_a_file_of_tiles_is_the_texture(painted, tmp_path, monkeypatch, suffix):
    """Also where sides are no multiple of a tile's; photographs make room for each other."""
    size = (600, 100) if suffix == '.tif' else (300, 200)  # blocks of a TIFF are 512
    whole_mesh, whole, maps = painted.bake(size=size, quality=True)
    monkeypatch.setattr(photo_bake, '_TILE', 512 if suffix == '.tif' else 128)
    monkeypatch.setattr(painted, 'memory', 1.0)
    file = tmp_path / f'site{suffix}'
    mesh, path, paths = painted.bake(size=size, quality=True, file=file)
    assert path == file
    np.testing.assert_array_equal(mesh.points, whole_mesh.points)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        p.name for p in (path, *paths.values())
    )
    assert paths['photo'].name == f'site_photo{suffix}'
    found = np.asarray(read(path))
    assert found.shape == (size[1], size[0], 4)
    assert (found != whole).any(2).mean() < 1e-3  # the card may round a triangle's edge otherwise
    for name, values in maps.items():
        other = read(paths[name])
        assert other.dtype == values.dtype
        assert (~np.isclose(other, values, rtol=1e-3, equal_nan=True)).mean() < 1e-3


def test_memory_is_of_a_tile_not_of_the_texture(painted, tmp_path, monkeypatch):
    """Four times the texels take no more of it; the file is not mapped into it either."""
    monkeypatch.setattr(photo_bake, '_TILE', 32)
    file, maps, peaks = tmp_path / 'site.npy', Path('/proc/self/maps'), {}
    paint = photo_bake.Painter.at

    def at(*args):
        assert not maps.exists() or str(tmp_path) not in maps.read_text()
        return paint(*args)

    monkeypatch.setattr(photo_bake.Painter, 'at', at)
    for size in (32, 96, 192):  # the first has imports and caches
        tracemalloc.start()
        painted.bake(size=size, file=file)
        peaks[size] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[192] - peaks[96] < 0.5 * (192**2 - 96**2) * 4
    assert (np.load(file)[..., 3] == 255).mean() > 0.9


def test_what_is_interrupted_leaves_the_file_before(painted, tmp_path, monkeypatch):
    file = tmp_path / 'site.npy'
    file.write_text('before')

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(photo_bake.Painter, 'at', stop)
    with pytest.raises(KeyboardInterrupt):
        painted.bake(size=64, file=file)
    assert [p.name for p in tmp_path.iterdir()] == ['site.npy']
    assert file.read_text() == 'before'


def test_progress_rises_to_the_end(painted, monkeypatch):
    shown = []

    @contextmanager
    def bar(*_):
        yield shown.append

    monkeypatch.setattr('pvibr.photos.photo_mesh.baking', bar)
    monkeypatch.setattr(photo_bake, '_TILE', 64)
    painted.bake(size=128)
    assert shown == sorted(shown)
    assert len(shown) >= 8
    assert shown[-1] == 1.0


def test_what_texels_are_worth(painted):
    """Against float64: rays from the cameras, and how far apart pixels are on the surface."""
    high = 48
    mesh, _, maps = painted.bake(size=high, quality=True)
    v, u = np.indices((high, high)) + 0.5
    uv = np.stack([u / high, 1 - v / high], -1).reshape(-1, 2)
    place, normal, clear = on_surface(mesh, uv)
    photos = painted.photos
    number = np.where(clear, maps['photo'].ravel(), -1)
    assert set(np.unique(number)) - {-1} == set(range(5))
    for k in range(5):
        rows = number == k
        camera, p, n = photos[k].camera, place[rows], normal[rows]
        ray = camera.position - p
        cosine = np.einsum('ij,ij->i', ray, n) / np.linalg.norm(ray, axis=1)
        angle = np.degrees(np.arccos(cosine))
        assert np.abs(maps['angle'].ravel()[rows] - angle).max() < 0.01
        # The neighbours of a pixel, cast on to the plane of the triangle.
        pixel = camera.project(p)[0]
        corners = [
            hit(camera, pixel + np.array(way) / SIZE, p, n)
            for way in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
        ]
        across, along = corners[2] - corners[0], corners[3] - corners[1]
        area = np.linalg.norm(np.cross(across, along), axis=1) / 2
        found = maps['resolution'].ravel()[rows]
        assert np.abs(found / np.sqrt(area) - 1).max() < 0.01


def on_surface(mesh, uv):
    """Places and normals of a mesh by its texture coordinates, and which are on no edge."""
    corners = np.asarray(mesh.active_texture_coordinates, float)[mesh.regular_faces]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    shares = np.einsum('fij,nfj->nfi', inverse, uv[:, None] - corners[None, :, 0])
    inside = np.minimum(shares.min(2), 1 - shares.sum(2))
    face, clear = inside.argmax(1), inside.max(1) > 1e-3
    share = shares[np.arange(len(uv)), face]
    at = np.asarray(mesh.points, float)[mesh.regular_faces[face]]
    sides = at[:, 1:] - at[:, :1]
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return at[:, 0] + np.einsum('nk,nkd->nd', share, sides), normal, clear


def hit(camera, uv, place, normal):
    origins, ahead = camera.rays(uv)
    away = np.einsum('ij,ij->i', place - origins, normal) / np.einsum('ij,ij->i', ahead, normal)
    return origins + away[:, None] * ahead


@pytest.mark.parametrize('exporter', ['pyvista', 'pvibr'])
def test_gltf_has_the_baked_colours(painted, tmp_path, exporter):
    """Read back by trimesh: the colour at the middle of each triangle is that of its place."""
    mesh, image = painted.bake(size=512)
    pl = pv.Plotter(off_screen=True, window_size=(64, 64))
    pl.add_mesh(mesh, texture=pv.Texture(image))
    path = str(tmp_path / ('site.gltf' if exporter == 'pyvista' else 'site.glb'))
    (pl.export_gltf if exporter == 'pyvista' else pl.ibr.export_glb)(path)
    (found,) = trimesh.load(path, process=False).geometry.values()
    assert len(found.faces) == mesh.n_cells
    uv = found.visual.uv[found.faces].mean(1)
    material = found.visual.material
    picture = np.asarray(getattr(material, 'baseColorTexture', None) or material.image)
    row, column = ((1 - uv[:, 1]) * 512).astype(int), (uv[:, 0] * 512).astype(int)
    shown = picture[row, column, :3].astype(float)
    own = mesh.active_texture_coordinates[mesh.regular_faces].mean(1)
    same = image[((1 - own[:, 1]) * 512).astype(int), (own[:, 0] * 512).astype(int), :3]
    assert np.abs(shown - same).max() <= 1
    true = colour_of(mesh.cell_centers().points)
    assert np.sqrt(np.mean((settled(shown, true, slice(None)) - true) ** 2)) < 8


def test_what_no_photograph_sees(terrain, painted, tmp_path):
    """It has the mesh's colour under alpha 0, nothing is black, and glTF cuts out or is opaque."""
    mesh = terrain.copy()
    mesh.active_texture_coordinates = 0.25 + 0.5 * np.asarray(mesh.active_texture_coordinates)
    one = pvibr.PhotoMesh(mesh, painted.photos[:1], color='magenta')
    made, image = one.bake(size=256)
    (tile,) = tiles_of(made, 256)
    inside, seen = tile.values(np.ones(len(tile.cell)), 0) > 0, image[..., 3] == 255
    away = ndimage.distance_transform_edt(~(inside & seen))
    bare = inside & ~seen & (away > 8)
    assert bare.sum() > 20
    assert (image[bare, :3] == [255, 0, 255]).all()
    assert (seen[~inside] == (away[~inside] <= 8)).all()
    rim = image[inside & seen, :3].min(0)
    assert (image[~inside, :3] >= rim).all()  # mip levels darken no border
    for picture, mode in ((image, 'MASK'), (image[..., :3], None)):
        pl = pv.Plotter(off_screen=True, window_size=(64, 64))
        pl.add_mesh(made, texture=pv.Texture(np.ascontiguousarray(picture)))
        pl.ibr.export_glb(str(tmp_path / 'a.glb'))
        pl.close()
        (found,) = trimesh.load(str(tmp_path / 'a.glb'), process=False).geometry.values()
        assert found.visual.material.alphaMode == mode


def test_an_atlas_has_room_between_its_parts(monkeypatch):
    """In several runs of xatlas: each triangle once, of one density, with margins of colour."""
    pytest.importorskip('xatlas')
    monkeypatch.setattr('pvibr.visibility.unwrap._PART', 700)
    mesh = ground(5)
    mesh.points = np.add(mesh.points, (4e5, 5e6, 0), dtype=float)
    steps = []
    flat = unwrapped(mesh, 512, steps.append)
    assert len(steps) > 4
    assert steps[-1] == 1.0
    np.testing.assert_allclose(
        flat.points[flat.regular_faces], mesh.points[mesh.regular_faces], atol=1e-6
    )
    uv = flat.active_texture_coordinates
    assert uv.min() >= 0
    assert uv.max() <= 1
    corners = np.pad(uv * 512, ((0, 0), (0, 1)))[flat.regular_faces]
    sides = corners[:, 1:] - corners[:, :1]
    texels = np.abs(np.cross(sides[:, 0], sides[:, 1])[:, 2]) / 2
    sizes = flat.compute_cell_sizes()['Area']
    assert texels.sum() > 0.4 * 512**2
    density = np.sqrt(texels / sizes)
    assert np.percentile(density, 98) < 2 * np.percentile(density, 2)
    (tile,) = tiles_of(flat, 512)
    charts = components(flat)
    alone = tile.values(charts[tile.cell], -1)
    apart = ndimage.grey_dilation(alone, size=(3, 3))
    assert ((alone >= 0) & (apart != alone) & (apart >= 0)).sum() < 0.001 * alone.size
    image = tile.filled(np.tile([10, 200, 30, 255], (len(tile.cell), 1)), tile.cell >= 0)
    near = ndimage.binary_dilation(alone >= 0, iterations=4)
    assert (image[near] == [10, 200, 30, 255]).all()


def components(mesh):
    """The part of the atlas that each triangle is in."""
    labels = mesh.connectivity()
    return np.asarray(labels.cell_data['RegionId'])


def test_a_mesh_without_coordinates_is_baked(tmp_path):
    pytest.importorskip('xatlas')
    mesh = ground(3)
    painted = pvibr.PhotoMesh(mesh, photographs(mesh, tmp_path, 8, 3, exposures=False))
    flat, image = painted.bake(size=512)
    seen = painted.bake('cells')['photo'] >= 0
    uv = flat.active_texture_coordinates[flat.regular_faces].mean(1)[seen]
    shown = image[((1 - uv[:, 1]) * 512).astype(int), (uv[:, 0] * 512).astype(int)].astype(float)
    true = colour_of(flat.cell_centers().points[seen])
    assert (shown[:, 3] == 255).mean() > 0.99
    off = settled(shown[:, :3], true, slice(None)) - true
    assert np.sqrt(np.mean(off**2)) < 10


def test_projectors_bake_in_tiles_too(tmp_path, monkeypatch):
    """Gains and depth maps are of the whole mesh, whatever the tiles."""
    left = pvibr.Orthographic.from_extent(-1, 0.4, -1, 1, zmax=5)
    right = pvibr.Orthographic.from_extent(-0.4, 1, -1, 1, zmax=5)
    images = [np.full((9, 9, 3), 90, np.uint8), np.full((9, 9, 3), 120, np.uint8)]
    mesh = pv.Plane(i_size=2, j_size=2, i_resolution=12, j_resolution=12).triangulate()
    photo = pvibr.Projector(images, [left, right], gains='auto')
    _, whole = photo.bake(mesh, 'texture', size=128)
    monkeypatch.setattr(projector, '_TILE', 48)
    file = tmp_path / 'plan.npy'
    _, path = photo.bake(mesh, 'texture', size=128, file=file)
    assert path == file
    assert np.abs(np.load(path).astype(int) - whole).max() <= 1


def test_bad_files_are_refused(painted, tmp_path, monkeypatch):
    refused(r'file must end in .tif .*site.png', painted.bake, file='site.png')
    refused('file', painted.bake, kind=TypeError, file=3)
    refused(r'size must be .* got 0', painted.bake, size=0, file=tmp_path / 'site.npy')
    monkeypatch.setitem(__import__('sys').modules, 'rasterio', None)
    refused('geo', painted.bake, kind=ImportError, file='site.tif')
