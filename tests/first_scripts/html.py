"""export_html writes a page with every instance."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

pl = pv.Plotter()
pl.ibr.add_instances(pv.Cube(), np.eye(3) * 5, scalars=[0.0, 30, 59])
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'page.html'
    pl.export_html(path)
    assert path.stat().st_size > 10_000
assert (pl.screenshot() != 255).any()
