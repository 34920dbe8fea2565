"""What vertices have that others were merged into: means of these, moved to where they are."""

from __future__ import annotations

import numpy as np
import scipy  # whose modules load when they are first used

#: Weight of a gradient's size beside its differences, relative to the squared distances of these:
#: none is known across a plane.
_RIDGE = 0.02
_TINY = 1e-300


def merged_vertices(simplified, own, children, targets) -> dict[str, np.ndarray]:
    """Return positions, areas and normals of the new points of a simplified cell.

    `own` are those of the cell's points, of which `children` were merged into points `targets`.
    """
    count, is_new = len(simplified.points), simplified.is_new
    areas = own['areas'][children].astype(float)
    sums = np.bincount(targets, areas, count)
    means = []
    for name in ('points', 'normals'):
        weighted = own[name][children] * areas[:, None]
        columns = [np.bincount(targets, column, count) for column in weighted.T]
        mean = np.stack(columns, 1) / np.maximum(sums, _TINY)[:, None]
        means.append(np.where(is_new[:, None], mean, own[name][simplified.continued]))
    places, normals = means
    gradients = _gradients(simplified.faces, places, normals)
    # A gradient counts as far as it tells what was merged apart: across edges there is none.
    ways, changes = own['points'][children] - places[targets], own['normals'][children]
    told = np.einsum('ij,ijk->ik', ways, gradients[targets])
    products, squares = (
        np.bincount(targets, areas * np.einsum('ij,ij->i', told, other), count)
        for other in (changes - normals[targets], told)
    )
    shares = np.clip(products / np.maximum(squares, _TINY), 0, 1)
    ways = shares[:, None] * (simplified.points - places)
    normals += np.einsum('ij,ijk->ik', ways, gradients)
    arrays = {'points': simplified.points, 'areas': sums, 'normals': normals}
    return {name: values[is_new].astype(own[name].dtype) for name, values in arrays.items()}


def _gradients(faces, places, values) -> np.ndarray:
    """Return the gradients (n, 3, k) of values at places, by least squares along edges."""
    starts = np.concatenate([faces.ravel(), np.roll(faces, 1, axis=1).ravel()])
    ends = np.concatenate([starts[faces.size :], starts[: faces.size]])
    ways, changes = places[ends] - places[starts], values[ends] - values[starts]
    products = ways[:, :, None] * np.concatenate([ways, changes], 1)[:, None]
    shape, edges = (len(places), len(starts)), np.arange(len(starts))
    around = scipy.sparse.coo_array((np.ones(len(starts)), (starts, edges)), shape).tocsr()
    sums = (around @ products.reshape(len(starts), -1)).reshape(len(places), 3, -1)
    squares, moments = sums[..., :3], sums[..., 3:]
    sizes = _RIDGE * np.trace(squares, axis1=1, axis2=2)
    squares += np.maximum(sizes, _TINY)[:, None, None] * np.eye(3)
    return np.linalg.solve(squares, moments)
