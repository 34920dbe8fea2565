"""CityJSON files as meshes and the matrices of their instances."""

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
    """Read the objects of a CityJSON file, as meshes and places.

    Each geometry template of the file becomes one mesh with many instances. Objects with a
    geometry of their own are merged into one mesh per type.

    Parameters
    ----------
    path : str or pathlib.Path
        A CityJSON file of version 1.0 or later (older ones are upgraded to 2.0).
    lod : str, optional
        Level of detail, such as ``'1.2'``; by default the finest of each object.

    Returns
    -------
    meshes : list of pyvista.PolyData
        Triangles, each mesh about its own origin. Field data ``'type'`` is the type of the
        objects, such as ``'Building'``. Cell data are ``'object'``, the index of the object in the
        file, and every numeric attribute as float64, NaN where an object lacks it; for templates
        the index is -1 and attributes are NaN.
    index : numpy.ndarray, shape (n,), int64
        Mesh of each instance, an index into `meshes`.
    matrices : numpy.ndarray, shape (n, 4, 4), float64
        World from model of each instance, in the file's own units.

    Raises
    ------
    ValueError
        If the file is not CityJSON, is broken, or has no geometry.
    FileNotFoundError
        If there is no such file.
    ImportError
        If the extra ``city`` is not installed.

    Examples
    --------
    >>> from pvibr.formats.cities import read_city
    >>> meshes, index, matrices = read_city('delft.json')  # doctest: +SKIP
    """
    path = existing(path, 'city file')
    # Broken files make the libraries raise many kinds of errors.
    try:
        city = _City(_upgraded(path), lod)
        return city.instances()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError) as error:
        msg = f'{path} cannot be read as CityJSON: {type(error).__name__}: {error}'
        raise ValueError(msg[:1000]) from error


def _cjio(module):
    """Return a module of cjio, without what it sets as it is imported: all JSON is rounded."""
    names = vars(json.encoder)
    kept = {name: names[name] for name in names if name in ('c_make_encoder', 'float')}
    try:
        return require(f'cjio.{module}', 'city', 'CityJSON files')
    finally:
        names.pop('float', None)
        names.update(kept)


def _upgraded(path) -> dict:
    """Return the file's JSON, upgraded to the supported version."""
    cityjson = _cjio('cityjson')
    with path.open('rb') as file:
        model = cityjson.reader(file)
    if model.get_version() != VERSION:
        model.upgrade_version(VERSION, 3)  # silently ignores unknown versions
    if model.get_version() != VERSION:
        raise ValueError(
            f'version is {model.get_version()!r}; supported are versions up to {VERSION}'
        )
    return model.j


