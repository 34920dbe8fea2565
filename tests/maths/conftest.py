"""Real calibrations that several tests look at."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pvibr.maths.cameras import as_camera


@pytest.fixture(scope='session')
def berlin(data_dir):
    """Three photographs: file, camera, and the points, colours and pixels matched in each.

    Points and colours are those of the whole scene, pixels are NaN where a photograph has none.
    """
    folder = data_dir / 'projection' / 'opensfm_berlin'
    scene = json.loads((folder / 'reconstruction_example.json').read_text(encoding='utf-8'))[0]
    (lens,) = scene['cameras'].values()
    size = lens['width'], lens['height']
    focus = lens['focal'] * max(size)
    K = [[focus, 0, (size[0] - 1) / 2], [0, focus, (size[1] - 1) / 2], [0, 0, 1]]
    row_of = {name: row for row, name in enumerate(scene['points'])}
    points = np.array([p['coordinates'] for p in scene['points'].values()])
    colors = np.array([p['color'] for p in scene['points'].values()])
    tracks = (folder / 'tracks_example.csv').read_text(encoding='utf-8').splitlines()[1:]
    views = []
    for name, shot in sorted(scene['shots'].items()):
        turn = Rotation.from_rotvec(shot['rotation']).as_matrix()
        terms = [lens['k1'], lens['k2'], 0, 0]
        pixels = np.full((len(points), 2), np.nan)
        for image, track, _, x, y, *_ in (line.split('\t') for line in tracks):
            if image == name and track in row_of:
                # Kept from the picture's centre, y down, in units of its longer side.
                shift = np.array([float(x), float(y)]) * max(size)
                pixels[row_of[track]] = shift + np.array(size) / 2 - 0.5
        camera = as_camera((K, turn, shot['translation'], terms), size)
        views.append((folder / 'images' / name, camera, pixels))
    return points, colors, views
