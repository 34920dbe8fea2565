"""Effects and handles are pickled and copied, or say why not."""

import copy
import pickle

import pyvista as pv

import pvibr

bloom = pvibr.Bloom()
bloom.threshold = 0.5
assert copy.deepcopy(bloom).threshold == 0.5
assert pickle.loads(pickle.dumps(bloom)).threshold == 0.5
pl = pv.Plotter()
balls = pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
for copied in (copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))):
    try:
        other = copied(balls)
    except TypeError as error:
        assert 'Instances' in str(error)
    else:
        assert len(other) == 5
