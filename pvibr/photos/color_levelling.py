"""Colours of photographs levelled where they meet on a surface.

Each photograph of a vertex gets a correction, smooth over the surface, by which all photographs of
that vertex have one colour: Lempitsky and Ivanov, "Seamless mosaicing of image-based texture
maps", CVPR 2007, section 4, here over all photographs that overlap, not those at a border only.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

#: Weight of smooth corrections over equal colours.
SMOOTH = 4.0
_SMALL = 0.02  # weight of keeping the mean colour of a vertex
_MOST = 64.0  # larger differences are occluders, not light
_ROUNDS = 60


def levelled(vertices, colors, edges, smooth=SMOOTH):
    """Return corrections (n, c) that give the photographs of each vertex one colour.

    Row i is the colour of vertex `vertices[i]` in one photograph; `edges` (m, 2) join such rows.
    """
    vertices, colors = np.asarray(vertices), np.asarray(colors, float)
    edges = np.asarray(edges, int).reshape(-1, 2)
    row_count = len(vertices)
    row_index = np.arange(row_count)
    has_color = np.bincount(vertices, minlength=1) > 0
    vertex_row = (np.cumsum(has_color) - 1)[vertices]
    gather = sparse.csr_array((np.ones(row_count), (vertex_row, row_index)))
    mean = sparse.diags_array(1 / gather.sum(1)) @ gather
    deviation = sparse.eye_array(row_count, format='csr') - gather.T @ mean
    ends = np.repeat(np.arange(len(edges)), 2)
    signs = np.tile([1.0, -1.0], len(edges))
    steps = sparse.csr_array((signs, (ends, edges.ravel())), shape=(len(edges), row_count))
    normal = (deviation + smooth * (steps.T @ steps) + _SMALL * (gather.T @ mean)).tocsr()
    right = -(deviation @ np.clip(deviation @ colors, -_MOST, _MOST))
    inverse = sparse.diags_array(1 / normal.diagonal())
    if not right.size:
        return np.zeros_like(colors)
    normal, inverse, right = (m.astype(np.float32) for m in (normal, inverse, right))
    with ThreadPoolExecutor(right.shape[1]) as pool:  # SciPy's products release the GIL
        solve = partial(cg, normal, rtol=1e-3, maxiter=_ROUNDS, M=inverse)
        solutions = list(pool.map(solve, right.T))
    return np.stack([values for values, _ in solutions], 1).astype(float)
