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

#: How much smoother than alike corrections are.
SMOOTH = 4.0
_SMALL = 0.02  # weight of a vertex that stays as bright as it is
_MOST = 64.0  # differences beyond are no matter of light, but of what stands there
_ROUNDS = 60


def levelled(vertices, colors, edges, smooth=SMOOTH):
    """Return corrections (n, c) that give the photographs of each vertex one colour.

    Row i is the colour of vertex `vertices[i]` in one photograph; `edges` (m, 2) join such rows.
    """
    vertices, colors = np.asarray(vertices), np.asarray(colors, float)
    edges = np.asarray(edges, int).reshape(-1, 2)
    count = len(vertices)
    rows = np.arange(count)
    there = np.bincount(vertices, minlength=1) > 0
    place = (np.cumsum(there) - 1)[vertices]
    gather = sparse.csr_array((np.ones(count), (place, rows)))
    mean = sparse.diags_array(1 / gather.sum(1)) @ gather
    alike = sparse.eye_array(count, format='csr') - gather.T @ mean
    ends = np.repeat(np.arange(len(edges)), 2)
    signs = np.tile([1.0, -1.0], len(edges))
    across = sparse.csr_array((signs, (ends, edges.ravel())), shape=(len(edges), count))
    normal = (alike + smooth * (across.T @ across) + _SMALL * (gather.T @ mean)).tocsr()
    wanted = -(alike @ np.clip(alike @ colors, -_MOST, _MOST))
    near = sparse.diags_array(1 / normal.diagonal())
    if not wanted.size:
        return np.zeros_like(colors)
    normal, near, wanted = (m.astype(np.float32) for m in (normal, near, wanted))
    with ThreadPoolExecutor(wanted.shape[1]) as pool:  # SciPy's products let others run meanwhile
        solve = partial(cg, normal, rtol=1e-3, maxiter=_ROUNDS, M=near)
        found = list(pool.map(solve, wanted.T))
    return np.stack([values for values, _ in found], 1).astype(float)
