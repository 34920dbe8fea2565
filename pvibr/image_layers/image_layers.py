"""Image layers: parts of the scene cached as images that are warped to each frame."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.gl.drawer import Drawer
from pvibr.image_layers.card import LayerCard
from pvibr.image_layers.layer import Layer, Now, numbers_by_depth
from pvibr.image_layers.members import Lighting, Member
from pvibr.image_layers.picture import Settings
from pvibr.projection.live_texture import LiveTexture
from pvibr.scene.actor_watch import ActorWatch
from pvibr.scene.casters import Surfaces, listed
from pvibr.scene.substitute import Substitute, addresses
from pvibr.scene.thing import Thing, joined_bounds

# The eye may go this share of the way to the nearest middle until a split by depth is made anew.
_NEAR = 0.25
_FRONT = 100  # row in the draw order, after those of all other cards


class ImageLayers(Substitute):
    """Parts of the scene cached as images, which are warped to each frame.

    An image shows the lit actors of a layer with overscan. In every frame it is warped by the
    best fit of its characteristic points, the nearest and farthest of each block, and it is
    depth-tested. It is rendered again once a point is displaced by more than `max_error`,
    something becomes visible that it lacks, its resolution is too low, its actors changed, or
    their shading did by more than `max_shade`. The actors themselves can still be picked, moved,
    hidden and removed.

    Parameters
    ----------
    groups : sequence of vtkActor or sequences of them, optional
        Actors of each layer, all in the subplot that this is added to; by default all actors of
        the subplot, later ones included, are split by depth.
    name : str, optional
        Name in reports.
    **settings
        Settings of the class.

    Raises
    ------
    TypeError
        If `groups` has something that is not an actor.
    ValueError
        If a layer is empty, an actor is given twice, or a setting is out of range.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> hills = pl.add_mesh(pv.Plane(i_size=9, j_size=9))
    >>> ball = pl.add_mesh(pv.Sphere(theta_resolution=300, phi_resolution=300))
    >>> layers = pl.ibr.add_image_layers([hills, ball])
    >>> pl.show(auto_close=False)
    >>> layers.report()['taken']
    2
    >>> pl.close()
    """

    max_shade = Param(
        0.02,
        'Maximum error of the brightness, as a share of white.',
        range='(0, 1]',
    )
    warp = Param(
        'projective',
        'Warp by an affine map alone, or after the homography of the best-fit plane, which is '
        'exact for a camera that only turns.',
        choices=('affine', 'projective'),
    )
    overscan = Param(
        0.15,
        'Margin rendered beyond each side of the screen, as a share of its size.',
        range='[0, 1]',
    )
    resolution = Param(
        (),
        'Texels per pixel along a side, of all layers or each; 1 by default, 2 if anti-aliased.',
        range='[0.05, 4]',
    )
    blur = Param(
        (),
        'Standard deviation of a Gaussian blur, of all layers or each; none by default.',
        range='[0, 100]',
        unit='px',
    )
    count = Param(4, 'Maximum number of layers if split by depth.', range='[1, 16]')
    memory = Param(
        2**29,
        'Maximum GPU memory of the images, which limits their resolution.',
        range='[65536, inf)',
        unit='bytes',
    )
    _argument = 'groups'
    _surfaces: Surfaces

    def __init__(self, groups=None, *, name=None, **settings):
        self._groups = None if groups is None else _checked_groups(groups)
        super().__init__(**settings)
        self.name = name
        self._members: dict[str, Member] = {}
        self._layers: list[Layer] = []
        self._layer_cards = [LayerCard()]
        self._drawer: Drawer | None = None
        self._split: tuple = ()
        if self._groups is not None:
            self._layers = [Layer([Member(a) for a in group]) for group in self._groups]
            self._members = {m.key: m for layer in self._layers for m in layer.members}
        self._watch = ActorWatch(self.actors())
        self._share_material()

    def __setattr__(self, name, value):
        super().__setattr__(name, _several(name, value))

    def _checked(self, settings):
        return super()._checked({k: _several(k, v) for k, v in settings.items()})

    def __len__(self):
        return len(self._layers)

    # -- what it is to others ---------------------------------------------------------------------

    def _contents(self) -> str:
        return f'{len(self)} layers of {len(self._members)} actors'

    def actors(self) -> list:
        """Return the actors that are in layers."""
        return [m.actor for m in self._members.values()]

    def _stood_for(self) -> list:
        return self.actors()

    @property
    def props(self) -> tuple:
        """Its own actor and the quads that show its layers."""
        return (self, *self._card_actors())

    def _cards(self) -> list:
        return self._layer_cards

    def solids(self) -> list:
        """Return the actors whose meshes cast its shadow volumes."""
        return [m.actor for m in self._members.values() if m.why != 'hidden']

    @property
    def bounds(self):
        """World bounds of all actors that are visible."""
        if self._frame is None:
            self._update()
        return super().bounds

    # -- the life of an effect --------------------------------------------------------------------

    def _claimed(self) -> list:
        return self.actors() if self._groups is not None else []

    def _conflicts(self, other, _props) -> bool:
        if isinstance(other, ImageLayers) and self._groups is other.groups is None:
            return True
        return bool(addresses([*other.actors(), *other.props]) & self._members.keys())

    @property
    def groups(self) -> list | None:
        """Actors of each layer as given, None if split by depth."""
        return self._groups

    def _put_in(self, renderer):
        self._surfaces = Surfaces(renderer)
        super()._put_in(renderer)

    def _give_back(self):
        for card in self._cards():
            card.hide()
        self._watch.show()

    def needed(self, frame) -> bool | str:
        """Return True if images may replace actors in a frame, else why not."""
        if frame.scale != 1:
            return 'a screenshot larger than the window is drawn from the actors'
        return super().needed(frame)

    # -- what is in which layer -------------------------------------------------------------------

    def _update(self):
        """Update all members; forget actors that left the subplot."""
        self._gather()
        members = list(self._members.values())
        changed = [members[i].update() for i in self._watch.changed()]
        self._watch.settle()
        self._version += any(changed)

    def _gather(self):
        if self.pipeline is None:
            return
        # What another thing stands for is its own from then on.
        free, _ = self._surfaces.chosen(None, [t for t in self.pipeline.things if t is not self])
        own = addresses(self.props)
        present = {k: a for k, a in free.items() if k not in own}
        new = present.keys() - self._members.keys() if self._groups is None else set()
        gone = self._members.keys() - present.keys()
        if not new and not gone:
            return
        for key in new:
            self._members[key] = Member(present[key])
        for key in gone:
            del self._members[key]
        for layer in self._layers if gone else ():
            layer.keep(self._members)
        self._version += bool(gone)
        self._watch = ActorWatch(self.actors(), self._watch)

    def _by_depth(self, frame):
        """Split all actors by depth, again if the camera moved far."""
        fit = {m.key: m for m in self._members.values() if not m.why}
        if self._split:
            keys, count, eye, room = self._split
            went = np.linalg.norm(frame.eye - eye)
            if keys == fit.keys() and count == self.count and went <= room:
                return
        numbers, away = numbers_by_depth(frame, [m.bounds for m in fit.values()], self.count)
        # What reaches over all has its middle anywhere.
        room = min((a for a, n in zip(away, numbers, strict=True) if n < self.count), default=0.0)
        self._split = set(fit), self.count, frame.eye, _NEAR * room
        groups: dict[int, list] = {}
        for number, member in zip(numbers, fit.values(), strict=True):
            groups.setdefault(number, []).append(member)
        old = {frozenset(m.key for m in layer.members): layer for layer in self._layers}
        made = []
        for number in sorted(groups):
            key = frozenset(m.key for m in groups[number])
            made.append(old.pop(key) if key in old else Layer(groups[number]))
        for layer in old.values():
            layer.picture.release()
        self._layers = made

    # -- one frame --------------------------------------------------------------------------------

    def _prepare(self, frame):
        if self._groups is None:
            self._by_depth(frame)
        limits = self.max_error, self.max_shade, self.warp, self.only_if_faster
        light = Lighting(frame.renderer)
        now = Now(frame, frame.view, light, *self._scene(), *limits)
        for k, layer in enumerate(self._layers):
            layer.judge(now, self._settings(frame, k))
        self._take(now)
        self._show(frame)

    def _settings(self, frame, k) -> Settings:
        values = self.resolution, self.blur
        smooth = 2.0 if _smooths(frame) else 1.0
        resolution, blur = (
            v[min(k, len(v) - 1)] if v else d for v, d in zip(values, (smooth, 0.0), strict=True)
        )
        wide = any(e.enabled and e.needs_hdr for e in self.pipeline.effects)
        share = self.memory / len(self._layers)
        return Settings(resolution, blur, self.overscan, 'rgba16f' if wide else 'rgba8', share)

    def _scene(self) -> tuple[list, tuple]:
        """Return the effects that surfaces depend on, and a key of their state."""
        lives = [e for e in self.pipeline.effects if isinstance(e, LiveTexture)]
        effects = [
            e
            for e in self.pipeline.effects
            if e.enabled and not e.is_image_effect and e not in (*self.pipeline.things, *lives)
        ]
        if not effects:
            return [], ()
        key = tuple((id(e), e.content_key(), _draws(e.lives)) for e in effects)
        things = [t for t in self.pipeline.things if t.enabled]
        others = self.pipeline.surfaces.casters(None, things)
        others.things.remove(self)
        return effects, (key, others.key(), self._version)

    def _take(self, now):
        """Renew invalid images within the budget, the worst first."""
        wrong = [k for k in self._layers if k.wrong]
        wrong.sort(key=lambda k: -k.residual)
        left, taken = self._budget(), 0
        for layer in wrong:
            if taken and layer.seconds > left:
                layer.late()
                continue
            left, taken = left - self._take_one(now, layer), taken + 1
        if not taken or self._drawer is None:
            return
        self._drawer.done()
        now.frame.renderer.UpdateLightsGeometryToFollowCamera()

    def _take_one(self, now, layer) -> float:
        """Renew an image; return the seconds that it took."""
        self._drawer = self._drawer or Drawer(now.frame.renderer)
        seconds = layer.take(now, self._drawer)
        for member in layer.members:
            member.settle()
        self._watch.settle()
        return seconds

    def _show(self, frame):
        """Draw the images, from far to near, in place of their actors."""
        shown = [(k, k.fit) for k in self._layers if k.fit is not None and k.fit.seen]
        shown.sort(key=lambda pair: -pair[0].away(pair[1]))
        cards, deep = self._layer_cards, self._depth_is_read(frame)
        while len(cards) < len(shown):
            cards.append(LayerCard())
            for actor in cards[-1].actors:
                put_inner(frame.renderer, actor)
        for card, (layer, fit) in zip(cards, shown, strict=False):
            card.show(frame, layer.picture, fit, joined_bounds(layer.bounds.tolist()), deep=deep)
        # Soft edges come before those of others; after them only those of blurred layers that
        # are nearer than all sharp ones.
        sharp = [k for k, (layer, _) in enumerate(shown) if not layer.picture.blurred]
        front = sharp[-1] + 1 if sharp else 0
        rows = [k - front if k < front else _FRONT + k for k in range(len(cards))]
        self.order = tuple(
            pair for card, row in zip(cards, rows, strict=True) for pair in card.order(row)
        )
        hidden = {m.key for k in self._layers if k.fit is not None for m in k.members if not m.why}
        self._watch.hide([i for i, key in enumerate(self._members) if key in hidden])

    # -- memory -----------------------------------------------------------------------------------

    def release(self):
        """Free GPU memory; the context is current."""
        self.deactivate()
        window = None if self.pipeline is None else self.pipeline.window
        for card in self._cards():
            card.release(window)
        for layer in self._layers:
            layer.picture.release()
        if self._drawer is not None:
            self._drawer.release()
        self._drawer = None

    def report(self) -> dict:
        """Return how often, how wrong, and why each layer's image was renewed."""
        told = {f'layer {k}': layer.report() for k, layer in enumerate(self._layers)}
        return {
            'bytes': sum(layer.picture.nbytes for layer in self._layers),
            'taken': sum(layer.taken for layer in self._layers),
            'residual_px': max((layer.residual_shown for layer in self._layers), default=0.0),
            **told,
        }


def _draws(lives) -> tuple:
    """Return how often live textures were drawn."""
    return tuple((id(live), live.draws) for live in lives)


def _several(name, value):
    """Return one number as a tuple for settings of single layers."""
    own = name in ('resolution', 'blur') and isinstance(value, (int, float))
    return (value,) if own and not isinstance(value, bool) else value


def _checked_groups(groups) -> list:
    found = [listed(group) for group in listed(groups)]
    for actor in (a for group in found for a in group):
        if not isinstance(actor, _vtk.vtkActor) or isinstance(actor, Thing):
            what = type(actor).__name__
            raise TypeError(
                f'groups holds a {what}: each must be an actor, as add_mesh returns it'
            )
    keys = [address(a) for group in found for a in group]
    if not all(found) or not found or len(set(keys)) < len(keys):
        raise ValueError(
            f'groups = {groups!r}: each must hold an actor or more, and each actor be in one'
        )
    return found


def _smooths(frame) -> bool:
    """Return True if a window is anti-aliased."""
    chosen = frame.renderer.GetPass()
    return frame.window.GetMultiSamples() > 1 or (chosen is not None and chosen.IsA('vtkSSAAPass'))