class _City:
    """The objects of a file, and its vertices."""

    def __init__(self, tree, lod):
        self._triangulate = _cjio('geom_help').triangulate_face
        self._lod = lod
        self._objects = list(tree['CityObjects'].values())
        transform = tree.get('transform', {'scale': (1, 1, 1), 'translate': (0, 0, 0)})
        self._points = _points(tree['vertices']) * transform['scale'] + transform['translate']
        templates = tree.get('geometry-templates', {})
        self._templates = templates.get('templates', [])
        self._template_points = _points(templates.get('vertices-templates', []))
        self._names = sorted(
            {
                name
                for thing in self._objects
                for name, value in thing.get('attributes', {}).items()
                if isinstance(value, int | float) and not isinstance(value, bool)
            }
        )

    def instances(self):
        """Return meshes, index and matrices."""
        places: dict[int, list] = {}
        own: dict[str, list] = {}
        for row, thing in enumerate(self._objects):
            for geometry in self._chosen(thing.get('geometry', ())):
                if geometry['type'] == 'GeometryInstance':
                    matrix = self._matrix(geometry)
                    places.setdefault(int(geometry['template']), []).append((row, matrix))
                elif geometry['type'] in _DEPTHS:
                    faces = self._triangles(geometry, self._points)
                    own.setdefault(thing['type'], []).append((row, faces))
        found = [self._copied(k, copies) for k, copies in places.items()]
        found += [self._merged(kind, group) for kind, group in own.items()]
        found = [(mesh, matrices) for mesh, matrices in found if mesh.n_cells]
        if not found:
            what = 'geometry' if self._lod is None else f'geometry of level of detail {self._lod}'
            raise ValueError(f'it has no {what} with surfaces')
        index = np.repeat(np.arange(len(found)), [len(matrices) for _, matrices in found])
        return [mesh for mesh, _ in found], index, np.concatenate([m for _, m in found])

    def _chosen(self, geometries):
        """Return the geometries of one level of detail."""
        levels = {self._level(geometry) for geometry in geometries}
        if not levels:
            return []
        wanted = max(levels) if self._lod is None else str(self._lod)
        return [g for g in geometries if self._level(g) == wanted]

    def _level(self, geometry):
        if geometry['type'] == 'GeometryInstance':
            geometry = self._templates[geometry['template']]
        return str(geometry.get('lod', ''))

    def _matrix(self, geometry):
        """Return the matrix of an instance, shape (4, 4)."""
        matrix = np.array(geometry['transformationMatrix'], float).reshape(4, 4)
        anchor = np.eye(4)
        anchor[:3, 3] = self._points[geometry['boundaries'][0]]
        return anchor @ matrix

    def _triangles(self, geometry, points):
        """Return the vertex indices of all surfaces as triangles, shape (n, 3)."""
        surfaces = geometry['boundaries']
        for _ in range(_DEPTHS[geometry['type']]):
            surfaces = [surface for shell in surfaces for surface in shell]
        # Relative to its centre: large coordinates would ruin the normals of small faces.
        corners = np.array([corner for surface in surfaces for corner in surface[0]])
        middle = points[corners].mean(0) if len(corners) else 0.0
        near = points - middle
        found = [np.empty((0, 3), int)]
        for surface in surfaces:
            rings = [ring for ring in surface if len(ring) > 2]
            if not rings:
                continue
            triangles, good = self._triangulate(rings, near, True)
            if good:
                found.append(np.asarray(triangles, int).reshape(-1, 3))
        return np.concatenate(found)

    def _copied(self, template, copies):
        """Return the mesh of a template and the matrices of its instances."""
        faces = self._triangles(self._templates[template], self._template_points)
        mesh = _mesh(self._template_points, faces)
        # Instances share the mesh, so attributes of single objects are lost.
        self._mark(mesh, self._objects[copies[0][0]]['type'], np.full(len(faces), -1))
        return mesh, np.stack([matrix for _, matrix in copies])

    def _merged(self, kind, group):
        """Return one mesh of all objects of a type, and its matrix."""
        rows = np.concatenate([np.full(len(faces), row) for row, faces in group])
        faces = np.concatenate([faces for _, faces in group])
        place = np.eye(4)
        if len(faces):
            used = self._points[faces.ravel()]
            place[:3, 3] = (used.min(0) + used.max(0)) / 2
        mesh = _mesh(self._points - place[:3, 3], faces)
        self._mark(mesh, kind, rows)
        return mesh, place[None]

    def _mark(self, mesh, kind, rows):
        mesh.field_data['type'] = [kind]
        mesh.cell_data['object'] = rows
        for name in self._names:
            values = np.array([_number(o.get('attributes', {}).get(name)) for o in self._objects])
            mesh.cell_data[name] = np.where(rows < 0, np.nan, values[rows])


def _points(rows):
    points = np.asarray(rows, float).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise ValueError('a vertex is not finite')
    return points


def _mesh(points, faces):
    used, corners = np.unique(faces, return_inverse=True)
    return pv.PolyData.from_regular_faces(points[used], corners.reshape(faces.shape))


def _number(value):
    good = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if good else np.nan
