"""Pages that the site shows in frames: scenes written by `pl.ibr.export_html`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.scenes.walker import walker

#: Where they are built; the site copies them into its folder of static files.
FOLDER = Path(__file__).parent / '_build' / 'pages'


def rings():
    """Return a plotter of 1 000 rings coloured by their height, with a scalar bar."""
    rng = np.random.default_rng(4)
    places = rng.uniform(-1, 1, (1000, 3)) * (6, 6, 2)
    turns = rng.normal(size=(1000, 4))
    pl = pv.Plotter(off_screen=True, window_size=(800, 450))
    ring = pv.ParametricTorus(ringradius=0.3, crosssectionradius=0.1)
    cloud = pv.PolyData(places)
    cloud['height'] = places[:, 2]
    pl.ibr.add_instances(ring, cloud, orient=turns, scalars='height', cmap='plasma')
    pl.add_axes()
    return pl


def hills():
    """Return a plotter of hills by height, and of their slopes, linked."""
    mesh = pv.examples.load_random_hills()
    slopes = mesh.compute_normals()
    slopes['slope'] = np.degrees(np.arccos(np.clip(slopes['Normals'][:, 2], -1, 1)))
    pl = pv.Plotter(off_screen=True, window_size=(800, 450), shape=(1, 2))
    pl.add_mesh(mesh, smooth_shading=True)
    pl.subplot(0, 1)
    pl.add_mesh(slopes, scalars='slope', cmap='coolwarm', smooth_shading=True)
    pl.link_views()
    return pl


def molecule():
    """Return a plotter of spheres and cylinders, which the page has as meshes, with labels."""
    angles = np.linspace(0, 4 * np.pi, 25)
    helix = np.column_stack([np.cos(angles), np.sin(angles), 0.25 * angles])
    pl = pv.Plotter(off_screen=True, window_size=(800, 450))
    pl.ibr.add_spheres(helix, 0.22, color='tomato', specular=0.6)
    pl.ibr.add_cylinders(helix[:-1], helix[1:], radius=0.08, color='white')
    pl.add_point_labels(helix[::8], ['start', 'first turn', 'second', 'end'], font_size=14)
    return pl


def people():
    """Return a plotter of two people, one who walks and one who waves."""
    pl = pv.Plotter(off_screen=True, window_size=(800, 450))
    pl.add_mesh(pv.Plane(i_size=5, j_size=3), color='tan')
    for x, clip in ((-1.0, 'Walk'), (1.0, 'Wave')):
        actor = pl.ibr.add_animated(walker(), clip=clip, name=clip.lower())
        actor.position = (x, 0, 0)
    return pl


def build():
    """Write the pages that are older than this file, or not there."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for make in (rings, hills, molecule, people):
        path = FOLDER / f'{make.__name__}.html'
        if not path.exists() or path.stat().st_mtime < Path(__file__).stat().st_mtime:
            plotter = make()
            plotter.camera_position = 'iso'
            plotter.ibr.export_html(path)
            plotter.close()
