"""Dynamic impostors: actors cached as images until an error bound is exceeded."""

from __future__ import annotations

from collections import Counter

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.params import Param
from pvibr.gl.drawer import Drawer
from pvibr.impostors.cards import ImpostorCards
from pvibr.impostors.costs import Costs
from pvibr.impostors.images import FINEST, Eyes, Images
from pvibr.impostors.instance_sets import InstanceSet
from pvibr.impostors.leaves import Leaves
from pvibr.impostors.members import checked, is_actor
from pvibr.impostors.nodes import FARTHEST, NEAREST, Nodes
from pvibr.impostors.sources import Materials, Source
from pvibr.instances.instances import Instances
from pvibr.maths.views import may_see_boxes
from pvibr.scene.casters import listed
from pvibr.scene.substitute import Substitute, addresses

#: Side of an image in texels above which there is none.
LARGEST = 1024
# World units a frame, of the radius of everything.
_SLOW = 1e-4
# What was drawn one way goes on so unless another is cheaper by this.
_KEPT = 0.8
# Places for actors that may come, at least, once one did.
_SPARE = 64


class Impostor(Substitute):
    """Actors cached as images, which are rendered again once an error bound is exceeded.

    An image lies on a card through the centre of its actor, perpendicular to the line of sight,
    with depth. It is valid while no point of the actor's bounding box is displaced by more than
    `max_error`. It is lit in every frame. The actors themselves can still be picked, moved,
    hidden and removed.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of these
        Actors of the subplot that this is added to; instances require `hierarchical`.
    name : str, optional
        Name in reports.
    **settings
        Settings of the class.

    Raises
    ------
    TypeError
        If `actors` has something that is neither an actor nor instances.
    ValueError
        If `actors` is empty or has one twice, instances are given without `hierarchical`, or a
        setting is out of range.

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

    presets = {'fine': {'max_error': 0.5}, 'fast': {'max_error': 3.0, 'budget_ms': 10.0}}
    depth = Param(True, 'Depth-test images per pixel, as their actors are.')
    hierarchical = Param(False, 'Let neighbouring actors share images.')
    memory = Param(2**28, 'Maximum GPU memory of the images.', range='[65536, inf)', unit='bytes')
    views = Param(2, 'Maximum number of images per actor.', range='[1, 16]')

    things: list
    _leaves: Leaves
    _nodes: Nodes  # both while `_built`
    _images: Images
    _built = _fitted = False

    def __init__(self, actors, *, name=None, **settings):
        found = checked(actors)
        super().__init__(**settings)
        if not self.hierarchical and any(isinstance(thing, Instances) for thing in found):
            raise ValueError(
                'actors has Instances, which are drawn as images of their own: give '
                'hierarchical=True to have images of many of them, or leave them out'
            )
        self.name = name
        self._materials = Materials()
        self._stand_for(found)
        self._card = ImpostorCards()
        self._share_material()
        self._costs = Costs()
        self._last = np.zeros(0, int)
        self._props_time = -1
        self._told: dict = {}
        self._why = self._leaves.why
        self._drawn_frames = self._frames = 0
        self._want = 0
        self.rendered = 0

    # -- what it is to others --------------------------------------------------------------------

    def is_gone(self, renderer) -> bool:
        """Return True if it or the last of its actors was removed from the scene."""
        return super().is_gone(renderer) or not any(map(renderer.HasViewProp, self.things))

    def _contents(self) -> str:
        return f'{len(self.things)} actors'

    def _claimed(self) -> list:
        return self.things

    def actors(self) -> list:
        """Return the actor of all cards, and the replaced actors."""
        return [self._card.actor, *self._stood_for()]

    def _stood_for(self) -> list:
        return [thing for thing in self.things if is_actor(thing)]

    def _cards(self) -> list:
        return [self._card]

    def solids(self) -> list:
        """Return the actors whose meshes cast its shadow volumes."""
        return self._leaves.shown()

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors themselves that may be seen in a frame that is not its own."""
        if self._frame is None:
            self._update()
        return super().draws(frame, depth=depth)

    def _boxes(self) -> list:
        return [*super()._boxes(), *(owner.thing.bounds for owner in self._leaves.sets)]

    @property
    def images(self) -> Images | None:
        """The images with their pool of tiles; None before the first frame."""
        return self._images if self._built else None

    @property
    def nodes(self) -> Nodes | None:
        """Tree over what images show; None before the first frame."""
        return self._nodes if self._built else None

    # -- actors that come and go -----------------------------------------------------------------

    def add(self, actors):
        """Stand for more actors, at the cost of these.

        Parameters
        ----------
        actors : vtkActor, pvibr.Instances, or sequence of these
            Actors of its subplot; adding instances renews all images.

        Raises
        ------
        TypeError
            If `actors` has something that is neither an actor nor instances.
        ValueError
            If an impostor replaces one already, or one is in another subplot.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> impostor = pl.ibr.add_impostor(pl.add_mesh(pv.Sphere()))
        >>> later = pl.add_mesh(pv.Sphere(center=(1, 0, 0)))
        >>> impostor.add(later)
        >>> len(impostor.things)
        2
        >>> impostor.remove(later)
        >>> impostor.things == [later]
        False
        >>> pl.close()
        """
        found = self._refused_none(checked(actors))
        self.things = [*self.things, *found]
        if not all(map(is_actor, found)):
            self._begin_again(self.things)
            return
        missing = len(found) - self._leaves.sources.count(None)
        if missing > 0:
            self._grow(max(missing, _SPARE, len(self._leaves) // 4))
        for actor in found:
            self._leaves.add(Source(actor, self._materials))

    def remove(self, actors=None):
        """Stand no more for some actors, which are drawn themselves; or remove the impostor.

        Parameters
        ----------
        actors : vtkActor, pvibr.Instances, or sequence of these, optional
            Some of its actors. Without any it is removed from its plotter, as it is once the last
            of its actors was.

        Raises
        ------
        ValueError
            If it does not replace one of them.
        """
        if actors is None:
            super().remove()
            return
        found = listed(actors)
        mine = {id(thing) for thing in self.things}
        for place, thing in enumerate(found):
            if id(thing) not in mine:
                raise ValueError(
                    f'actors[{place}] is none of the {len(mine)} that {self.name} stands for'
                )
        if self.pipeline is not None:
            self.pipeline.make_current()
        self._forget(found)

    def _refused_none(self, found):
        mine = addresses(self.things)
        for place, thing in enumerate(found):
            if address(thing) in mine:
                raise ValueError(
                    f'actors[{place}] is one that {self.name} stands for already: leave it out'
                )
        if self.pipeline is not None:
            self._claim(self.pipeline, found)
        return found

    def _grow(self, more):
        before = len(self._leaves)
        self._leaves.grow(more)
        if self._built:
            inner = len(self._nodes.tree.children)
            self._nodes.grow(more)
            added = [before] * more, [before + inner] * (len(self._nodes) - before - inner - more)
            self._images.grow(np.concatenate(added).astype(int))
            self._costs.grow(more)
            self._last = self._last + more * (self._last >= before)

    def _forget(self, gone):
        """Let go of some things."""
        away = {id(thing) for thing in gone}
        self.things = [thing for thing in self.things if id(thing) not in away]
        if not all(map(is_actor, gone)):
            self._begin_again(self.things)
            return
        for actor in gone:
            leaf = self._leaves.remove(actor, self.pipeline and self.pipeline.window)
            if self._built:
                self._costs.changed([])
                self._images.drop_objects(self._nodes.remove(leaf))
        self._version += 1
        self._fitted = False

    # -- the life of an effect -------------------------------------------------------------------

    def _conflicts(self, other, props) -> bool:
        return isinstance(other, Impostor) and bool(addresses(props) & addresses(other.things))

    def deactivate(self):
        """Draw the actors themselves again."""
        super().deactivate()
        self._leaves.deactivate()

    def _give_back(self):
        self._card.hide()
        self._leaves.watch.show()

    def _prepare(self, frame):
        if not len(self._leaves):
            return  # instances, none of them
        if not self._built or self._nodes.has_levels != self._is_deep():
            self._build(frame)
        self._fit()
        if self._images.views != self.views:
            self._images.release()
            self._images = Images(len(self._nodes), self.views, Drawer(frame.renderer))
        eyes = Eyes(frame)
        self._allowed = self.max_error / frame.quality
        self._costs.move(frame)
        nodes, why = self._cut(eyes)
        shown = self._draw_images(frame, eyes, nodes, why)
        self._show(frame, eyes, shown, why)
        self._frames += 1

    # -- what the actors are now -----------------------------------------------------------------

    def _stand_for(self, things):
        self.things = things
        actors = [thing for thing in things if is_actor(thing)]
        sets = [InstanceSet(t, self._materials) for t in things if not is_actor(t)]
        self._leaves = Leaves([Source(actor, self._materials) for actor in actors], sets)

    def _update(self):
        self._forget_removed()
        if any(owner.outgrown() for owner in self._leaves.sets):
            self._begin_again(self.things)
        changed = self._leaves.update()
        if not changed:
            return
        self._version += 1
        self._fitted = False
        if self._built:
            tree = self._nodes.tree
            for leaf in changed:
                if not tree.has(leaf):
                    self._images.drop_objects(self._nodes.insert(leaf))
            self._costs.changed(changed)
            self._images.drop_objects(tree.above(changed))

    def _forget_removed(self):
        time = self.pipeline.renderer.GetViewProps().GetMTime()
        if time == self._props_time:
            return
        self._props_time = time
        present = set(map(id, self.pipeline.renderer.GetViewProps()))
        gone = [thing for thing in self.things if id(thing) not in present]
        if gone:
            self._forget(gone)

    def _begin_again(self, kept):
        self._leaves.release(self.pipeline.window)
        self._stand_for(kept)
        self._version += 1
        self._forget_tree()

    def _is_deep(self) -> bool:
        return bool(self.hierarchical)

    def _forget_tree(self):
        if self._built:
            self._images.release()
        self._built = False
        self._last = np.zeros(0, int)

    def _build(self, frame):
        self._forget_tree()
        self._nodes = Nodes(self._leaves, self._is_deep())
        self._images = Images(len(self._nodes), self.views, Drawer(frame.renderer))
        self._costs.count(len(self._leaves))
        self._built, self._fitted = True, False

    def _fit(self):
        """Fit the boxes of the tree to changed actors."""
        if self._fitted:
            return
        self._fitted = True
        self._nodes.fit()
        if self._nodes.live.any():
            self._card.fit(len(self._leaves), self._nodes.bounds)

    # -- what is drawn how -----------------------------------------------------------------------

    def _cut(self, eyes):
        """Return the nodes to draw as images, and why other actors are not."""
        nodes, n = self._nodes, len(self._leaves)
        why = self._leaves.why.copy()
        before, behind = nodes.span(eyes)
        here = nodes.live & may_see_boxes(eyes.frame.view, nodes.low, nodes.high)
        here &= behind > eyes.frame.view.near
        why[nodes.live[:n] & ~here[:n]] = 'out of view'
        away = eyes.away(nodes.center)
        scale = eyes.pixels(nodes.center, nodes.radius) / away
        pixels = 2 * nodes.radius * scale
        ahead = (away > NEAREST * nodes.radius) | eyes.parallel
        # Where the near plane cuts a mesh, it shows what no image has.
        ahead &= before >= eyes.frame.view.near
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
        """Return the seconds per frame of each node's image."""
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
        """Renew invalid images; return images and nodes to show, (k, 2)."""
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
        """Render images of nodes within the budget; return their indices, -1 for the others."""
        images, found = self._images, np.full(len(nodes), -1)
        card = self._nodes.cards(nodes, eyes, self._costs.step, self._allowed)
        sizes = images.sizes(card, eyes, self._allowed)
        if self._want and images.pool is not None and images.pool.may_grow:
            images.close_pool()
        area = int((4.0 ** np.ceil(np.log2(sizes.max(1).clip(8, LARGEST)))).sum())
        pool = images.open(frame, max(area, self._want), self.memory)
        self._want = 0
        left = self._budget()
        drawn = 0
        with pool.target.drawing():
            for k, node in enumerate(nodes.tolist()):
                below = self._nodes.below(node)
                if drawn and self._costs.expected(self._leaves, below) > left:
                    break
                index = images.room(node, sizes[k].max(), frame.index)
                if index is None:
                    self._want = max(2 * area, 2 * pool.side**2)
                    continue
                with self._costs.timed(frame.window, self._leaves, below) as spent:
                    sources = [self._leaves.sources[i] for i in below]
                    images.draw(index, card, k, sizes[k], sources, parallel=eyes.parallel)
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
        self._card.attach(depth=self.depth, materials=self._materials)
        if len(shown):
            rows = self._images.rows(frame, shown[:, 0])
            self._card.show(frame, rows, self._images.pool)
            area = float(self._area[shown[:, 1]].sum())
            self._costs.measure(frame, self._card, self._images.drawer, area)
        else:
            self._card.hide()
        for thing in self._leaves.hide(why):
            if thing.enabled and thing.needed(frame) is True:
                thing.prepare(frame)  # it may have been before
        self._told['shown'] = len(shown)
        self._why = why

    # -- memory ----------------------------------------------------------------------------------

    def release(self):
        """Free GPU memory; the context is current."""
        window = None if self.pipeline is None else self.pipeline.window
        self._card.release(window)
        self._forget_tree()
        self._leaves.release(window)
        self._frame = None

    def report(self) -> dict:
        """Return what is drawn how, the largest error, and how often images were rendered."""
        images = self.images
        held = 0 if images is None else images.nbytes + self._card.nbytes
        return {
            'bytes': held,
            'images': 0 if images is None else int(images.alive.sum()),
            'rendered': self.rendered,
            'frames_with_rendering': self._drawn_frames / max(self._frames, 1),
            **self._told,
            'meshes': dict(Counter(w for w in self._why if w and w != 'hidden')),
            'meshes_ms': self._costs.by_reason(self._leaves, self._why),
        }
