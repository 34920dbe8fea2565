"""The only module that imports VTK: each name is looked up on first use."""

from __future__ import annotations

import importlib
import importlib.util
import os

# Where stock VTK keeps what pvibr uses, the cheap to import first.
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
    'vtkRenderingFreeType',
    'vtkRenderingVolume',
    'vtkRenderingVolumeOpenGL2',
    'vtkInteractionWidgets',
)


def method(prop, name):
    """Return VTK's method of an object, without the check that PyVista makes in Python."""
    return object.__getattribute__(prop, name)


def address(prop) -> str:
    """Return what two wrappers of one VTK object have in common."""
    return method(prop, 'GetAddressAsString')('')


def _root() -> str:
    backend = os.environ.get('PYVISTA_VTK_BACKEND')
    if backend:
        return 'vtkmodules' if backend == 'vtk' else backend
    return 'cvista' if importlib.util.find_spec('cvista') else 'vtkmodules'


def _candidates(root):
    """Yield the modules that may hold a name; some distributions have all names at the root."""
    if root != 'vtkmodules':
        yield importlib.import_module(root)
    for name in _MODULES:
        try:
            yield importlib.import_module(f'{root}.{name}')
        except ModuleNotFoundError:
            continue  # a distribution may leave modules out


def __getattr__(name):
    if name.startswith('__'):  # Python's own questions are never about VTK
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    root = _root()
    for module in _candidates(root):
        try:
            found = getattr(module, name)
        except AttributeError:
            continue
        globals()[name] = found
        return found
    raise AttributeError(
        f'{root!r} has no {name!r} in the modules that pvibr knows: see pvibr/core/_vtk.py'
    )
