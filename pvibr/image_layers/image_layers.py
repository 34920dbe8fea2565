"""Coherent layers: parts of the scene as pictures, warped until they must be taken again."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.determinism import is_deterministic
from pvibr.core.params import Param
from pvibr.gl.drawer import Drawer
from pvibr.gl.scene_pass import is_marker
from pvibr.image_layers.card import LayerCard
from pvibr.image_layers.layer import Layer, Now, around, numbers_by_depth
from pvibr.image_layers.members import Lighting, Member
from pvibr.image_layers.picture import Settings
from pvibr.maths.views import may_see
from pvibr.projection.live_texture import LiveTexture
from pvibr.scene.casters import Casters, Surfaces, listed
from pvibr.scene.thing import Thing

# The eye may go this share of the way to the nearest middle until a split by depth is made anew.
_NEAR = 0.25


class ImageLayers(Thing):
    """Parts of the scene that are drawn as pictures, taken again only when they must be.

    A picture shows the actors of a layer, lit, beyond the edges of the screen as well. In every
    frame it is warped by the best fit of its characteristic points, the nearest and farthest of
    each block of what it shows, and it has their depth: layers, other props, instances and
    impostors hide each other as surfaces do. It serves until a point is shown further than
    `max_error` from where it is, something is seen that it does not show, its texels are too
    large, its actors changed, or light on them did by more than `max_shade`. The actors stay what
    they are to all others: they can be picked, moved, hidden and removed.

    Parameters
    ----------
    groups : sequence of vtkActor or sequences of them, optional
        The layers, each one actor or several, all in the subplot that this is added to; by default
        all actors of the subplot, those that come later too, by their depth.
    name : str, optional
        What reports call it.
    **settings
        See the class's Params.

    Raises
    ------
    TypeError
        Where an actor is none.
    ValueError
        Where a layer is empty, an actor is given twice, or a setting is out of range.

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

    web = 'shown', 'its actors, as meshes'
    max_error = Param(
        1.0, 'How far from where it is anything may be shown.', range='(0, inf)', unit='px'
    )
    max_shade = Param(
        0.02,
        'How much lighter or darker than it is anything may be shown, of white.',
        range='(0, 1]',
    )
    warp = Param(
        'projective',
        'What a warp may be: affine alone, or after that of the plane which fits '
        'best, and which is exact where the eye stays.',
        choices=('affine', 'projective'),
    )
    overscan = Param(
        0.15,
        'What pictures show beyond each side of the screen, of its width and height.',
        range='[0, 1]',
    )
    resolution = Param(
        (),
        'Texels of a pixel along a side, of each layer or of all; by default 1, and 2 where '
        'the window smooths edges.',
        range='[0.05, 4]',
    )
    blur = Param(
        (),
        'Standard deviation of a low-pass filter, of each layer or of all; by default none.',
        range='[0, 100]',
        unit='px',
    )
    count = Param(4, 'Layers at most where they are made by depth.', range='[1, 16]')
    budget_ms = Param(
        None,
        'What may be taken again in a frame, the worst first; None for all that is wrong.',
        range='[0, inf)',
        unit='ms',
        kind=float,
    )
    memory = Param(
        2**29,
        'What pictures may take; their resolution is less where it is short.',
        range='[65536, inf)',
        unit='bytes',
    )
    only_if_faster = Param(
        True, 'Replace only actors that are slower to draw themselves, as measured here.'
    )

    def __init__(self, groups=None, *, name=None, **settings):
        self.name = name
        self._groups = None if groups is None else _checked_groups(groups)
        super().__init__(**settings)
        self._members: dict[str, Member] = {}
        self._layers: list[Layer] = []
        # After all opaque props, but before those with soft edges of their own; in front of these
        # are only blurred layers that are nearer than all sharp ones.
        self._cards: dict[bool, list[LayerCard]] = {False: [LayerCard()], True: []}
        self._surfaces: Any = None
        self._drawer: Any = None
        self._split: tuple = ()
        self._version = 0
        self._frame: Any = None
        if self._groups is not None:
            self._layers = [Layer([Member(a) for a in group]) for group in self._groups]
            self._members = {m.key: m for layer in self._layers for m in layer.members}

    def __setattr__(self, name, value):
        super().__setattr__(name, _several(name, value))

    def _checked(self, settings):
        return super()._checked({k: _several(k, v) for k, v in settings.items()})

    def __len__(self):
        return len(self._layers)

    # -- what it is to others ---------------------------------------------------------------------

    @property
    def props(self) -> tuple:
        """The quads that show its layers; without them it goes."""
        return tuple(card.actor for card in self._all_cards())

    def _all_cards(self):
        return [*self._cards[False], *self._cards[True]]

    def actors(self) -> list:
        """Return the actors that are in layers."""
        return [m.actor for m in self._members.values()]

    def drawn(self) -> list:
        """Return what draws it in the frame that it was prepared for."""
        return [
            *(a for a in self.props if a.GetVisibility()),
            *(m.actor for m in self._members.values() if m.actor.GetVisibility()),
        ]

    def solids(self) -> list:
        """Return the actors whose meshes throw its shadows."""
        return [m.actor for m in self._members.values() if m.why != 'hidden']

    def content_key(self) -> tuple:
        """Return what changes whenever what is drawn does, the camera left out."""
        if self._frame is None:
            self._update_members()
        return self._version, self._revision

    @property
    def bounds(self) -> tuple[float, ...]:
        """World bounds of all actors that are visible."""
        if self._frame is None:
            self._update_members()
        return around([m.bounds for m in self._members.values() if m.why != 'hidden'])

    # -- the life of an effect --------------------------------------------------------------------

    def attach(self, pipeline):
        """Put the quads into the scene."""
        renderer = pipeline.renderer
        for actor in self.actors() if self._groups is not None else ():
            if not renderer.HasViewProp(actor):
                msg = f'groups: {actor!r} is not in this subplot; add it there first'
                raise ValueError(msg)
        for other in pipeline.things:
            taken = {address(a) for a in (*other.actors(), *other.props)}
            both_all = isinstance(other, ImageLayers) and self._groups is other._groups is None
            if both_all or taken & self._members.keys():
                msg = f'groups: {other.name} stands for some of these; remove it first'
                raise ValueError(msg)
        super().attach(pipeline)

    def _put_in(self, renderer):
        self._surfaces = Surfaces(renderer)
        for actor in self.props:
            renderer.AddViewProp(actor)

    def _take_out(self, renderer):
        self.deactivate()
        for actor in self.props:
            renderer.RemoveViewProp(actor)

    def deactivate(self):
        """Show the actors themselves."""
        for card in self._all_cards():
            card.hide()
        for member in self._members.values():
            member.show()
        self._frame = None

    def needed(self, frame) -> bool | str:
        """Tell whether a frame is one that pictures may serve."""
        return frame.scale == 1 or 'a screenshot larger than the window is drawn from the actors'

    def prepare(self, frame):
        """Warp what serves, take again what does not, and hide what is in either."""
        if frame is self._frame:
            return
        self.deactivate()
        self._update_members()
        try:
            self._prepare(frame)
        except Exception:
            self.deactivate()
            raise
        self._frame = frame

    def finish(self, frame):
        """Give everyone their actors back."""
        if frame is self._frame:
            self.deactivate()

    # -- what is in which layer -------------------------------------------------------------------

    def _update_members(self):
        """Look at all actors; those that were taken out of the subplot go."""
        self._gather()
        effects = self.pipeline.effects if self.pipeline is not None else ()
        draws = {address(e.texture): e.draws for e in effects if isinstance(e, LiveTexture)}
        changed = [m.update(draws) for m in self._members.values()]
        self._version += any(changed)

    def _gather(self):
        if self.pipeline is None:
            return
        # What another thing stands for is its own from then on.
        self._surfaces.update([t for t in self.pipeline.things if t is not self])
        free, _ = self._surfaces.chosen(None)
        own = {address(a) for a in self.props}
        present = {k: a for k, a in free.items() if k not in own}
        if self._groups is None:
            for key in present.keys() - self._members.keys():
                self._members[key] = Member(present[key])
        gone = self._members.keys() - present.keys()
        for key in gone:
            del self._members[key]
            self._version += 1
        for layer in self._layers if gone else ():
            layer.keep(self._members)

    def _by_depth(self, frame):
        """Split all actors by their depth, anew where the eye went far."""
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
        for card in self._all_cards():
            if card.failure:
                raise RuntimeError(card.failure)
        if self._groups is None:
            self._by_depth(frame)
        now = Now(frame, frame.view, Lighting(frame.renderer), *self._scene(), self)
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
        """Return the effects that the look of surfaces depends on, and when they changed."""
        lives = [e for e in self.pipeline.effects if isinstance(e, LiveTexture)]
        effects = [
            e
            for e in self.pipeline.effects
            if e.enabled and not e.is_image_effect and e not in (*self.pipeline.things, *lives)
        ]
        if not effects:
            return [], ()
        key = tuple((id(e), e._revision, _draws(e.lives)) for e in effects)
        others = [t for t in self.pipeline.things if t is not self and t.enabled]
        self._surfaces.update([t for t in self.pipeline.things if t is not self])
        actors, _ = self._surfaces.chosen(None)
        free = [
            a
            for k, a in actors.items()
            if a.GetVisibility() and k not in self._members and a not in self.props
        ]
        return effects, (key, Casters(free, others).key(), self._version)

    def _take(self, now):
        """Take the pictures that do not serve, the worst first, within the budget."""
        wrong = [k for k in self._layers if k.wrong]
        wrong.sort(key=lambda k: -k.residual)
        endless = self.budget_ms is None or is_deterministic()
        left = np.inf if endless else self.budget_ms / 1e3
        taken = 0
        for layer in wrong:
            if taken and layer.seconds > left:
                layer.late()
                continue
            self._drawer = self._drawer or Drawer(now.frame.renderer)
            left, taken = left - layer.take(now, self._drawer), taken + 1
        if not taken:
            return
        self._drawer.done()
        now.frame.renderer.UpdateLightsGeometryToFollowCamera()

    def _show(self, frame):
        """Draw the pictures, from far to near, in place of their actors."""
        shown = [layer for layer in self._layers if layer.fit is not None and layer.fit.seen]
        shown.sort(key=lambda layer: -layer.away())
        sharp = [k for k, layer in enumerate(shown) if not layer.picture.blurred]
        cut = sharp[-1] + 1 if sharp else 0
        before: list = []
        for last, mine in ((True, shown[cut:]), (False, shown[:cut])):
            cards = self._cards[last]
            for _ in range(len(mine) - len(cards)):
                cards.append(LayerCard())
                frame.renderer.AddViewProp(cards[-1].actor)
            for card, layer in zip(cards, mine, strict=False):
                fit = layer.fit
                card.show(frame, layer.picture, fit.warp, fit.turn, around(layer.bounds))
            _put(frame.renderer, [card.actor for card in cards], before)
            before = [card.actor for card in cards] + self._soft_edged()
        for layer in self._layers:
            for member in layer.members if layer.fit is not None else ():
                if not member.why:
                    member.hide()

    def _soft_edged(self):
        """Return actors that blend with what was drawn before them."""
        return [actor for thing in self.pipeline.things for actor in thing.soft_edged()]

    def draws(self, frame, *, depth=False) -> list:
        """Return the actors themselves that may be seen in a frame that is not its own."""
        found = [m for m in self._members.values() if m.why not in ('hidden', 'empty')]
        if not found:
            return []
        seen = may_see(frame.view, [m.bounds for m in found])
        return [m.actor for m, s in zip(found, seen, strict=True) if s]

    # -- memory -----------------------------------------------------------------------------------

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.deactivate()
        window = None if self.pipeline is None else self.pipeline.window
        for card in self._all_cards():
            card.release(window)
        for layer in self._layers:
            layer.picture.release()
        if self._drawer is not None:
            self._drawer.release()
        self._drawer = None

    def report(self) -> dict:
        """Return, of each layer, how often it is taken, its residual, and why it was taken."""
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
    """Return one number as the numbers of all layers, where each layer has its own."""
    own = name in ('resolution', 'blur') and isinstance(value, (int, float))
    return (value,) if own and not isinstance(value, bool) else value


