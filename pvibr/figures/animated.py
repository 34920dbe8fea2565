"""One animated figure or a crowd."""

from __future__ import annotations

from pvibr.core.signatures import takes
from pvibr.figures.animated_actor import AnimatedActor
from pvibr.figures.as_figure import as_figure
from pvibr.figures.crowd import Crowd


@takes(options=(AnimatedActor, Crowd))
def animated(figure, poses=None, *, clip=None, **options) -> AnimatedActor | Crowd:
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
    figure = as_figure(figure)
    if poses is None:
        return AnimatedActor(figure, clip=clip, **options)
    return Crowd(figure, poses, **({'clips': clip} | options))
