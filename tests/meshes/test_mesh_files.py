"""Files cut or damaged anywhere: an error that names the file, or a right mesh, never a crash."""

import subprocess
import sys

import numpy as np
import pytest
import pyvista as pv
import trimesh
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter

from pvibr.io.gltf_file import GltfError
from pvibr.meshes.mesh_files import read_mesh, scene_instances
from pvibr.meshes.parts import as_parts
from tests.refusals import refused

_READ = """
import sys
from pathlib import Path
import numpy as np
from pvibr.core import _vtk
from pvibr.meshes.mesh_files import read_mesh

_vtk.vtkObject.GlobalWarningDisplayOff()
path, seed = Path(sys.argv[1]), int(sys.argv[2])
content, rng = path.read_bytes(), np.random.default_rng(seed)
damaged = path.with_name('damaged' + path.suffix)
for k in range(150):
    data = bytearray(content[: rng.integers(len(content))] if k % 2 else content)
    for place in rng.integers(0, max(len(data), 1), rng.integers(0, 4)) if data else ():
        data[place] = rng.integers(256)
    damaged.write_bytes(data)
    try:
        mesh = read_mesh(damaged)
    except ValueError as error:
        assert 'damaged' in str(error), error
        continue
    if hasattr(mesh, 'faces'):
        faces = np.asarray(mesh.faces)
        assert not len(faces) or faces.max() < 1e9
"""


def quads(*, colors=False):
    """Return a plane of quads over one of triangles: lists of two lengths."""
    plane = pv.Plane(i_resolution=6, j_resolution=5)
    mesh = pv.merge([plane.triangulate(), plane.translate((0, 0, 1))])
    mesh = mesh.extract_surface(algorithm='dataset_surface')
    mesh.clear_data()
    if colors:
        mesh['RGB'] = np.full((mesh.n_points, 3), 200, np.uint8)
    return mesh


def save(mesh, path, *, binary, version=51):
    """Write a mesh, to legacy VTK files in some version of them."""
    if path.suffix != '.vtk':
        mesh.save(path, binary=binary)
        return
    writer = vtkPolyDataWriter()
    writer.SetFileVersion(version)
    writer.SetFileType(2 if binary else 1)
    writer.SetFileName(str(path))
    writer.SetInputData(mesh)
    writer.Write()


@pytest.mark.parametrize('binary', [True, False], ids=['binary', 'text'])
@pytest.mark.parametrize('suffix', ['.ply', '.stl', '.vtp', '.vtk', '42.vtk'])
def test_damaged_files(suffix, binary, tmp_path):
    path = tmp_path / f'mesh{suffix}'
    save(quads(), path, binary=binary, version=42 if suffix == '42.vtk' else 51)
    assert read_mesh(path).n_cells
    command = [sys.executable, '-c', _READ, str(path), '7']
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize('binary', [True, False], ids=['binary', 'text'])
def test_cut_faces_of_a_ply(binary, tmp_path):
    path = tmp_path / 'cut.ply'
    quads().save(path, binary=binary)
    content = path.read_bytes()
    for missing in (1, 9, 40):
        path.write_bytes(content[:-missing].rstrip() if not binary else content[:-missing])
        if binary or missing > 9:
            refused('cut.ply: .*(it is cut|is wrong)', read_mesh, path)


@pytest.mark.parametrize('binary', [True, False], ids=['binary', 'text'])
def test_polygons_of_a_ply_are_read(binary, tmp_path):
    mesh = quads(colors=True)
    path = tmp_path / 'a.ply'
    mesh.save(path, binary=binary, texture='RGB')
    assert read_mesh(path).n_cells == mesh.n_cells


def test_corners_that_are_not_there(tmp_path):
    path = tmp_path / 'a.ply'
    quads().save(path, binary=False)
    lines = path.read_text().splitlines()
    lines[-1] = '4 0 1 2 99999'
    path.write_text('\n'.join(lines) + '\n')
    refused('face [0-9]+ is wrong', read_mesh, path)


@pytest.mark.parametrize('binary', [True, False], ids=['binary', 'text'])
def test_old_vtk_files_without_all_their_cells(binary, tmp_path):
    """VTK reads beyond the end of what it read, and crashes, which other versions do not."""
    path = tmp_path / 'old.vtk'
    save(quads(), path, binary=binary, version=42)
    assert read_mesh(path).n_cells == quads().n_cells
    content = path.read_bytes()
    start = content.index(b'POLYGONS')
    for cut in (content[: start + 60], content.replace(b'Version 4.2', b'5.2')):
        path.write_bytes(cut)
        refused('old.vtk: (its 90 polygons are cut|it has no header)', read_mesh, path)
    save(quads(), path, binary=binary)
    path.write_bytes(path.read_bytes().replace(b'Version 5.1', b'Version 4.1'))
    refused('old.vtk: its .* are cut, or wrong', read_mesh, path)


def test_errors_of_gltf_files_name_them(tmp_path):
    path = tmp_path / 'cut.glb'
    path.write_bytes(trimesh.creation.box().export(file_type='glb')[:-40])
    refused('cut.glb: the GLB is truncated', scene_instances, path, kind=GltfError)
    refused('cut.glb: the GLB is truncated', as_parts, path, kind=GltfError)
