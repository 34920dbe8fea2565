"""The demo's landscape of trees in a plotter."""

from __future__ import annotations

import pyvista as pv

from pvibr.scenes.stage import SKY, Stage, add_ground


def stage(scene, size, **samples) -> Stage:
    """Return an off-screen stage of a landscape without its trees."""
    stage = Stage(size, scene.terrain, scene.view_angle, **samples)
    stage.bounds = scene.terrain.bounds
    return stage


def scenery(scene, max_error, size, *, off_screen):
    """Return a plotter with a landscape and its trees."""
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size))
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
