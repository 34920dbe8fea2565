"""The landscape of trees in a plotter, as in the demo."""

from __future__ import annotations

import pyvista as pv

from pvibr.capture.offscreen import SKY, add_ground


def scenery(scene, max_error, size, *, off_screen):
    """Return a plotter with a landscape."""
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), lighting='none')
    for light in scene.lights():
        plotter.add_light(light)
    plotter.set_background(SKY)  # type: ignore[arg-type]
    plotter.camera.view_angle = scene.view_angle
    add_ground(plotter, scene.terrain)
    plant(plotter, scene, max_error)
    plotter.camera_position = scene.path(1)[0]
    return plotter


def plant(plotter, scene, max_error):
    """Add the trees of a landscape as instances."""
    return plotter.ibr.add_instances(
        scene.parts(), scene.matrices, index=scene.index, max_error=max_error, name='trees'
    )