def _checked_groups(groups) -> list:
    found = [listed(group) for group in listed(groups)]
    for actor in (a for group in found for a in group):
        if not isinstance(actor, _vtk.vtkActor):
            what = type(actor).__name__
            msg = f'groups holds a {what}: each must be an actor, as add_mesh returns it'
            raise TypeError(msg)
    keys = [address(a) for group in found for a in group]
    if not all(found) or not found or len(set(keys)) < len(keys):
        msg = f'groups = {groups!r}: each must hold an actor or more, and each actor be in one'
        raise ValueError(msg)
    return found


def _put(renderer, actors, before):
    """Have actors drawn after all others but some."""
    props = renderer.GetViewProps()
    end = _end(props, before)
    there = [props.GetItemAsObject(i) for i in range(max(end - len(actors), 0), end)]
    if there == actors:
        return
    for actor in actors:
        props.RemoveItem(actor)
    end = _end(props, before)
    for actor in reversed(actors):
        props.InsertItem(end - 1, actor)


def _end(props, before) -> int:
    """Return how many props come before some, and before marks that are no part of the scene."""
    places = [props.IsItemPresent(actor) - 1 for actor in before]  # -1 where it is not
    end = min((k for k in places if k >= 0), default=props.GetNumberOfItems())
    while end and is_marker(props.GetItemAsObject(end - 1)):
        end -= 1
    return end


def _smooths(frame) -> bool:
    """Tell whether edges of meshes are smooth in a window."""
    chosen = frame.renderer.GetPass()
    return frame.window.GetMultiSamples() > 1 or (chosen is not None and chosen.IsA('vtkSSAAPass'))
