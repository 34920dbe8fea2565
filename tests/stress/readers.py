"""All that pvibr reads from files: a real file of each format, and what reads and checks it."""

from __future__ import annotations

import gzip
import json
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

import pvibr
import pvibr.cluster
from pvibr.instances.cache import AtlasCache, key_of
from pvibr.io.cities import read_city
from pvibr.large import stored
from pvibr.large.checked_file import open_checked, write_checked
from pvibr.meshes.mesh_files import read_mesh
from tests.camera_files import write_pictures
from tests.figures.makers import bending, worm
from tests.meshes.test_mesh_files import quads
from tests.meshes.test_pose_files import city
from tests.photos.test_broken_cameras import KINDS as CAMERAS
from tests.photos.test_broken_cameras import project

SHARED = Path(__file__).parents[3] / 'shared' / 'data'
KEY = key_of('fuzz')
#: How the pictures of projects of cameras are called, before and after their number.
PICTURES = ('', '.jpg'), ('a ', '.jpg'), ('day ', '.jpg'), ('./train/r_', '')
CACHED = {'a': np.arange(3000.0).reshape(-1, 3), 'b': np.arange(50, dtype=np.uint8)}


class Source(NamedTuple):
    """How the files of one format are written into a folder, and read from it."""

    write: Callable[[Path], list[Path]]  # returns the files to damage
    read: Callable[[Path], object]  # the folder; raises AssertionError for a wrong result


def only_file(folder):
    """Return the one file of a folder."""
    (path,) = folder.iterdir()
    return path


def finite(*arrays):
    """Check that all numbers are finite."""
    assert all(np.isfinite(array).all() for array in arrays)


def check_mesh(mesh):
    """Check that the cells of a mesh are of its points."""
    if isinstance(mesh, pv.MultiBlock):
        for block in mesh.recursive_iterator():
            check_mesh(block)
    elif isinstance(mesh, pv.PolyData) and mesh.n_cells:
        mesh.extract_surface(algorithm='dataset_surface').triangulate()


def saved(name, **how):
    """Return what writes a mesh of quads to a file."""

    def write(folder):
        quads().save(folder / name, **how)
        return [folder / name]

    return Source(write, lambda folder: check_mesh(read_mesh(only_file(folder))))


def poses(name):
    """Return a table of poses, by its name's ending."""

    def write(folder):
        rng, path = np.random.default_rng(1), folder / name
        columns = {
            key: rng.normal(size=40) for key in ('x', 'y', 'z', 'qw', 'qx', 'qy', 'qz', 'h')
        }
        if name.endswith('.npy'):
            np.save(path, rng.normal(size=(20, 3)))
        elif name.endswith('.parquet'):
            import pyarrow
            from pyarrow import parquet

            parquet.write_table(pyarrow.table(columns), path)
        elif name.endswith(('.las', '.laz')):
            import laspy

            cloud = laspy.create(point_format=2)
            cloud.x, cloud.y, cloud.z = (columns[key] for key in 'xyz')
            cloud.write(path)
        else:
            rows = zip(*columns.values(), strict=True)
            lines = [','.join(columns), *(','.join(map(str, row)) for row in rows)]
            text = '\n'.join(lines).encode()
            path.write_bytes(gzip.compress(text, mtime=0) if name.endswith('.gz') else text)
        return [path]

    def read(folder):
        matrices, columns = pvibr.read_poses(only_file(folder))
        finite(matrices)
        assert all(len(values) == len(matrices) for values in columns.values())

    return Source(write, read)


def cameras(kind):
    """Return a project of cameras."""

    def read(folder):
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', pvibr.PvibrWarning)
            found = pvibr.read_cameras(folder)
        for photo in found:
            assert photo.path is None or photo.path.resolve().is_relative_to(folder.resolve())

    def write(folder):
        files = project(kind, folder)
        if kind not in ('geotiff', 'world'):
            names = (f'{start}{k}{end}' for start, end in PICTURES for k in range(4))
            write_pictures(folder, names)
        return files

    return Source(write, read)


def check_figure(folder):
    """Pose a figure of the glTF file in a folder."""
    path = next(p for p in folder.iterdir() if p.suffix in ('.glb', '.gltf'))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', pvibr.PvibrWarning)
        figure = pvibr.read_gltf(path)
        for mesh in figure.meshes:
            finite(mesh.mesh.points)
        figure.mesh(0.3, figure.clips[0].name if figure.clips else None)


def own_figure(folder):
    """Write a skinned figure."""
    worm(clips=[bending()]).save(folder / 'a.glb')
    return [folder / 'a.glb']


