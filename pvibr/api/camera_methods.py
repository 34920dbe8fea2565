"""Flights of the camera to photographs: methods of ``plotter.ibr``."""

from __future__ import annotations

from pvibr.core.arguments import checked_whole


def fly_to(self, camera, frames=30):
    """Move the camera of the active subplot to that of a photograph.

    Parameters
    ----------
    camera : Photo, pyvista.Camera, Pinhole, LensCamera or Orthographic
        Target; the plotter then shows the photograph's view, except for the lens (see
        :meth:`Photo.to_pyvista`). The picture fills the height of the subplot, and is centred,
        also when the window is resized.
    frames : int, optional
        Number of frames of the flight; 1 to jump.

    Raises
    ------
    TypeError, ValueError
        If `camera` is not a camera, or `frames` is not an integer of at least 1; if `camera` or
        the plotter's is a ``pyvista.Camera`` that is sheared, off axis or has other transforms.

    Warns
    -----
    PvibrWarning
        If leaving out the skew, which VTK's cameras lack, moves any of the picture by more than
        0.01 pixels.

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

    self._check_open()
    fly(self._plotter, camera, checked_whole('frames', frames, 1, 10**6))
