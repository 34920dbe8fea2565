"""What everything that a pipeline runs has in common."""

from __future__ import annotations

import weakref
from inspect import Signature
from typing import ClassVar

import numpy as np

from pvibr.core.params import checked_name, params_of
from pvibr.core.signatures import arguments_of, docstring_of, signature_of
from pvibr.core.spelling import Spelled, nearest


def _nowhere():
    return None


def put_into(effect, pipeline):
    """Record the pipeline that an effect is in, or None."""
    # Weak: a thing is held by the scene, from where Python's collector sees no cycles.
    found = _nowhere if pipeline is None else weakref.ref(pipeline)
    effect._pipeline = found  # noqa: SLF001


class Effect(Spelled):
    """Settings, and the hooks that a pipeline calls in every frame.

    A subclass declares its settings as :class:`pvibr.Param` and overrides the hooks it needs.
    An image effect has ``render(frame, picture)``: it reads ``picture.color`` and
    ``picture.depth`` and draws the new picture within ``with picture.drawing():``.

    Parameters
    ----------
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        If a setting is unknown or of the wrong type.
    ValueError
        If a value is out of range.

    Examples
    --------
    >>> from pvibr import Effect, Param
    >>> class Fade(Effect):
    ...     amount = Param(0.5, 'Fraction of the light that is removed.', range='[0, 1]')
    ...     neutral = 'amount', 0
    >>> Fade(amount=0.25).state()
    {'amount': 0.25}
    """

    #: Names below that are for users; the others are hooks, which `dir` leaves out.
    FOR_USERS: tuple[str, ...] = (
        'enabled',
        'before',
        'name',
        'remove',
        'state',
        'restore',
        'report',
    )

    keeps_arguments = True

    # -- what a class declares ---------------------------------------------------------------

    #: Whether it runs; the pipeline disables an effect that raises.
    enabled = True
    #: Name of the class in ``pvibr.effects.ORDER`` that it runs right before, None for its own.
    before: str | None = None
    #: Whether a subplot has one of its kind: another one replaces it, as in a cell run twice.
    single = False
    #: Whether an equal one more is of no use: it replaces the first, as in a cell run twice.
    once = False
    #: Whether it also runs in frames that are drawn to pick.
    picks = False
    #: Whether `render` needs colours above 1.
    needs_hdr = False
    #: Whether the scene is drawn on black, since it draws what is behind the scene.
    draws_background = False
    #: A setting and the value at which the effect changes nothing and is skipped.
    neutral: tuple[str, object] | None = None
    #: Whether it also draws over a transparent background, which is opaque there then.
    covers = False
    #: Named sets of settings for control panels; what a set leaves out has its default.
    presets: dict[str, dict] = {}
    #: In a browser: 'shown', 'baked' by `bake_into` or 'lost'; and as what, or why.
    web: tuple[str, str] = ('lost', 'works on frames, and a browser draws its own')

    _pipeline = staticmethod(_nowhere)
    #: How many times a setting was changed.
    revision = 0
    _name: str | None = None
    _made_of: tuple
    #: Class that it was made of, if that made one more with settings of its own.
    _class: type | None = None
    __signature__: ClassVar[Signature]

    @property
    def pipeline(self):
        """The pipeline that it is in; None in none."""
        return self._pipeline()

    @classmethod
    def sample(cls, actors) -> Effect:
        """Return an instance that shows in any picture of some actors, for tests and trials."""
        return cls()

    @property
    def why_neutral(self) -> str:
        """The setting with which it changes nothing, if it has that, else ''."""
        if self.neutral is None or getattr(self, self.neutral[0]) != self.neutral[1]:
            return ''
        return f'{self.neutral[0]} is {self.neutral[1]}'

    # -- hooks, in the order in which they are called ----------------------------------------

    def attach(self, pipeline):
        """Enter a pipeline: add props to ``pipeline.renderer``."""
        put_into(self, pipeline)

    def as_sampled(self, frame):
        """Return a frame that begins as it is drawn: itself, or a sample of it."""
        return frame

    def lens_of(self, frame) -> tuple[float, float] | None:
        """Return aperture radius and focus distance, if the eye of samples varies by these."""
        return None

    def needed(self, frame) -> bool | str:
        """Return True if the frame needs the effect, or the reason why not."""
        return self.why_neutral or True

    def prepare(self, frame):
        """Work before the scene is drawn."""

    def render(self, frame, picture):
        """Draw a new picture from the drawn one; a class that has this is an image effect."""

    def finish(self, frame):
        """Undo what only the drawing needed, such as bound textures."""

    def deactivate(self):
        """Undo what `prepare` left in the scene: the next frames are drawn without the effect."""

    def release(self):
        """Free GPU memory; the context is current, and the effect may be used again."""

    def detach(self):
        """Leave the pipeline: remove props from the scene."""
        put_into(self, None)

    # -- questions that a pipeline asks ------------------------------------------------------

    @property
    def props(self) -> tuple:
        """VTK props that stand for it in the scene."""
        return ()

    def is_gone(self, renderer) -> bool:
        """Return True if its props were removed from the scene by other means."""
        return bool(self.props) and not any(map(renderer.HasViewProp, self.props))

    @property
    def is_image_effect(self) -> bool:
        """Whether it draws on the picture of a frame: its class has `render`."""
        return type(self).render is not Effect.render

    def content_key(self) -> object:
        """Return a value that changes with what it shows on surfaces, the camera left out."""
        return self.revision

    @property
    def surfaces(self) -> bool:
        """Whether `render` reads normals and ids of surfaces from ``pipeline.buffers``."""
        return False

    @property
    def lives(self) -> list:
        """Live textures that it shows."""
        return []

    @property
    def one_sample(self) -> bool:
        """Whether the scene is drawn with one sample per pixel, whatever the window has."""
        return False

    @property
    def rests(self) -> bool:
        """Whether nothing has changed in the last frame, of effects that look for it."""
        return True

    @property
    def unfinished(self) -> bool:
        """Whether more frames of the same view would refine it."""
        return False

    def reach(self, frame) -> float:
        """Return how many pixels around itself a pixel depends on: tiles overlap by it."""
        return 0.0

    def expose(self, frame, picture) -> float:
        """Return the stops by which it exposes the picture."""
        return 0.0

    def horizon_color(self, frame) -> tuple[float, ...] | None:
        """Return the colour that it draws at the horizon, None if it draws none."""
        return None

    def pick(self, x, y) -> object | None:
        """Return the nearest item of it under a pixel, or None.

        Parameters
        ----------
        x, y : float
            Pixels from the lower left corner of the window.

        Returns
        -------
        pvibr.things.picking.Hit or None
            ``index`` of the item and ``point`` on it, world units.
        """
        return None

    def report(self) -> dict:
        """Return figures on the last frame; ``bytes`` is the GPU memory held."""
        return {'bytes': 0}

    def bake_into(self, scene):
        """Add what it shows to a `BakedScene`; called if `web` says 'baked'."""

    # -- what users use ----------------------------------------------------------------------

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        arguments = arguments_of(cls)
        cls.__signature__ = signature_of(arguments)
        if cls.__doc__ is not None:
            cls.__doc__ = docstring_of(cls, arguments)

    def __init__(self, **settings):
        self._set(self._checked(settings))

    def __dir__(self) -> list[str]:
        """Return the names that users use: hooks are left out."""
        declaring = [vars(c) for c in type(self).__mro__ if 'FOR_USERS' in vars(c)]
        public = {name for names in declaring for name in names if not name.startswith('_')}
        for_users = {*params_of(type(self)), *(n for c in declaring for n in c['FOR_USERS'])}
        return sorted(set(super().__dir__()) - (public - for_users))

    def __reduce__(self):
        """Return what makes an equal one, in no plotter, with nothing on the GPU."""
        args, kwargs = self._made_of
        return _made_again, (self._class or type(self), args, kwargs, self._changed())

    def __copy__(self):
        return self.__deepcopy__({})

    def __deepcopy__(self, _memo):
        """Return an equal one, of the same actors, textures and images."""
        make, arguments = self.__reduce__()
        return make(*arguments)

    def is_like(self, other) -> bool:
        """Return True if another effect was made of equal arguments, and is set alike."""
        made = self.keeps_arguments and other.keeps_arguments
        return made and _equal(self.__reduce__(), other.__reduce__())

    def _changed(self) -> dict:
        """Return what may have been set since it was made."""
        kept = {name: getattr(self, name) for name in params_of(type(self))}
        members = {n: v for cls in reversed(type(self).__mro__) for n, v in vars(cls).items()}
        for name, value in members.items():
            if isinstance(value, property) and value.fset:
                kept[name] = getattr(self, name)
        own = {n: v for n, v in vars(self).items() if not n.startswith('_')}
        kept |= {name: own[name] for name in ('enabled', 'before') if name in own}
        return kept | {'name': self._name}

    def _checked(self, settings):
        params = params_of(type(self))
        unknown = sorted(set(settings) - set(params))
        if unknown:
            known = ', '.join(params) or 'none'
            hint = nearest(unknown[0], params)
            raise TypeError(
                f'{self.name} has no setting {", ".join(unknown)}{hint}; it has: {known}'
            )
        return {n: params[n].check(v, type(self).__name__) for n, v in settings.items()}

    def _set(self, settings):
        for name, value in settings.items():
            setattr(self, name, value)

    @property
    def name(self) -> str:
        """Name in reports, warnings and the state; the class's name by default."""
        return self._name or type(self).__name__

    @name.setter
    def name(self, name):
        self._name = checked_name(name)

    @property
    def given_name(self) -> str | None:
        """Name that it was given, None without."""
        return self._name

    def __repr__(self) -> str:
        """Return in a line what it is, its name, its contents and its state."""
        kind = type(self).__name__
        named = '' if self.name == kind else f' {self.name!r}'
        return f'<{kind}{named}: {", ".join(filter(None, (self._contents(), self._state())))}>'

    def _contents(self) -> str:
        """Return what it consists of, such as '3 spheres'."""
        return ''

    def _state(self) -> str:
        if self.pipeline is None:
            return 'in no plotter'
        return 'on' if self.enabled else 'off'

    def remove(self):
        """Remove it from its plotter and free its GPU memory; it may be added again."""
        if self.pipeline is not None:
            self.pipeline.remove(self)

    def state(self) -> dict:
        """Return the settings by name, as values that JSON keeps."""
        values = {name: getattr(self, name) for name in params_of(type(self))}
        return {n: list(v) if isinstance(v, tuple) else v for n, v in values.items()}

    def restore(self, state) -> list[str]:
        """Set the settings to what `state` returned, all or none; return names that are unknown.

        Parameters
        ----------
        state : dict
            Setting to value.

        Raises
        ------
        TypeError, ValueError
            If a value is not allowed; nothing is set.
        """
        known = params_of(type(self))
        self._set(self._checked({n: v for n, v in state.items() if n in known}))
        return [n for n in state if n not in known]


def _equal(one, other) -> bool:
    """Return True if two arguments are equal: numbers, text, arrays, or the same objects."""
    if one is other:
        return True
    if isinstance(one, dict) and isinstance(other, dict):
        return list(one) == list(other) and _equal([*one.values()], [*other.values()])
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        return len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    return isinstance(one, (int, float, str)) and one == other


def _made_again(cls, args, kwargs, changed):
    """Return an effect like one that was made of these arguments and changed since."""
    made = cls(*args, **kwargs)
    made._set(changed)
    return made
