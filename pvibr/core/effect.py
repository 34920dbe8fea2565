"""The base class of everything that a pipeline runs."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from inspect import Signature
from typing import Any, ClassVar

import numpy as np

from pvibr.core.arguments import checked_number
from pvibr.core.params import Param, checked_name, params_of
from pvibr.core.signatures import arguments_of, docstring_of, signature_of
from pvibr.core.spelling import Complete, check_attribute, nearest


def _nowhere():
    return None


def put_into(effect, pipeline):
    """Record the pipeline that an effect is in, or None."""
    # Weak: the scene holds things, and Python's collector sees no cycles through VTK.
    pipeline_ref = _nowhere if pipeline is None else weakref.ref(pipeline)
    effect._pipeline = pipeline_ref  # noqa: SLF001


class Effect(metaclass=Complete):
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

    #: Public names; the others are hooks, which `dir` omits.
    FOR_USERS: tuple[str, ...] = (
        *('enabled', 'before', 'name', 'remove', 'state', 'restore', 'report', 'wait'),
    )

    #: Whether instances keep their constructor arguments, to be copied and pickled.
    keeps_arguments = True

    # -- what a class declares ---------------------------------------------------------------

    #: Whether it runs; the pipeline disables an effect that raises.
    enabled = True
    #: Class name in ``pvibr.effects.ORDER`` that it runs right before; None for its default place.
    before: str | None = None
    #: Whether a subplot has only one of its kind: another replaces it, as in a cell run twice.
    single = False
    #: Whether a second equal one is redundant: it replaces the first, as in a cell run twice.
    once = False
    #: Whether it also runs in picking frames.
    picks = False
    #: Whether `render` needs colours above 1.
    needs_hdr = False
    #: Whether the scene is drawn on black because it draws the background.
    draws_background = False
    #: A setting, and the value at which the effect changes nothing and is skipped.
    neutral: tuple[str, object] | None = None
    #: Whether it draws over a transparent background, which becomes opaque there.
    covers = False
    #: Named sets of settings for control panels; settings not in a set take their default.
    presets: dict[str, dict] = {}
    #: In a browser: 'shown', 'baked' by `bake_into` or 'lost', and how or why.
    web: tuple[str, str] = ('lost', 'works on frames, and a browser draws its own')

    _pipeline = staticmethod(_nowhere)
    #: Number of changes of settings.
    revision = 0
    _name: str | None = None
    _made_of: tuple
    #: Whether `render` reads ``picture.depth``: instances draw that of their surfaces only then.
    reads_depth = True
    #: Frame time in ms that it asks for while the view moves, None for the plotter's.
    frame_ms: Any = None
    #: Returns the triangles of a frame about to be drawn, as a function of its quality.
    triangles_of: Callable[[Any], Callable[[float], float]] | None = None
    #: Whether it draws in another way where the driver refuses its shaders.
    mends_shaders = False
    #: Class passed by the user, if that created a subclass with additional settings.
    _class: type | None = None
    __signature__: ClassVar[Signature]

    @property
    def pipeline(self):
        """The pipeline that it is in, or None."""
        return self._pipeline()

    @classmethod
    def sample(cls, actors) -> Effect:
        """Return an instance that visibly changes a picture of these actors, for tests."""
        return cls()

    @property
    def why_neutral(self) -> str:
        """The setting that makes it change nothing, or an empty string."""
        if self.neutral is None or getattr(self, self.neutral[0]) != self.neutral[1]:
            return ''
        return f'{self.neutral[0]} is {self.neutral[1]}'

    # -- hooks, in the order in which they are called ----------------------------------------

    def attach(self, pipeline):
        """Enter a pipeline: add props to ``pipeline.renderer``."""
        put_into(self, pipeline)

    #: Returns a frame about to be drawn, or the sample of it that is drawn instead.
    as_sampled: Callable[[Any], Any] | None = None

    def needed(self, frame) -> bool | str:
        """Return True if the frame needs the effect, else the reason."""
        return self.why_neutral or True

    def is_prepared(self, frame) -> bool:
        """Return True if the last preparation holds for a frame: nothing has changed since."""
        return False

    def prepare(self, frame):
        """Do the work before the scene is drawn."""

    def finish(self, frame):
        """Undo what only the drawing of the scene needed, such as bound textures."""

    def render(self, frame, picture):
        """Draw a new picture from the current one; overriding this makes an image effect."""

    def deactivate(self):
        """Undo what `prepare` left in the scene: the next frames are drawn without the effect."""

    def release(self):
        """Free GPU memory; the context is current, and the effect may be used again."""

    def detach(self):
        """Leave the pipeline: remove props from the scene."""
        put_into(self, None)

    # -- properties read by a pipeline --------------------------------------------------------

    @property
    def props(self) -> tuple:
        """VTK props that represent it in the scene."""
        return ()

    def is_gone(self, renderer) -> bool:
        """Return True if its props were removed from the scene directly."""
        return bool(self.props) and not any(map(renderer.HasViewProp, self.props))

    @property
    def is_image_effect(self) -> bool:
        """Whether it draws on the picture of a frame: its class overrides `render`."""
        return type(self).render is not Effect.render

    def content_key(self) -> object:
        """Return a value that changes with what it shows on surfaces, but not with the camera."""
        return self.revision

    @property
    def surfaces(self) -> bool:
        """Whether `render` reads normals and ids from ``pipeline.buffers``."""
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
        """Whether nothing changed in the last frame, for effects that watch for changes."""
        return True

    @property
    def unfinished(self) -> bool:
        """Whether more frames of the same view would refine it."""
        return False

    @property
    def pending(self) -> bool:
        """Whether something is made in the background that will refine it."""
        return False

    @property
    def is_draft(self) -> bool:
        """Whether it is drawn as a draft until that is made, or goes on being made."""
        return self.pending

    def wait(self, timeout=None) -> bool:
        """Wait until what is made in the background is there, such as images of instances.

        Parameters
        ----------
        timeout : float, optional
            Seconds to wait at most; by default any time.

        Returns
        -------
        bool
            True if all is there, False if the time was too short.

        Raises
        ------
        ValueError
            If the timeout is negative or no number.
        """
        if timeout is not None:
            checked_number('timeout', timeout, 0)
        return True

    def lens_of(self, frame) -> tuple[float, float] | None:
        """Return aperture radius and focus distance if samples take their eyes from a lens."""
        return None

    def reach(self, frame) -> float:
        """Return how many pixels around itself a pixel depends on: the overlap of tiles."""
        return 0.0

    def expose(self, frame, picture) -> float:
        """Return the exposure of the picture, in stops."""
        return 0.0

    @property
    def metered(self) -> Any:
        """A texture of one texel with further stops that `expose` has metered, or None."""
        return None

    def horizon_color(self, frame) -> tuple[float, ...] | None:
        """Return the colour that it draws at the horizon, or None."""
        return None

    def pick(self, x, y) -> object | None:
        """Return its nearest item under a pixel, or None.

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
        """Return statistics of the last frame; ``bytes`` is the GPU memory in use."""
        return {'bytes': 0}

    def bake_into(self, scene):
        """Add what it shows to a `BakedScene`; called if `web` says 'baked'."""

    # -- public interface ---------------------------------------------------------------------

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        arguments = arguments_of(cls)
        cls.__signature__ = signature_of(arguments)
        if cls.__doc__ is not None:
            cls.__doc__ = docstring_of(cls, arguments)

    def __init__(self, **settings):
        self._set(self._checked(settings))

    def __setattr__(self, name, value):
        if name[0] == '_':  # ours: nobody's check of names
            object.__setattr__(self, name, value)
            return
        check_attribute(self, name)
        pipeline = self._pipeline()
        if pipeline is not None and not isinstance(getattr(type(self), name, None), Param):
            pipeline.check_thread()
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        """Return the public names, without hooks."""
        class_dicts = [vars(c) for c in type(self).__mro__ if 'FOR_USERS' in vars(c)]
        base_names = {name for names in class_dicts for name in names if not name.startswith('_')}
        user_names = {*params_of(type(self)), *(n for c in class_dicts for n in c['FOR_USERS'])}
        return sorted(set(super().__dir__()) - (base_names - user_names))

    def __reduce__(self):
        """Return the recipe of an equal one, in no plotter and with nothing on the GPU."""
        args, kwargs = self._made_of
        return _made_again, (self._class or type(self), args, kwargs, self._changed())

    def __copy__(self):
        return self.__deepcopy__({})

    def __deepcopy__(self, _memo):
        """Return an equal one with the same actors, textures and images."""
        make, arguments = self.__reduce__()
        return make(*arguments)

    def is_like(self, other) -> bool:
        """Return True if another effect was made with equal arguments and has equal settings."""
        can_compare = self.keeps_arguments and other.keeps_arguments
        return can_compare and _equal(self.__reduce__(), other.__reduce__())

    def _changed(self) -> dict:
        """Return all attributes that may have been set since construction."""
        attributes = {name: getattr(self, name) for name in params_of(type(self))}
        members = {n: v for cls in reversed(type(self).__mro__) for n, v in vars(cls).items()}
        for name, value in members.items():
            if isinstance(value, property) and value.fset:
                attributes[name] = getattr(self, name)
        own_values = vars(self)
        attributes |= {n: own_values[n] for n in ('enabled', 'before') if n in own_values}
        return attributes | {'name': self._name}

    def _checked(self, settings):
        params = params_of(type(self))
        unknown_names = sorted(set(settings) - set(params))
        if unknown_names:
            hint, names = nearest(unknown_names[0], params), ', '.join(unknown_names)
            setting_names = ', '.join(params) or 'none'
            raise TypeError(f'{self.name} has no setting {names}{hint}; it has: {setting_names}')
        return {n: params[n].check(v, type(self).__name__) for n, v in settings.items()}

    def _set(self, settings):
        for name, value in settings.items():
            setattr(self, name, value)

    @property
    def name(self) -> str:
        """Name in reports, warnings and the state; the class name by default."""
        return self._name or type(self).__name__

    @name.setter
    def name(self, name):
        self._name = checked_name(name)

    @property
    def given_name(self) -> str | None:
        """Name set by the user, or None."""
        return self._name

    def __repr__(self) -> str:
        """Return its class, name, contents and state in one line."""
        class_name = type(self).__name__
        quoted_name = '' if self.name == class_name else f' {self.name!r}'
        details = ', '.join(filter(None, (self._contents(), self._state())))
        return f'<{class_name}{quoted_name}: {details}>'

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
        """Return the settings by name, as JSON values."""
        values = {name: getattr(self, name) for name in params_of(type(self))}
        return {n: list(v) if isinstance(v, tuple) else v for n, v in values.items()}

    def restore(self, state) -> list[str]:
        """Apply settings that `state` returned, all or none; return the unknown names.

        Parameters
        ----------
        state : dict
            Setting to value.

        Raises
        ------
        TypeError, ValueError
            If a value is not allowed; nothing is set.
        """
        params = params_of(type(self))
        self._set(self._checked({n: v for n, v in state.items() if n in params}))
        return [n for n in state if n not in params]


def switch_off(effect, error) -> str:
    """Disable an effect that raised an error; return what to tell the user."""
    effect.enabled = False
    why = f'{type(error).__name__}: {error}'.rstrip('.')
    return (
        f'{effect.name} is off, the picture is drawn without it: {why}. '
        'Mend the cause, then set its enabled = True, or remove it.'
    )


def _equal(first, second) -> bool:
    """Return True if two arguments are equal: numbers, text, arrays, or the same objects."""
    if first is second:
        return True
    if isinstance(first, dict) and isinstance(second, dict):
        return list(first) == list(second) and _equal([*first.values()], [*second.values()])
    if isinstance(first, (list, tuple)) and isinstance(second, (list, tuple)):
        return len(first) == len(second) and all(map(_equal, first, second))
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return np.array_equal(first, second)
    return isinstance(first, (int, float, str)) and first == second


def _made_again(cls, args, kwargs, changed):
    """Create an effect from constructor arguments, then apply later changes."""
    effect = cls(*args, **kwargs)
    effect._set(changed)
    return effect
