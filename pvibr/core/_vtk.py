"""The only module that imports VTK: each name is looked up on first use."""

from __future__ import annotations

import importlib
import importlib.util
import os

# The modules of stock VTK that pvibr uses, those cheapest to import first.
_MODULES = (
    'util.numpy_support',
    'vtkCommonCore',
    'vtkCommonMath',
    'vtkCommonTransforms',
    'vtkCommonDataModel',
    'vtkCommonExecutionModel',
    'vtkRenderingCore',
    'util.misc',
    'vtkRenderingOpenGL2',
    'vtkRenderingAnnotation',
    'vtkFiltersCore',
    'vtkFiltersGeneral',
    'vtkFiltersGeometry',
    'vtkFiltersSources',
    'vtkInteractionStyle',
    'vtkRenderingLOD',
    'vtkIOImage',
    'vtkIOGeometry',
    'vtkIOExportGL2PS',
    'vtkRenderingFreeType',
    'vtkRenderingVolume',
    'vtkRenderingVolumeOpenGL2',
    'vtkInteractionWidgets',
    'vtkSerializationManager',
)


def method(prop, name):
    """Return a VTK method, bypassing PyVista's attribute check in Python."""
    return object.__getattribute__(prop, name)


def address(prop) -> str:
    """Return the address of a VTK object, equal for all its Python wrappers."""
    return method(prop, 'GetAddressAsString')('')


def _root() -> str:
    backend = os.environ.get('PYVISTA_VTK_BACKEND')
    if backend:
        return 'vtkmodules' if backend == 'vtk' else backend
    return 'cvista' if importlib.util.find_spec('cvista') else 'vtkmodules'


def _candidates(root):
    """Yield the modules that may define a name; some distributions define all at the root."""
    if root != 'vtkmodules':
        yield importlib.import_module(root)
    for name in _MODULES:
        try:
            yield importlib.import_module(f'{root}.{name}')
        except ModuleNotFoundError:
            continue  # distributions may omit modules


def __getattr__(name):
    if name.startswith('__'):  # Python's own lookups, never VTK
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    root = _root()
    for module in _candidates(root):
        try:
            attribute = getattr(module, name)
        except AttributeError:
            continue
        globals()[name] = attribute
        return attribute
    raise AttributeError(
        f'{root!r} has no {name!r} in the modules that pvibr knows: see pvibr/core/_vtk.py'
    )
