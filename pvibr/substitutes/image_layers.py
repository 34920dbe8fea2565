"""Image layers: parts of the scene cached as images and warped to each frame."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.effects.live_texture import LiveTexture
from pvibr.gl import release
from pvibr.gl.drawer import Drawer
from pvibr.substitutes.layer import FrameState, Layer, numbers_by_depth
from pvibr.substitutes.layer_card import LayerCard
from pvibr.substitutes.layer_members import Lighting, Member
from pvibr.substitutes.layer_picture import Settings
from pvibr.substitutes.substitute import Substitute, addresses
from pvibr.things.actor_watch import ActorWatch
from pvibr.things.casters import Surfaces, listed
from pvibr.things.thing import Thing, joined_bounds

# Eye motion that renews a split by depth, relative to the distance of the nearest box.
_NEAR = 0.25
_FRONT = 100  # place in the draw order after all other cards


class ImageLayers(Substitute):
    """Parts of the scene cached as images, which are warped to each frame.

    An image shows a layer's lit actors with overscan. Each frame warps it by the best fit to its
    characteristic points, the nearest and farthest of each block, and depth-tests it. It is
    rendered again once a point is displaced by more than `max_error`, it lacks something visible,
    its resolution is too low, its actors change, or their shading changes by more than
    `max_shade`. The actors themselves can still be picked, moved, hidden and removed.

    Parameters
    ----------
    groups : sequence of vtkActor or sequences of them, optional
        Actors of each layer, all in the same subplot; by default all actors of the subplot, later
        ones included, are split by depth.
    name : str, optional
        Name in reports.
    **settings
        Settings.

    Raises
    ------
    TypeError
        If an item of `groups` is not an actor.
    ValueError
        If a layer is empty, an actor occurs twice, or a setting is out of range.

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

    max_shade = Param(0.02, 'Maximum error of brightness, as a share of white.', range='(0, 1]')
    warp = Param(
        'projective',
        'Affine warp alone, or after the homography of the best-fit plane, which is exact for a '
        'camera that only turns.',
        choices=('affine', 'projective'),
    )
    overscan = Param(
        0.15,
        'Margin rendered beyond each side of the screen, relative to its size; raise it for a '
        'camera that turns.',
        range='[0, 1]',
    )
    resolution = Param(
        (),
        'Texels per pixel along a side, for all layers or each; by default 1, or 2 if the window '
        'is anti-aliased.',
        range='[0.05, 4]',
    )
    blur = Param(
        (),
        'Standard deviation of a Gaussian blur, for all layers or each: a cheap depth of field.',
        range='[0, 100]',
        unit='px',
    )
    count = Param(4, 'Maximum number of layers when split by depth.', range='[1, 16]')
    memory = Param(
        2**29,
        'Maximum GPU memory for images; limits their resolution.',
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

    # -- seen from other things -------------------------------------------------------------------

    def _contents(self) -> str:
        return f'{len(self)} layers of {len(self._members)} actors'

    def actors(self) -> list:
        """Return the actors of all layers."""
        return [m.actor for m in self._members.values()]

    def _stood_for(self) -> list:
        return self.actors()

    @property
    def props(self) -> tuple:
        """Itself and the quads that show its layers."""
        return (self, *self.shader_actors())

    def _cards(self) -> list:
        return self._layer_cards

    def solids(self) -> list:
        """Return the actors whose meshes cast shadow volumes."""
        return [m.actor for m in self._members.values() if m.why != 'hidden']

    @property
    def bounds(self):
        """World bounds of all actors that are visible."""
        if self._frame is None:
            self._update()
        return super().bounds

    # -- attaching --------------------------------------------------------------------------------

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
        """Return True if images may replace actors in a frame, else the reason why not."""
        if frame.scale != 1:
            return 'screenshots larger than the window draw the actors'
        return super().needed(frame)

    # -- members ----------------------------------------------------------------------------------

    def _update(self):
        """Update all members, without actors that left the subplot."""
        self._gather()
        members = list(self._members.values())
        changed = [members[i].update() for i in self._watch.changed()]
        self._watch.settle()
        self._version += any(changed)

    def _gather(self):
        if self.pipeline is None:
            return
        # Actors that another thing replaces belong to that.
        other_things = [t for t in self.pipeline.things if t is not self]
        free_actors, _ = self._surfaces.chosen(None, other_things)
        excluded, prop_of = addresses(self.props), self._surfaces.plain_actors.prop_of
        present_actors = {
            k: a for k, a in free_actors.items() if k not in excluded and prop_of(a) is a
        }
        new_keys = present_actors.keys() - self._members.keys() if self._groups is None else set()
        gone_keys = self._members.keys() - present_actors.keys()
        if not new_keys and not gone_keys:
            return
        for key in new_keys:
            self._members[key] = Member(present_actors[key])
        for key in gone_keys:
            del self._members[key]
        for layer in self._layers if gone_keys else ():
            layer.keep(self._members)
        self._version += bool(gone_keys)
        self._watch = ActorWatch(self.actors(), self._watch)

    def _by_depth(self, frame):
        """Split all actors by depth, again if the camera moved far."""
        eligible = {m.key: m for m in self._members.values() if not m.why}
        if self._split:
            keys, count, eye, room = self._split
            eye_moved = np.linalg.norm(frame.eye - eye)
            if keys == eligible.keys() and count == self.count and eye_moved <= room:
                return
        boxes = [m.bounds for m in eligible.values()]
        layer_numbers, eye_distances = numbers_by_depth(frame, boxes, self.count)
        # The last layer holds what spans all depths: its middle does not count.
        counted = zip(eye_distances, layer_numbers, strict=True)
        room = min((distance for distance, n in counted if n < self.count), default=0.0)
        self._split = set(eligible), self.count, frame.eye, _NEAR * room
        groups_by_depth: dict[int, list] = {}
        for number, member in zip(layer_numbers, eligible.values(), strict=True):
            groups_by_depth.setdefault(number, []).append(member)
        reusable = {frozenset(m.key for m in layer.members): layer for layer in self._layers}
        new_layers = []
        for _, group in sorted(groups_by_depth.items()):
            key = frozenset(m.key for m in group)
            new_layers.append(reusable.pop(key) if key in reusable else Layer(group))
        for layer in reusable.values():
            layer.picture.release()
        self._layers = new_layers

    # -- frames -----------------------------------------------------------------------------------

    def _prepare(self, frame):
        if self._groups is None:
            self._by_depth(frame)
        limits = self.max_error, self.max_shade, self.warp, self.only_if_faster
        now = FrameState(frame, Lighting(frame.renderer), *self._scene(), *limits)
        for k, layer in enumerate(self._layers):
            layer.judge(now, self._settings(frame, k))
        self._take(now)
        self._show(frame)

    def _settings(self, frame, k) -> Settings:
        resolutions = self.resolution or (2.0 if _is_smoothed(frame) else 1.0,)
        resolution, blur = (v[min(k, len(v) - 1)] for v in (resolutions, self.blur or (0.0,)))
        needs_hdr = any(e.enabled and e.needs_hdr for e in self.pipeline.effects)
        color_format = 'rgba16f' if needs_hdr else 'rgba8'
        return Settings(
            resolution, blur, self.overscan, color_format, self.memory / len(self._layers)
        )

    def _scene(self) -> tuple[list, tuple]:
        """Return the effects that surfaces depend on, and a key of their state."""
        effects = [
            e
            for e in self.pipeline.effects
            if e.enabled
            and not (e.is_image_effect or e in self.pipeline.things or isinstance(e, LiveTexture))
        ]
        if not effects:
            return [], ()
        lives = [tuple((id(live), live.draws) for live in e.lives) for e in effects]
        effects_key = tuple(
            (id(e), e.content_key(), k) for e, k in zip(effects, lives, strict=True)
        )
        things = [t for t in self.pipeline.things if t.enabled]
        casters = self.pipeline.surfaces.casters(None, things)
        casters.things.remove(self)
        return effects, (effects_key, casters.key(), self._version)

    def _take(self, now):
        """Renew invalid images within the budget, the worst first."""
        invalid_layers = [k for k in self._layers if k.is_invalid]
        invalid_layers.sort(key=lambda k: -k.residual)
        seconds_left, taken_count = self._budget(), 0
        for layer in invalid_layers:
            if taken_count and layer.seconds.value > seconds_left:
                layer.late()
                continue
            seconds_left -= self._take_one(now, layer)
            taken_count += 1
        if not taken_count or self._drawer is None:
            return
        self._drawer.done()
        now.frame.renderer.UpdateLightsGeometryToFollowCamera()

    def _take_one(self, now, layer) -> float:
        """Renew an image; return the seconds spent."""
        self._drawer = self._drawer or Drawer(now.frame.renderer)
        seconds = layer.take(now, self._drawer)
        for member in layer.members:
            member.settle()
        self._watch.settle()
        return seconds

    def _show(self, frame):
        """Draw the images from far to near in place of their actors."""
        visible_layers = [(k, k.fit) for k in self._layers if k.fit is not None and k.fit.seen]
        visible_layers.sort(key=lambda pair: -pair[0].away(pair[1]))
        layer_cards, reads_depth = self._layer_cards, self._depth_is_read(frame)
        while len(layer_cards) < len(visible_layers):
            layer_cards.append(LayerCard())
            for actor in layer_cards[-1].actors:
                put_inner(frame.renderer, actor)
        for card, (layer, fit) in zip(layer_cards, visible_layers, strict=False):
            bounds = joined_bounds(layer.bounds.tolist())
            card.show(frame, layer.picture, fit, bounds, deep=reads_depth)
        # Layers precede the fringes of other things, except blurred ones nearer than all sharp.
        is_sharp = [not layer.picture.blurred for layer, _ in visible_layers]
        sharp_end = len(is_sharp) - is_sharp[::-1].index(True) if any(is_sharp) else 0
        order: list = []
        for k, card in enumerate(layer_cards):
            order += card.order(k - sharp_end if k < sharp_end else _FRONT + k)
        self.order = tuple(order)
        hidden_keys = {
            m.key for k in self._layers if k.fit is not None for m in k.members if not m.why
        }
        self._watch.hide([i for i, key in enumerate(self._members) if key in hidden_keys])

    # -- memory -----------------------------------------------------------------------------------

    def release(self):
        """Free GPU memory; the context is current."""
        self.deactivate()
        window = None if self.pipeline is None else self.pipeline.window
        for card in self._cards():
            card.release(window)
        release(*(layer.picture for layer in self._layers), self._drawer)
        self._drawer = None

    def report(self) -> dict:
        """Return error, renewals and their reasons for each layer."""
        return {
            'bytes': sum(layer.picture.nbytes for layer in self._layers),
            'taken': sum(layer.taken for layer in self._layers),
            'residual_px': max((layer.residual_shown for layer in self._layers), default=0.0),
            **{f'layer {k}': layer.report() for k, layer in enumerate(self._layers)},
        }


def _several(name, value):
    """Return a number as a tuple for settings that may differ between layers."""
    is_scalar = name in ('resolution', 'blur') and isinstance(value, (int, float))
    return (value,) if is_scalar and not isinstance(value, bool) else value


def _checked_groups(groups) -> list:
    group_actors = [listed(group) for group in listed(groups)]
    for actor in (a for group in group_actors for a in group):
        if not isinstance(actor, _vtk.vtkActor) or isinstance(actor, Thing):
            raise TypeError(
                f'groups must contain actors (from add_mesh), got {type(actor).__name__}'
            )
    actor_keys = [address(a) for group in group_actors for a in group]
    if not all(group_actors) or not group_actors or len(set(actor_keys)) < len(actor_keys):
        raise ValueError(f'groups must be non-empty and share no actor, got {groups!r}')
    return group_actors


def _is_smoothed(frame) -> bool:
    """Return True if the window is anti-aliased."""
    render_pass = frame.renderer.GetPass()
    return frame.window.GetMultiSamples() > 1 or (
        render_pass is not None and render_pass.IsA('vtkSSAAPass')
    )
