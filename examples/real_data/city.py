"""
A city from CityJSON
====================

The 570 objects of a CityJSON file, by type: what shares a template is drawn as instances, what
has a geometry of its own is one mesh. Numbers among the attributes are cell data.
"""

from pathlib import Path

import pyvista as pv

import pvibr

FILE = Path('../shared/data/instances/delft.json')
COLORS = {
    'Bridge': 'tan',
    'Building': 'indianred',
    'LandUse': 'yellowgreen',
    'PlantCover': 'forestgreen',
    'Road': 'lightgray',
    'WaterBody': 'steelblue',
}

meshes, index, matrices = pvibr.read_city(FILE)
pl = pv.Plotter(window_size=(1280, 720))
for k, matrix in zip(index, matrices, strict=True):
    kind = str(meshes[k].field_data['type'][0])
    print(f'{kind}: {meshes[k].n_cells} triangles')
    placed = meshes[k].transform(matrix, inplace=False)
    pl.add_mesh(placed, color=COLORS.get(kind, 'white'), name=kind)
pl.ibr.add(pvibr.Outline())

# %%
# From the south west, over the roofs.
x, y, _ = pl.center
pl.camera_position = [(x - 80, y - 380, 260), (x + 40, y, 0), (0, 0, 1)]
pl.reset_camera_clipping_range()
pl.show()
