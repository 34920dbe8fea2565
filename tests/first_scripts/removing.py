"""clear, clear_actors, remove_actor by name and by handle."""

import pyvista as pv

places = [(2.0 * x, 0, 0) for x in range(5)]


def is_empty(pl):
    pl.render()
    picture = pl.screenshot()
    return (picture == picture[0, 0]).all()


pl = pv.Plotter()
for remove in (
    lambda thing: pl.remove_actor(thing),
    lambda thing: pl.remove_actor('balls'),
    lambda thing: pl.ibr.remove(thing),
    lambda thing: pl.ibr.remove('balls'),
    lambda thing: pl.clear_actors(),
    lambda thing: pl.clear(),
):
    balls = pl.ibr.add_instances(pv.Sphere(), places, name='balls')
    assert pl.actors['balls'] is balls
    assert not is_empty(pl)
    remove(balls)
    assert is_empty(pl)
    assert 'balls' not in pl.actors
    assert len(pl.ibr) == 0