def copied(*names):
    """Return what copies real files of the shared folder."""

    def write(folder):
        for name in names:
            shutil.copy(SHARED / name, folder)
        return [folder / Path(name).name for name in names]

    return write


def own_city(folder):
    """Write a small city."""
    return [city(folder)]


def check_city(folder):
    """Read a city, its meshes and its matrices."""
    meshes, index, matrices = read_city(only_file(folder))
    assert len(index) == len(matrices)
    assert not len(index) or 0 <= min(index) <= max(index) < len(meshes)
    finite(matrices, *(mesh.points for mesh in meshes))


def cached(folder):
    """Write an entry of a cache."""
    assert AtlasCache(folder).put(KEY, CACHED, {'x': 1})
    return [only_file(folder)]


def check_cache(folder):
    """Read an entry: nothing, or what was written."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', pvibr.PvibrWarning)
        entry = AtlasCache(folder).get(KEY)
    if entry is not None:
        assert all(np.array_equal(entry[name], CACHED[name]) for name in CACHED)


def large(folder):
    """Write the hierarchy of a large mesh."""
    hill = pv.ParametricRandomHills(u_res=20, v_res=20)
    hill['height'] = hill.points[:, 2].copy()
    return [hill.ibr.large(folder / 'a.pvl', progress=False)]


def check_large(folder):
    """Read a hierarchy, whose checksums find all damage."""
    hierarchy, _ = stored.load(only_file(folder))
    finite(hierarchy.points)


def forge(rng, path):
    """Change numbers of an array of a hierarchy, with the right checksum."""
    entry = open_checked(path)
    name = rng.choice([name for name in entry if entry[name].size])
    array = np.array(entry[name])
    values = array.reshape(-1)
    for _ in range(rng.randrange(1, 4)):
        large_value = np.finfo(array.dtype).max if array.dtype.kind == 'f' else 2**30
        value = rng.choice([0, 1, -1, large_value, rng.randrange(len(values))])
        values[rng.randrange(len(values))] = np.array(value).astype(array.dtype)
    write_checked(path, {k: [array if k == name else a] for k, a in entry.items()}, entry.meta)


def state(folder):
    """Write the state of a plotter."""
    pl = state_plotter()
    pl.ibr.save_state(folder / 'a.json')
    return [folder / 'a.json']


def state_plotter():
    """Return a plotter with effects."""
    pl = pv.Plotter(off_screen=True, window_size=(32, 32))
    pl.ibr.add(pvibr.Bloom(threshold=0.5))
    pl.ibr.add(pvibr.Vignette(color=(1, 0, 0)))
    return pl


def check_state(folder):
    """Load a state: as a whole, or nothing changes."""
    pl = state_plotter()
    before = pl.ibr.state()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', pvibr.PvibrWarning)
            pl.ibr.load_state(only_file(folder))
    except (ValueError, TypeError):
        assert pl.ibr.state() == before, 'half of a state is loaded'
        raise
    json.dumps(pl.ibr.state(), allow_nan=False)


def views(folder):
    """Write a database of views."""
    pvibr.cluster.ViewWriter(folder, 6, size=16).step(pv.Sphere(), 0.0)
    return sorted(path for path in folder.rglob('*') if path.is_file())


SOURCES = {
    'glb': Source(own_figure, check_figure),
    **{f'mesh{name}': saved(f'a{name}') for name in ('.ply', '.stl', '.vtp')},
    'mesh-text.ply': saved('a.ply', binary=False),
    **{
        f'poses{name}': poses(f'a{name}')
        for name in ('.npy', '.csv', '.csv.gz', '.parquet', '.las', '.laz')
    },
    **{f'cameras-{kind}': cameras(kind) for kind in CAMERAS},
    'city': Source(own_city, check_city),
    'cache': Source(cached, check_cache),
    'large': Source(large, check_large),
    'large, forged': Source(large, check_large),
    'state': Source(state, check_state),
    'views': Source(views, lambda folder: pvibr.read_views(folder)),
}
if SHARED.is_dir():
    SOURCES |= {
        f'real {name}': Source(copied(f'gltf/{name}'), check_figure)
        for name in ('RiggedSimple.glb', 'BoxAnimated.glb', 'AnimatedMorphCube.glb')
    }
    SOURCES['real SimpleSkin'] = Source(
        copied(
            *(
                f'gltf/SimpleSkin/{name}'
                for name in (
                    'SimpleSkin.gltf',
                    'skinningData.bin',
                    'skinGeometry.bin',
                    'inverseBindMatrices.bin',
                    'skinAnimation.bin',
                )
            )
        ),
        check_figure,
    )
#: What damages files otherwise than byte by byte.
FORGERS = {'large, forged': forge}
