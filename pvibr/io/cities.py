"""CityJSON files as meshes and instance matrices."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.core.errors import require
from pvibr.core.files import existing

#: Supported version; older files are upgraded.
VERSION = '2.0'
#: Nesting depth of the surfaces of a geometry, by its type.
_DEPTHS = {'MultiSurface': 0, 'CompositeSurface': 0, 'Solid': 1, 'MultiSolid': 2}
_DEPTHS |= {'CompositeSolid': 2}


def is_city(path) -> bool:
    """Return True if a file declares itself to be CityJSON."""
    path = Path(path).expanduser()
    if path.suffix.lower() not in ('.json', '.cityjson') or not path.is_file():
        return False
    return path.suffix.lower() == '.cityjson' or b'"CityJSON"' in path.read_bytes()


def read_city(path, lod=None):
    """Read the objects of a CityJSON file as meshes and instance matrices.

    Each geometry template becomes one mesh with instances; other objects are merged into one mesh
    per type.

    Parameters
    ----------
    path : str or pathlib.Path
        A CityJSON file of version 1.0 or later, upgraded to 2.0.
    lod : str, optional
        Level of detail, such as ``'1.2'``; by default the finest of each object.

    Returns
    -------
    meshes : list of pyvista.PolyData
        Triangles, each mesh about its own origin. Field data ``'type'`` is the type of the
        objects, such as ``'Building'``. Cell data are ``'object'``, the index of the object in the
        file, and every numeric attribute as float64, NaN where it is missing; for templates the
        index is -1 and attributes are NaN.
    index : numpy.ndarray, shape (n,), int64
        Mesh of each instance, an index into `meshes`.
    matrices : numpy.ndarray, shape (n, 4, 4), float64
        World from mesh of each instance, in the file's units.

    Raises
    ------
    ValueError
        If the file is not CityJSON, is broken, or has no geometry.
    FileNotFoundError
        If the file does not exist.
    ImportError
        If the extra ``city`` is not installed.

    Examples
    --------
    >>> from pvibr.io.cities import read_city
    >>> meshes, index, matrices = read_city('delft.json')  # doctest: +SKIP
    """
    path = existing(path, 'city file')
    # On broken files the libraries raise many kinds of errors.
    try:
        return _City(_upgraded(path), lod).instances()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError) as error:
        problem = f'{path}: not readable as CityJSON: {type(error).__name__}: {error}'
        raise ValueError(problem[:1000]) from error


def _cjio(module):
    """Import a module of cjio, undoing its patch of `json`, which rounds all numbers."""
    names = vars(json.encoder)
    saved_names = {
        name: names[name] for name in list(names) if name in ('c_make_encoder', 'float')
    }
    try:
        return require(f'cjio.{module}', 'city', 'CityJSON files')
    finally:
        names.pop('float', None)
        names.update(saved_names)


def _upgraded(path) -> dict:
    """Return the file's JSON, upgraded to the supported version."""
    cityjson = _cjio('cityjson')
    with path.open('rb') as file:
        model = cityjson.reader(file)
    if model.get_version() != VERSION:
        model.upgrade_version(VERSION, 3)  # silently ignores unknown versions
    if model.get_version() != VERSION:
        raise ValueError(f'version must be at most {VERSION}, got {model.get_version()!r}')
    return model.j


