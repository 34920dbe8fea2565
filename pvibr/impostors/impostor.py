"""Impostors on the fly: actors drawn as images of themselves for as long as these serve."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.determinism import is_deterministic
from pvibr.core.params import Param
from pvibr.impostors.cards import ImpostorCards
from pvibr.impostors.costs import Costs
from pvibr.impostors.images import FINEST, Eyes, Images
from pvibr.impostors.instance_sets import InstanceSet
from pvibr.impostors.leaves import Leaves
from pvibr.impostors.nodes import FARTHEST, NEAREST, Nodes
from pvibr.impostors.sources import Materials, Source
from pvibr.instances.instances import Instances
from pvibr.maths.views import may_see, may_see_boxes
from pvibr.scene.casters import listed
from pvibr.scene.thing import Thing

#: Side of an image in texels above which there is none.
LARGEST = 1024
# World units a frame, of the radius of everything.
_SLOW = 1e-4
# What was drawn one way goes on so unless another is cheaper by this.
_KEPT = 0.8


class Impostor(Thing):
    """Actors that are drawn as images of themselves, taken again only when they must be.

    An image lies on a card through the middle of its actor, across the line of sight from where it
    was taken, and keeps the depth of what it shows. It serves for as long as no point of the
    actor's box is shown further than `max_error` from where it is. Light is not in it: that is
    computed in every frame. The actors stay what they are to all others: they can be picked,
    moved, hidden and removed.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of these
        In the subplot that this is added to; instances with `hierarchical` only.
    name : str, optional
        What reports call it.
    **settings
        See the class's Params.

    Raises
    ------
    TypeError
        Where one is neither.
    ValueError
        Where there is none, one is given twice, instances without `hierarchical`, or a setting
        is out of range.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> ball = pl.add_mesh(pv.Sphere(theta_resolution=300, phi_resolution=300))
    >>> impostor = pl.ibr.add_impostor(ball)
    >>> pl.show(auto_close=False)
    >>> impostor.report()['images']
    1
    >>> pl.close()
    """

    web = 'shown', 'its actors, as meshes'
    presets = {'fine': {'max_error': 0.5}, 'fast': {'max_error': 3.0, 'budget_ms': 10.0}}
    max_error = Param(
        1.0, 'How far from where it is anything may be shown.', range='(0, inf)', unit='px'
    )
    budget_ms = Param(
        None,
        'What may be drawn again in a frame, the worst first; None for all that is wrong.',
        range='[0, inf)',
        unit='ms',
        kind=float,
    )
    depth = Param(True, 'Whether images have depth, so that they meet others as their actors do.')
    hierarchical = Param(False, 'Whether actors beside each other may share an image.')
    memory = Param(2**28, 'What the images may take.', range='[65536, inf)', unit='bytes')
    only_if_faster = Param(
        True, 'Replace only actors that are slower to draw themselves, as measured here.'
    )
    views = Param(2, 'Images kept of an actor.', range='[1, 16]')

    def __init__(self, actors, *, name=None, **settings):
        self.name = name
        found = _checked(actors)
        super().__init__(**settings)
        if not self.hierarchical and any(isinstance(thing, Instances) for thing in found):
            msg = (
                'actors has Instances, which are drawn as images of their own: give '
                'hierarchical=True to have images of many of them, or leave them out'
            )
            raise ValueError(msg)
        self._materials = Materials()
        self._stand_for(found)
        self._cards = ImpostorCards()
        self._costs = Costs()
        self._nodes: Any = None
        self._last = np.zeros(0, int)
        self._images: Any = None
        self._props_time = -1
        self._version = 0
        self._frame: Any = None
        self._told: dict = {}
        self._why = self._leaves.why
        self._drawn_frames = self._frames = 0
        self._want = 0
        self.rendered = 0

    # -- what it is to others --------------------------------------------------------------------

    @property
    def props(self) -> tuple:
        """What stands in the scene for those that it is of; with the last of them it goes."""
        return self._props

    def actors(self) -> list:
        """Return the actor of all cards, and those that it stands for."""
        return [self._cards.actor, *(thing for thing in self._things if _is_actor(thing))]

    def drawn(self) -> list:
        """Return what draws it in the frame that it was prepared for, less instances."""
        real = self._leaves.drawn()
        return [self._cards.actor, *real] if self._cards.actor.GetVisibility() else real

    def solids(self) -> list:
        """Return the actors whose meshes throw its shadows."""
        return self._leaves.shown()

    def content_key(self) -> tuple:
        """Return what changes whenever what is drawn does, the camera left out."""
        if self._frame is None and not len(self._leaves.hidden):
            self._sync()
        return self._version, self._revision

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds of all actors that are visible."""
        found = [actor.GetBounds() for actor in self._leaves.shown()]
        found += [group.thing.bounds for group in self._leaves.sets]
        boxes = np.array([b for b in found if b and b[0] <= b[1]]).reshape(-1, 6)
        if not len(boxes):
            return (1.0, -1.0) * 3
        ends = np.stack([boxes[:, ::2].min(0), boxes[:, 1::2].max(0)], 1)
        return tuple(ends.ravel().tolist())

    @property
    def images(self):
        """The images with their pool of tiles; None before the first frame."""
        return self._images

    @property
    def nodes(self):
        """What images are of, with their boxes; None before the first frame."""
        return self._nodes

    # -- the life of an effect -------------------------------------------------------------------

    def attach(self, pipeline):
        """Put the cards into the scene."""
        renderer = pipeline.renderer
        mine = {address(a) for a in self.props}
        for actor in self.props:
            if not renderer.HasViewProp(actor):
                msg = f'actors: {actor!r} is not in this subplot; add it there first'
                raise ValueError(msg)
        for other in pipeline.effects:
            if isinstance(other, Impostor) and mine & {address(a) for a in other.props}:
                msg = f'actors: {other.name} stands for some of them already; remove it first'
                raise ValueError(msg)
        super().attach(pipeline)

    def _put_in(self, renderer):
        renderer.AddViewProp(self._cards.actor)

    def _take_out(self, renderer):
        self._leaves.rest()
        renderer.RemoveViewProp(self._cards.actor)

    def deactivate(self):
        """Show the actors themselves."""
        self._leaves.rest()
        self._cards.hide()
        self._frame = None

    def prepare(self, frame):
        """Choose what is drawn as an image, and draw the images that no longer serve."""
        if frame is self._frame:
            return
        self._leaves.show()
        self._sync()
        try:
            self._prepare(frame)
        except Exception:
            self.deactivate()
            raise
        self._frame = frame

    def _prepare(self, frame):
        if self._cards.failure:
            raise RuntimeError(self._cards.failure)
        if not len(self._leaves):
            return  # instances, none of them
        if self._nodes is None or self._nodes.has_levels != self._is_deep():
            self._build()
        self._fit()
        if self._images.views != self.views:
            self._images.release()
            self._images = Images(len(self._nodes), self.views)
        eyes = Eyes(frame)
        self._allowed = self.max_error / frame.quality
        self._costs.move(frame)
        nodes, why = self._cut(eyes)
        shown = self._draw_images(frame, eyes, nodes, why)
        self._show(frame, eyes, shown, why)
        self._frames += 1

    def finish(self, frame):
        """Give everyone their actors back."""
        if frame is not self._frame:
            return
        self._cards.hide()
        self._leaves.show()
        self._frame = None

    # -- what the actors are now -----------------------------------------------------------------

    def _stand_for(self, things):
        self._things = things
        self._props = tuple(thing if _is_actor(thing) else thing.actor for thing in things)
        actors = [thing for thing in things if _is_actor(thing)]
        sets = [InstanceSet(t, self._materials) for t in things if not _is_actor(t)]
        self._leaves = Leaves([Source(actor, self._materials) for actor in actors], sets)

    def _sync(self):
        self._forget_removed()
        changed = self._leaves.update()
        if not changed:
            return
        self._version += 1
        self._fitted = False
        if self._nodes is not None:
            self._costs.changed(changed)
            self._images.drop_objects(self._nodes.tree.above(changed))

    def _forget_removed(self):
        time = self.pipeline.renderer.GetViewProps().GetMTime()
        if time == self._props_time:
            return
        self._props_time = time
        present = {address(p) for p in self.pipeline.renderer.GetViewProps()}
        pairs = zip(self._things, self._props, strict=True)
        kept = [thing for thing, prop in pairs if address(prop) in present]
        if len(kept) == len(self._things):
            return
        self._leaves.release(self.pipeline.window)
        self._stand_for(kept)
        self._version += 1
        self._forget_tree()

    def _is_deep(self) -> bool:
        return bool(self.hierarchical and len(self._leaves) > 1)

    def _forget_tree(self):
        if self._images is not None:
            self._images.release()
        self._nodes = self._images = None
        self._last = np.zeros(0, int)

    def _build(self):
        self._forget_tree()
        self._nodes = Nodes(self._leaves, self._is_deep())
        self._images = Images(len(self._nodes), self.views)
        self._costs.count(len(self._leaves))
        self._fitted = False

    _fitted = False

    def _fit(self):
        """Fit the boxes of the tree to the actors, where these changed."""
        if self._fitted:
            return
        self._fitted = True
        self._nodes.fit()
        if self._nodes.live.any():
            self._cards.fit(len(self._leaves), self._nodes.bounds)

    # -- what is drawn how -----------------------------------------------------------------------

    def _cut(self, eyes):
        """Return the nodes that may be images, and for each actor why it is none, where so."""
        nodes, n = self._nodes, len(self._leaves)
        why = self._leaves.why.copy()
        here = nodes.live & may_see_boxes(eyes.frame.view, nodes.low, nodes.high)
        why[nodes.live[:n] & ~here[:n]] = 'out of view'
        away = eyes.away(nodes.center)
        scale = eyes.pixels(nodes.center, nodes.radius) / away
        pixels = 2 * nodes.radius * scale
        ahead = (away > NEAREST * nodes.radius) | eyes.parallel
        usable = ahead & (pixels * 1.2 / self._allowed < min(LARGEST, self._side()))
        seconds = self._costs.meshes(self._leaves, nodes)
        own = self._own_costs(eyes, seconds, scale, away)
        cost = np.where(usable, own, np.inf)
        # A mesh is an actor's other choice, and the only one of those that are near.
        plain = self._leaves.plain(seconds[:n], pixels[:n], self._area[:n], self._costs.pixel)
        near = ~usable[:n]
        dear = (cost[:n] > plain) & self.only_if_faster
        cost[:n] = np.where(near | dear, plain, cost[:n])
        found = nodes.tree.cheapest(cost, here)
        leaves = found[found < n]
        why[leaves[near[leaves]]] = 'near'
        why[leaves[dear[leaves] & ~near[leaves]]] = 'cheaper as a mesh'
        self._last = found
        keep = (found >= n) | ~(near | dear)[np.minimum(found, n - 1)]
        return found[keep], why

    def _own_costs(self, eyes, seconds, scale, away):
        """Return the seconds of a frame that the image of each node takes."""
        nodes = self._nodes
        depth, self._area = nodes.faces(eyes)
        self._area *= scale**2
        # Who stands still may go on: slowly, by the size of the scene.
        speed = max(self._costs.speed, _SLOW * nodes.radius.max())
        rate = 0.0 if eyes.parallel else speed * depth * scale / away / self._allowed
        there = self._images.alive.reshape(len(nodes), -1).any(1)
        rate = rate + np.where(there, 0.0, 1 / FARTHEST)  # an image that there is costs nothing
        own = self._costs.images(seconds, rate, self._costs.often(nodes.tree), self._area)
        own[self._last] *= _KEPT
        return own

    def _side(self):
        """Return the side of the largest pool that the memory allows."""
        pool = self._images.pool
        return LARGEST if pool is None else pool.largest

    def _draw_images(self, frame, eyes, nodes, why):
        """Draw what no longer serves; return images to be shown and their nodes, (k, 2)."""
        images = self._images
        view, moved, coarse = images.errors(nodes, eyes)
        worst = np.maximum(moved, coarse)
        wrong = ~(worst <= self._allowed) | (coarse * FINEST < min(self._allowed, 1.0))
        images.used[view[~wrong]] = frame.index
        queue = np.flatnonzero(wrong)
        queue = queue[np.argsort(-worst[queue], kind='stable')]
        if len(queue):
            new = self._take(frame, eyes, nodes[queue])
            view[queue] = np.where(new >= 0, new, view[queue])
            made = new >= 0
            _, moved[queue[made]], coarse[queue[made]] = images.errors(nodes[queue[made]], eyes)
            worst = np.maximum(moved, coarse)
        # Others' tiles may have been taken meanwhile.
        gone = (view < 0) | ~images.alive[view]
        for node in nodes[gone]:
            why[self._nodes.tree.below(node)] = 'no room' if self._want else 'no time'
        images.used[view[~gone]] = frame.index
        self._told['error_px'] = float(worst[~gone].max(initial=0.0))
        return np.stack([view[~gone], nodes[~gone]], 1)

    def _take(self, frame, eyes, nodes):
        """Draw images of nodes within the budget; return their indices, -1 for those left."""
        images, found = self._images, np.full(len(nodes), -1)
        card = self._nodes.cards(nodes, eyes, self._costs.step, self._allowed)
        sizes = images.sizes(card, eyes, self._allowed)
        if self._want and images.pool is not None and images.pool.may_grow:
            images.close_pool()
        area = int((4.0 ** np.ceil(np.log2(sizes.max(1).clip(8, LARGEST)))).sum())
        images.open(frame, max(area, self._want), self.memory)
        self._want = 0
        endless = self.budget_ms is None or is_deterministic()
        left = np.inf if endless else self.budget_ms / 1e3
        drawn = 0
        with images.pool.target.drawing():
            for k, node in enumerate(nodes.tolist()):
                below = [self._leaves.sources[i] for i in self._nodes.below(node)]
                if drawn and self._costs.expected(below) > left:
                    break
                index = images.room(node, sizes[k].max(), frame.index)
                if index is None:
                    self._want = max(2 * area, 2 * images.pool.side**2)
                    continue
                with self._costs.timed(frame.window, below) as spent:
                    images.draw(index, card, k, sizes[k], below, parallel=eyes.parallel)
                images.used[index] = images.taken[index] = frame.index
                found[k] = index
                left -= spent.seconds
                drawn += 1
        images.drawer.done()
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        self.rendered += drawn
        self._drawn_frames += drawn > 0
        return found

    def _show(self, frame, eyes, shown, why):
        self._cards.attach(depth=self.depth, materials=self._materials)
        if len(shown):
            rows = self._images.rows(frame, shown[:, 0])
            self._cards.show(frame, rows, self._images.pool)
            area = float(self._area[shown[:, 1]].sum())
            self._costs.measure(frame, self._cards, self._images.drawer, area)
        else:
            self._cards.hide()
        for thing in self._leaves.hide(why):
            if thing.enabled and thing.needed(frame) is True:
                thing.prepare(frame)  # it may have been before
        self._told['shown'] = len(shown)
        self._why = why

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors themselves that may be seen in a frame that is not its own."""
        if self._frame is None:
            self._sync()
        found = self._leaves.shown()
        boxes = [a.GetBounds() for a in found]
        keep = [bool(b) and b[0] <= b[1] for b in boxes]
        found = [a for a, k in zip(found, keep, strict=True) if k]
        if not found:
            return []
        seen = may_see(frame.view, [b for b, k in zip(boxes, keep, strict=True) if k])
        return [a for a, s in zip(found, seen, strict=True) if s]

    # -- memory ----------------------------------------------------------------------------------

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        window = None if self.pipeline is None else self.pipeline.window
        self._cards.release(window)
        self._forget_tree()
        self._leaves.release(window)
        self._frame = None

    def report(self) -> dict:
        """Return what is drawn how, the largest error shown, and how often images were drawn."""
        images = self._images
        held = 0 if images is None else images.nbytes + self._cards.nbytes
        return {
            'bytes': held,
            'images': 0 if images is None else int(images.alive.sum()),
            'rendered': self.rendered,
            'frames_with_rendering': self._drawn_frames / max(self._frames, 1),
            **self._told,
            'meshes': dict(Counter(w for w in self._why if w and w != 'hidden')),
        }


def _checked(actors) -> list:
    """Return what an impostor is asked to stand for, each an actor or instances, and only once."""
    found = listed(actors)
    for thing in found:
        if not _is_actor(thing) and type(thing) is not Instances:
            msg = (
                f'actors holds a {type(thing).__name__}: each must be an actor, as add_mesh '
                'returns it, or Instances, as add_instances does'
            )
            raise TypeError(msg)
    if not found:
        msg = 'actors is empty: give one or more'
        raise ValueError(msg)
    seen: set = set()
    for place, thing in enumerate(found):
        if id(thing) in seen:
            msg = f'actors[{place}] is there twice: give each of them once'
            raise ValueError(msg)
        seen.add(id(thing))
    return found


def _is_actor(thing) -> bool:
    return isinstance(thing, _vtk.vtkActor)
