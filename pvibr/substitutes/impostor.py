"""Dynamic impostors: actors cached as images until an error bound is exceeded."""

from __future__ import annotations

from collections import Counter

import numpy as np

from pvibr.core.params import Param
from pvibr.gl.drawer import Drawer
from pvibr.instances.instances import Instances
from pvibr.substitutes.impostor_cards import ImpostorCards
from pvibr.substitutes.impostor_costs import Costs
from pvibr.substitutes.impostor_images import Eyes, Images
from pvibr.substitutes.impostor_limits import FINEST, limits_of
from pvibr.substitutes.impostor_sources import (
    Materials,
    Source,
    check_members,
    checked_members,
    is_actor,
)
from pvibr.substitutes.impostor_tree import Nodes
from pvibr.substitutes.instance_sets import InstanceSet
from pvibr.substitutes.leaves import CUT_BY_MOVING, Leaves
from pvibr.substitutes.substitute import Substitute, addresses
from pvibr.things.casters import listed

# Cost factor of last frame's choice, so that it does not flicker.
_HYSTERESIS = 0.8
# Least number of places added at once.
_SPARE_PLACES = 64


class Impostor(Substitute):
    """Actors cached as images, which are rendered again once an error bound is exceeded.

    Each image, with depth, lies on a card through its actor's centre, perpendicular to the line
    of sight. It is valid while no point of the actor's bounding box is displaced by more than
    `max_error`, and is lit in every frame. The actors themselves can still be picked, moved,
    hidden and removed.

    Parameters
    ----------
    actors : vtkActor, pvibr.Instances, or sequence of these
        Actors in the same subplot; instances require `hierarchical`.
    name : str, optional
        Name in reports.
    **settings
        Settings.

    Raises
    ------
    TypeError
        If an item of `actors` is neither an actor nor instances.
    ValueError
        If `actors` is empty, contains duplicates, or contains instances without `hierarchical`,
        or if a setting is out of range.

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
    depth = Param(
        True,
        'Depth-test images per pixel so that they intersect as their meshes do; off is faster.',
    )
    hierarchical = Param(
        False, 'Let neighbouring actors share images: for many small ones; required for instances.'
    )
    memory = Param(2**28, 'Maximum GPU memory for images.', range='[65536, inf)', unit='bytes')
    views = Param(
        2, 'Maximum number of images per actor; more serve several cameras.', range='[1, 16]'
    )

    things: list
    _leaves: Leaves
    _nodes: Nodes  # both while `_is_built`
    _images: Images
    _is_built = _is_fitted = False

    def __init__(self, actors, *, name=None, **settings):
        things = checked_members(actors)
        super().__init__(**settings)
        if not self.hierarchical and any(isinstance(thing, Instances) for thing in things):
            raise ValueError(
                'actors must not contain Instances unless hierarchical=True, got Instances: '
                'set hierarchical=True to group them into images, or remove them'
            )
        self.name = name
        self._materials = Materials()
        self._set_things(things)
        self._image_cards = ImpostorCards()
        self._share_material()
        self._costs = Costs()
        self._still_key: tuple | None = None  # of the last frame, if it left nothing to do
        self._shown_views = np.zeros(0, int)
        self._has_unfinished = False
        self._last_cut, self._error_sizes = np.zeros(0, int), np.zeros(0)
        self._props_time = -1
        self._frame_report: dict = {}
        self._mesh_reasons = self._leaves.mesh_reasons
        self._drawn_frames = self._frames = self._missing_area = 0
        self.rendered = 0

    # -- seen from other things ------------------------------------------------------------------

    def is_gone(self, renderer) -> bool:
        """Return True if the impostor or its last actor was removed from the scene."""
        return super().is_gone(renderer) or not any(map(renderer.HasViewProp, self.things))

    def _contents(self) -> str:
        return f'{len(self.things)} actors'

    def _claimed(self) -> list:
        return self.things

    def actors(self) -> list:
        """Return the actor of the cards, and the replaced actors."""
        return [*self.shader_actors(), *self._stood_for()]

    def _stood_for(self) -> list:
        return [thing for thing in self.things if is_actor(thing)]

    def _cards(self) -> list:
        return self._image_cards.draws

    def solids(self) -> list:
        """Return the actors whose meshes cast shadow volumes."""
        return self._leaves.shown()

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors that may be visible in a frame other than its own."""
        if self._frame is None:
            self._update()
        return super().draws(frame, depth=depth)

    def content_key(self) -> tuple:
        """Return a value that changes with the drawn content, but not with the camera."""
        return *super().content_key(), self._leaves.sections.key()

    def _boxes(self) -> list:
        return [*super()._boxes(), *(owner.thing.bounds for owner in self._leaves.sets)]

    @property
    def images(self) -> Images | None:
        """The images and their tile pool; None before the first frame."""
        return self._images if self._is_built else None

    @property
    def nodes(self) -> Nodes | None:
        """The tree over actors and blocks; None before the first frame."""
        return self._nodes if self._is_built else None

    # -- adding and removing actors --------------------------------------------------------------

    def add(self, actors):
        """Replace more actors; the images of the others stay.

        Parameters
        ----------
        actors : vtkActor, pvibr.Instances, or sequence of these
            Actors in the same subplot; adding instances renews all images.

        Raises
        ------
        TypeError
            If an item of `actors` is neither an actor nor instances.
        ValueError
            If one is already replaced by an impostor, or is in another subplot.

        Examples
        --------
        >>> import pyvista as pv
        >>> pl = pv.Plotter(off_screen=True)
        >>> impostor = pl.ibr.add_impostor(pl.add_mesh(pv.Sphere()))
        >>> later = pl.add_mesh(pv.Sphere(center=(1, 0, 0)))
        >>> impostor.add(later)
        >>> len(impostor.things)
        2
        >>> pl.close()
        """
        new_things = checked_members(actors)
        check_members(new_things, self, are_new=True)
        if self.pipeline is not None:
            self._claim(self.pipeline, new_things)
        self.things = [*self.things, *new_things]
        if not all(map(is_actor, new_things)):
            self._restart(self.things)
            return
        missing_places = len(new_things) - self._leaves.sources.count(None)
        if missing_places > 0:
            self._grow(max(missing_places, _SPARE_PLACES, len(self._leaves) // 4))
        for actor in new_things:
            self._leaves.add(Source(actor, self._materials))

    def remove(self, actors=None):
        """Draw some actors as meshes again, or remove the impostor.

        Parameters
        ----------
        actors : vtkActor, pvibr.Instances, or sequence of these, optional
            Some of its actors; by default the impostor is removed from its plotter, as it is once
            its last actor is removed.

        Raises
        ------
        ValueError
            If the impostor does not replace one of them.
        """
        if actors is None:
            super().remove()
            return
        removed_things = listed(actors)
        check_members(removed_things, self, are_new=False)
        if self.pipeline is not None:
            self.pipeline.make_current()
            self.pipeline.renderer.GetViewProps().Modified()  # it may have lost its last actor
        self._forget(removed_things)

    def _grow(self, count):
        """Add empty places for leaves; existing leaves and inner nodes keep their images."""
        leaf_count = len(self._leaves)
        self._leaves.grow(count)
        if self._is_built:
            node_count = len(self._nodes)
            self._nodes.grow(count)
            extra_inner = len(self._nodes) - node_count - count
            insert_at = [leaf_count] * count + [node_count] * extra_inner
            self._images.grow(np.array(insert_at, int))
            self._costs.grow(count)
            self._last_cut = self._last_cut + count * (self._last_cut >= leaf_count)

    def _forget(self, gone_things):
        gone_ids = {id(thing) for thing in gone_things}
        self.things = [thing for thing in self.things if id(thing) not in gone_ids]
        if not all(map(is_actor, gone_things)):
            self._restart(self.things)
            return
        for actor in gone_things:
            leaf = self._leaves.remove(actor, self.pipeline and self.pipeline.window)
            if self._is_built:
                self._images.drop_objects(self._nodes.remove(leaf))
        self._version += 1
        self._is_fitted = False

    # -- frames ----------------------------------------------------------------------------------

    def _conflicts(self, other, props) -> bool:
        return isinstance(other, Impostor) and bool(addresses(props) & addresses(other.things))

    def deactivate(self):
        """Draw the actors themselves again."""
        super().deactivate()
        self._leaves.deactivate()

    def _give_back(self):
        self._image_cards.hide()
        self._leaves.watch.show()

    def _prepare(self, frame):
        if not len(self._leaves):
            return  # empty instances
        if not self._is_built or self._built_for != (self.hierarchical, self.views):
            self._build(frame)
        self._fit()
        self._frames += 1
        still_key = self._settings_key(frame)
        if still_key == self._still_key and self._costs.are_at_rest(self._nodes):
            self._images.shown_frame[self._shown_views] = frame.index
            self._image_cards.show_again()
            self._leaves.hide(self._mesh_reasons, self._error_sizes)
            return
        self._still_key = None
        eyes = Eyes(frame)
        self._limits = limits_of(self.max_error, eyes, self._nodes)
        self._costs.move(frame)
        nodes, reasons = self._cut(eyes)
        shown_images = self._render_invalid(frame, eyes, nodes, reasons)
        self._show(frame, shown_images, reasons)
        if not self._has_unfinished:
            self._still_key = still_key

    def _settings_key(self, frame) -> tuple:
        """Return a value that changes with all on which the choice of images depends."""
        settings = self.max_error, self.only_if_faster, self.depth, self.views, self.memory
        state = self._costs.key(frame), self._version, self._leaves.sections.version
        return frame.view.key(), frame.size, frame.quality, settings, state

    # -- updates ---------------------------------------------------------------------------------

    def _set_things(self, things):
        self.things = things
        actors = [thing for thing in things if is_actor(thing)]
        instance_sets = [InstanceSet(t, self._materials) for t in things if not is_actor(t)]
        self._leaves = Leaves([Source(actor, self._materials) for actor in actors], instance_sets)

    def _update(self):
        self._forget_removed()
        if any(owner.outgrown() for owner in self._leaves.sets):
            self._restart(self.things)
        changed_leaves = self._leaves.update()
        if not changed_leaves:
            return
        self._version += 1
        self._is_fitted = False
        if self._is_built:
            tree = self._nodes.tree
            for leaf in changed_leaves:
                if not tree.has(leaf):
                    self._images.drop_objects(self._nodes.insert(leaf))
            self._costs.changed(changed_leaves)
            self._images.drop_objects(tree.above(changed_leaves))

    def _forget_removed(self):
        props = self.pipeline.renderer.GetViewProps()
        if props.GetMTime() == self._props_time:
            return
        self._props_time = props.GetMTime()
        present_ids = set(map(id, props))
        gone_things = [thing for thing in self.things if id(thing) not in present_ids]
        if gone_things:
            self._forget(gone_things)

    def _restart(self, things):
        self._leaves.release(self.pipeline.window)
        self._set_things(things)
        self._version += 1
        self._forget_tree()

    def _forget_tree(self):
        if self._is_built:
            self._images.release()
        self._is_built, self._still_key = False, None
        self._last_cut = np.zeros(0, int)

    def _build(self, frame):
        self._forget_tree()
        self._nodes = Nodes(self._leaves, self.hierarchical)
        self._images = Images(len(self._nodes), self.views, Drawer(frame.renderer))
        self._costs.count(len(self._leaves))
        self._built_for = self.hierarchical, self.views
        self._is_built, self._is_fitted = True, False

    def _fit(self):
        changed_leaves = self._leaves.cut()
        if self._is_fitted and not changed_leaves:
            return
        self._is_fitted = True
        changed_nodes = self._nodes.tree.above(changed_leaves)
        self._images.follow_planes(changed_nodes, self._leaves.sections.cut)
        self._nodes.fit()
        self._costs.changed([])
        if self._nodes.live.any():
            self._image_cards.fit(len(self._leaves), self._nodes.bounds)

    # -- choosing and rendering images -----------------------------------------------------------

    def _cut(self, eyes):
        """Return the nodes to draw as images, and why other leaves are not."""
        nodes, leaves = self._nodes, slice(len(self._leaves))
        reasons = self._leaves.mesh_reasons.copy()
        in_view, usable = nodes.seen(eyes)
        reasons[nodes.live[leaves] & ~in_view[leaves]] = 'out of view'
        eye_distance = eyes.away(nodes.center)
        px_per_unit = eyes.pixels(nodes.center, nodes.radius) / eye_distance
        size_px = 2 * nodes.radius * px_per_unit
        self._error_sizes = (self._limits.displaced / px_per_unit)[leaves]
        texels = size_px * self._limits.rows_of_layers / self._limits.texel
        usable &= texels * 1.2 < self._images.largest
        mesh_cost = self._costs.meshes(self._leaves, nodes)
        box_depth, self._card_areas = nodes.faces(eyes)
        self._card_areas *= (px_per_unit * self._limits.rows_of_layers) ** 2
        pixels_off = 0.0 if eyes.parallel else box_depth * px_per_unit / eye_distance
        renewals, has_image = pixels_off / self._limits.displaced, self._images.has_current
        image_cost = self._costs.images(nodes, mesh_cost, renewals, has_image, self._card_areas)
        image_cost[self._last_cut] *= _HYSTERESIS
        cost = np.where(usable, image_cost, np.inf)
        # The alternative is the mesh, and the only choice for leaves near the eye.
        plain_cost = self._costs.plain(self._leaves, mesh_cost, size_px, self._card_areas)
        too_near = ~usable[leaves]
        too_costly = (cost[leaves] > plain_cost) & self.only_if_faster & ~too_near
        as_mesh = np.zeros(len(nodes), bool)
        as_mesh[leaves] = too_near | too_costly
        cost[leaves] = np.where(as_mesh[leaves], plain_cost, cost[leaves])
        self._last_cut = cut = nodes.tree.cheapest(cost, in_view)
        cut_leaves = cut[cut < leaves.stop]
        without_image = cut_leaves[too_near[cut_leaves]]
        reasons[without_image] = np.where(nodes.moving[without_image], CUT_BY_MOVING, 'near')
        reasons[cut_leaves[too_costly[cut_leaves]]] = 'cheaper as a mesh'
        as_image = cut[~as_mesh[cut]]
        card_areas, limits = self._card_areas[as_image], self._limits.rows(as_image)
        self._images.fit(eyes.frame.window, self.memory, card_areas, limits)
        return as_image, reasons

    def _render_invalid(self, frame, eyes, nodes, reasons):
        """Renew invalid images; return the images and nodes to show, shape (k, 2)."""
        images, limits = self._images, self._limits.rows(nodes)
        view, displacement, texel_size = images.errors(nodes, eyes, limits)
        error = np.maximum(displacement, texel_size)
        excess = limits.excess(displacement, texel_size)
        is_invalid = ~(excess <= 1) | (texel_size * FINEST < np.minimum(limits.texel, 1.0))
        images.shown_frame[view[~is_invalid]] = frame.index
        queue = np.flatnonzero(is_invalid)
        queue = queue[np.argsort(-excess[queue], kind='stable')]
        if len(queue):
            new_view = self._render_images(frame, eyes, nodes[queue])
            rendered, new_view = queue[new_view >= 0], new_view[new_view >= 0]
            view[rendered] = new_view
            new_errors = images.errors(nodes[rendered], eyes, limits.rows(rendered))[1:]
            error[rendered] = np.maximum(*new_errors)
        # Rendering may have evicted other images.
        is_shown = (view >= 0) & images.alive[view]
        for node in nodes[~is_shown]:
            reasons[self._nodes.below(node)] = 'no room' if self._missing_area else 'no time'
        self._shown_views, self._has_unfinished = view[is_shown], bool(len(queue))
        images.shown_frame[self._shown_views] = frame.index
        self._frame_report['error_px'] = float(error[is_shown].max(initial=0.0))
        return np.stack([view[is_shown], nodes[is_shown]], 1)

    def _render_images(self, frame, eyes, nodes):
        """Render images of nodes within the budget; return their indices, -1 if not rendered."""
        images, new_views = self._images, np.full(len(nodes), -1)
        limits = self._limits.rows(nodes)
        card = self._nodes.cards(nodes, eyes, self._costs.step, limits.displaced)
        plan = images.plan(card, eyes, limits)
        total_area = max(plan.tile_area, self._missing_area)
        grow = self._missing_area > 0
        pool = images.open(frame.window, total_area, grow=grow, tinted=self._leaves.tinted)
        self._missing_area = 0
        seconds_left = self._budget()
        rendered_count = 0
        with pool.target.drawing():
            for k, node in enumerate(nodes.tolist()):
                leaf_ids = self._nodes.below(node)
                if rendered_count and self._costs.expected(self._leaves, leaf_ids) > seconds_left:
                    break
                index = images.reserve(node, plan.sides[k], frame.index)
                if index is None:
                    self._missing_area = 2 * max(total_area, pool.side**2)
                    continue
                with self._costs.timed(frame.window, self._leaves, leaf_ids) as spent:
                    sources = self._leaves.clipped_sources(leaf_ids)
                    images.draw(index, card, k, plan, sources, eyes)
                images.shown_frame[index] = images.rendered_frame[index] = frame.index
                new_views[k] = index
                seconds_left -= spent.seconds
                rendered_count += 1
        images.drawer.done()
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        self.rendered += rendered_count
        self._drawn_frames += rendered_count > 0
        return new_views

    def _show(self, frame, shown_images, reasons):
        pool = self._images.pool
        self._image_cards.attach(pool, depth=self.depth, materials=self._materials)
        if len(shown_images):
            rows = self._images.card_rows(frame, shown_images[:, 0])
            self._image_cards.show(frame, rows, pool)
            card_area = float(self._card_areas[shown_images[:, 1]].sum())
            self._costs.measure(frame, self._image_cards, self._images.drawer, card_area)
        else:
            self._image_cards.empty()
        for thing in self._leaves.hide(reasons, self._error_sizes):
            if thing.enabled and thing.needed(frame) is True:
                thing.prepare(frame)  # again, if its turn came before
        self._frame_report['shown'], self._mesh_reasons = len(shown_images), reasons

    # -- memory ----------------------------------------------------------------------------------

    def release(self):
        """Free GPU memory; the context is current."""
        window = None if self.pipeline is None else self.pipeline.window
        self._image_cards.release(window)
        self._forget_tree()
        self._leaves.release(window)
        self._frame = None

    def report(self) -> dict:
        """Return counts of images, meshes by reason, the largest error and GPU memory."""
        images = self.images
        return {
            'bytes': 0 if images is None else images.nbytes + self._image_cards.nbytes,
            'images': 0 if images is None else int(images.alive.sum()),
            'rendered': self.rendered,
            'frames_with_rendering': self._drawn_frames / max(self._frames, 1),
            **self._frame_report,
            'meshes': dict(Counter(w for w in self._mesh_reasons if w and w != 'hidden')),
            'meshes_ms': self._costs.by_reason(self._leaves, self._mesh_reasons),
        }