class _City:
    """The objects and vertices of a file."""

    def __init__(self, tree, lod):
        self._triangulate = _cjio('geom_help').triangulate_face
        self._lod = lod
        self._objects = list(tree['CityObjects'].values())
        transform = tree.get('transform', {'scale': (1, 1, 1), 'translate': (0, 0, 0)})
        vertices = _points(tree['vertices'])
        self._points = _points(vertices * transform['scale'] + transform['translate'])
        templates = tree.get('geometry-templates', {})
        self._templates = templates.get('templates', [])
        self._template_points = _points(templates.get('vertices-templates', []))
        self._names = sorted(
            {
                name
                for city_object in self._objects
                for name, value in city_object.get('attributes', {}).items()
                if isinstance(value, int | float) and not isinstance(value, bool)
            }
        )

    def instances(self):
        """Return meshes, index and matrices."""
        template_uses: dict[int, list] = {}
        faces_by_type: dict[str, list] = {}
        for row, entry in enumerate(self._objects):
            for geometry in self._chosen(entry.get('geometry', ())):
                if geometry['type'] == 'GeometryInstance':
                    matrix = self._matrix(geometry)
                    copies = template_uses.setdefault(int(geometry['template']), [])
                    copies.append((row, matrix))
                elif geometry['type'] in _DEPTHS:
                    faces = self._triangles(geometry, self._points)
                    faces_by_type.setdefault(entry['type'], []).append((row, faces))
        mesh_sets = [self._copied(k, copies) for k, copies in template_uses.items()]
        mesh_sets += [
            self._merged(object_type, group) for object_type, group in faces_by_type.items()
        ]
        mesh_sets = [(mesh, matrices) for mesh, matrices in mesh_sets if mesh.n_cells]
        if not mesh_sets:
            level = '' if self._lod is None else f' of level of detail {self._lod}'
            raise ValueError(f'the file has no geometry{level} with surfaces')
        meshes, matrices = zip(*mesh_sets, strict=True)
        index = np.repeat(np.arange(len(meshes)), [len(m) for m in matrices])
        return list(meshes), index, np.concatenate(matrices)

    def _chosen(self, geometries):
        """Return the geometries of one level of detail."""
        levels = {self._level(geometry) for geometry in geometries}
        if not levels:
            return []
        chosen_level = max(levels) if self._lod is None else str(self._lod)
        return [g for g in geometries if self._level(g) == chosen_level]

    def _level(self, geometry):
        if geometry['type'] == 'GeometryInstance':
            geometry = self._templates[geometry['template']]
        return str(geometry.get('lod', ''))

    def _matrix(self, geometry):
        """Return world from mesh of an instance, (4, 4)."""
        matrix = np.array(geometry['transformationMatrix'], float).reshape(4, 4)
        anchor = np.eye(4)
        anchor[:3, 3] = self._points[geometry['boundaries'][0]]
        if not np.isfinite(anchor @ matrix).all():
            raise ValueError(f'transformationMatrix must be finite, got {matrix.tolist()}')
        return anchor @ matrix

    def _triangles(self, geometry, points):
        """Return the triangles of all surfaces as vertex indices, (n, 3)."""
        surfaces = geometry['boundaries']
        for _ in range(_DEPTHS[geometry['type']]):
            surfaces = [surface for shell in surfaces for surface in shell]
        # Centred, as large coordinates would spoil the normals of small faces.
        corners = np.array([corner for surface in surfaces for corner in surface[0]])
        middle = points[corners].mean(0) if len(corners) else 0.0
        centred_points = points - middle
        triangle_arrays = [np.empty((0, 3), int)]
        for surface in surfaces:
            rings = [ring for ring in surface if len(ring) > 2]
            if not rings:
                continue
            triangles, is_valid = self._triangulate(rings, centred_points, True)
            if is_valid:
                triangle_arrays.append(np.asarray(triangles, int).reshape(-1, 3))
        return np.concatenate(triangle_arrays)

    def _copied(self, template, instances):
        """Return the mesh of a template, and world from mesh of its instances."""
        faces = self._triangles(self._templates[template], self._template_points)
        mesh = _mesh(self._template_points, faces)
        # Instances share the mesh, so attributes of objects are lost.
        self._mark(mesh, self._objects[instances[0][0]]['type'], np.full(len(faces), -1))
        return mesh, np.stack([matrix for _, matrix in instances])

    def _merged(self, object_type, group):
        """Return one mesh of all objects of a type, and world from mesh."""
        object_indices = np.concatenate([np.full(len(faces), row) for row, faces in group])
        faces = np.concatenate([faces for _, faces in group])
        world_from_mesh = np.eye(4)
        if len(faces):
            used_points = self._points[faces.ravel()]
            world_from_mesh[:3, 3] = (used_points.min(0) + used_points.max(0)) / 2
        mesh = _mesh(self._points - world_from_mesh[:3, 3], faces)
        self._mark(mesh, object_type, object_indices)
        return mesh, world_from_mesh[None]

    def _mark(self, mesh, object_type, object_indices):
        mesh.field_data['type'] = [object_type]
        mesh.cell_data['object'] = object_indices
        for name in self._names:
            values = np.array([_number(o.get('attributes', {}).get(name)) for o in self._objects])
            mesh.cell_data[name] = np.where(object_indices < 0, np.nan, values[object_indices])


def _points(coordinates):
    points = np.asarray(coordinates, float).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise ValueError('vertices must be finite')
    return points


def _mesh(points, faces):
    point_ids, corners = np.unique(faces, return_inverse=True)
    return pv.PolyData.from_regular_faces(points[point_ids], corners.reshape(faces.shape))


def _number(value):
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else np.nan
