"""One animated figure or a crowd."""

from __future__ import annotations

import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.arguments import check_one_of
from pvibr.core.signatures import takes
from pvibr.figures.animated_actor import AnimatedActor
from pvibr.figures.as_figure import as_figure
from pvibr.figures.crowd import Crowd
from pvibr.meshes.posed import matrices


@takes(options=(AnimatedActor, Crowd))
def animated(
    figure,
    poses=None,
    *,
    clip=None,
    up='y',
    orient=None,
    scale=None,
    factor=1.0,
    **options,
) -> AnimatedActor | Crowd:
    """Draw an animated figure, or a crowd of them, posed on the GPU.

    Parameters
    ----------
    figure : pvibr.Figure, path, trimesh.Scene, mesh, or a series of meshes
        Meshes, skeleton and clips; a file that :func:`pvibr.read_gltf`, PyVista or trimesh reads;
        meshes that differ in their points only.
    poses : array_like, shape (n, 3) or (n, 4, 4), optional
        Points or matrices of the members of a crowd, in world units.
    clip : str, int or Clip, optional
        Clip that starts at time 0; by default the first one.
    up : {'y', 'z'}
        'z' turns a figure whose y points up, as it does in glTF and most other files, so that it
        stands in a scene whose z points up, as in most of PyVista's: :meth:`pvibr.Figure.upright`.
    orient : array_like, str, bool or scipy.spatial.transform.Rotation, optional
        Where the figure, or each member, turns: vectors toward which x turns, shape (n, 3),
        quaternions (w, x, y, z), shape (n, 4), matrices, or the name of an array of `poses`, see
        :func:`pvibr.matrices`; a single one for a single figure, whose ``orientation`` it sets.
    scale : float, array_like, shape (n,) or (n, 3), or str, optional
        Factors of sizes, or the name of an array of `poses`.
    factor : float
        Factor of all sizes.
    **options
        See :class:`pvibr.AnimatedActor`, and with `poses` :class:`pvibr.Crowd`.

    Returns
    -------
    pvibr.AnimatedActor or pvibr.Crowd
        A crowd if `poses` are given.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Figure
    >>> from pvibr.animation import FigureMesh, Clip, Skeleton, Track
    >>> rise = Clip('rise', [Track(0, 'translation', [0, 1], [[0, 0, 0], [0, 0, 2]])])
    >>> ball = FigureMesh(pv.Sphere(), node=0)
    >>> joint = [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]
    >>> balloon = Figure([ball], Skeleton([-1], joint), [rise])
    >>> pl = pv.Plotter(off_screen=True)
    >>> actor = pl.ibr.add_animated(balloon, clip='rise')
    >>> pl.ibr.time = 0.5
    >>> actor.center
    (0.0, 0.0, 1.0)
    >>> pl.close()
    """
    check_one_of('up', up, ('y', 'z'))
    figure = as_figure(figure)
    figure = figure.upright() if up == 'z' else figure
    placing = {'orient': orient, 'scale': scale, 'factor': factor}
    if poses is not None:
        return Crowd(figure, poses, **({'clips': clip} | placing | options))
    (matrix,) = matrices([[0.0, 0.0, 0.0]], **placing)
    actor = AnimatedActor(figure, clip=clip, **options)
    placement = _vtk.vtkTransform()
    placement.SetMatrix(pv.vtkmatrix_from_array(matrix))
    actor.orientation, actor.scale = placement.GetOrientation(), placement.GetScale()
    return actor
