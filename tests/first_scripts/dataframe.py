"""A DataFrame of points, a mesh at each, coloured by a column."""

import numpy as np
import pandas as pd
import pyvista as pv

rng = np.random.default_rng(1)
table = pd.DataFrame(rng.uniform(0, 9, (50, 3)), columns=['x', 'y', 'z'])
table['height'] = table['z'] * 2

pl = pv.Plotter()
cows = pl.ibr.add_instances(pv.Cone(), table, scalars='height')
assert 'height' in pl.scalar_bars
picture = pl.show(screenshot=True, return_img=True)

assert len(cows) == 50
np.testing.assert_allclose(cows.scalars, table['height'])
assert (picture != 255).any()
