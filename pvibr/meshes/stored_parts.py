"""Parts as arrays and JSON, for another process: VTK's own states of their actors and meshes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.meshes.parts import Part, copy_look
from pvibr.meshes.turntable import Turns

_BLOB = 'blob.'


def to_arrays(parts) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return arrays by name, and what JSON holds, from which `from_arrays` makes equal parts."""
    all_parts, rows = list(parts), []
    manager = _manager()
    for part in all_parts:  # it grows by the levels supplied with parts
        level_ids = []
        for level in part.supplied_levels:
            level_ids.append(list(range(len(all_parts), len(all_parts) + len(level))))
            all_parts += level
        rows.append(
            {
                'actor': manager.RegisterObject(part.actor),
                'mesh': manager.RegisterObject(part.mesh),
                'array': part.actor.GetMapper().GetArrayName() or '',
                'cutoff': part.alpha_cutoff,
                'turns': part.turns,
                'levels': level_ids,
            }
        )
    manager.UpdateStatesFromObjects()
    roots = [row[name] for row in rows for name in ('actor', 'mesh')]
    ids = sorted({k for root in roots for k in (root, *manager.GetAllDependencies(root))})
    blobs = {h: _vtk.vtk_to_numpy(manager.GetBlob(h)) for h in manager.GetBlobHashes(ids)}
    states = [manager.GetState(k) for k in ids]
    arrays = {f'{_BLOB}{h}': blob for h, blob in blobs.items()}
    return arrays, {'states': states, 'parts': rows, 'count': len(parts)}


def from_arrays(arrays, meta) -> list[Part]:
    """Return parts from what `to_arrays` returned; invalid data raise ValueError or KeyError."""
    manager = _manager()
    for name, blob in arrays.items():
        if name.startswith(_BLOB):
            manager.RegisterBlob(name[len(_BLOB) :], _vtk.numpy_to_vtk(blob, deep=True))
    for state in meta['states']:
        if not manager.RegisterState(state):
            raise ValueError('a state must be one of VTK, got another text')
    manager.UpdateObjectsFromStates()
    parts = [_part(manager, row) for row in meta['parts']]
    for part, row in zip(parts, meta['parts'], strict=True):
        part.supplied_levels = tuple([parts[k] for k in ids] for ids in row['levels'])
    return parts[: meta['count']]


def _manager():
    manager = _vtk.vtkObjectManager()
    manager.Initialize()
    return manager


def _part(manager, row) -> Part:
    stored_actor, stored_mesh = (manager.GetObjectAtId(row[name]) for name in ('actor', 'mesh'))
    if not isinstance(stored_actor, _vtk.vtkActor) or not isinstance(
        stored_mesh, _vtk.vtkPolyData
    ):
        raise ValueError('a part must be an actor and a mesh, got others')
    mesh, mapper, actor = pv.wrap(stored_mesh), pv.DataSetMapper(), pv.Actor()
    mapper.ShallowCopy(stored_actor.GetMapper())
    mapper.SetArrayName(row['array'])  # VTK stores but does not restore it
    mapper.SetInputDataObject(mesh)
    actor.SetMapper(mapper)
    actor.SetProperty(stored_actor.GetProperty())
    actor.SetBackfaceProperty(stored_actor.GetBackfaceProperty())
    copy_look(actor, stored_actor)
    turns = row['turns'] and Turns(tuple(row['turns'][0]), int(row['turns'][1]))
    return Part(actor, mesh, row['cutoff'], turns=turns)
