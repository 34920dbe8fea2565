"""Flights of the camera to photographs: methods of ``plotter.ibr``."""

from __future__ import annotations

from pvibr.core.arguments import checked_whole


def fly_to(self, camera, frames=30):
    """Move the camera of the active subplot to that of a photograph.

    Parameters
    ----------
    camera : Photo, pyvista.Camera, Pinhole, LensCamera or Orthographic
        Target; in a window of its picture's aspect ratio the plotter then shows the
        photograph's view, except for the lens (see :meth:`Photo.to_pyvista`).
    frames : int, optional
        Number of frames of the flight; 1 to jump.

    Raises
    ------
    TypeError, ValueError
        If `camera` is not a camera, or `frames` is not an integer of at least 1.

    Examples
    --------
    >>> import numpy as np
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
    >>> photo = pvibr.Photo('a.jpg', pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100)))
    >>> pl.ibr.fly_to(photo, frames=1)
    >>> np.round(pl.camera.position, 6).tolist()
    [0.0, 0.0, -5.0]
    >>> pl.close()
    """
    from pvibr.photos.camera_flight import fly

    fly(self._plotter, camera, checked_whole('frames', frames, 1, 10**6))
