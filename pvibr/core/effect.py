"""What everything that a pipeline runs has in common."""

from __future__ import annotations

from typing import Any

from pvibr.core.params import params_of


class Effect:
    """Settings and up to two hooks: before a frame is drawn, and on its pixels.

    A subclass declares its settings as :class:`pvibr.Param` and writes the hooks that it needs.
    Image effects have ``render(frame, picture)``: they read ``picture.color`` and
    ``picture.depth`` and draw the new picture within ``with picture.drawing():``. Things in a
    scene add their actors in `attach` and name them in `props`.

    Parameters
    ----------
    **settings
        Values of the class's settings.

    Raises
    ------
    TypeError
        Where a setting is unknown or of the wrong type.
    ValueError
        Where a value is out of range.

    Examples
    --------
    >>> from pvibr import Effect, Param
    >>> class Fade(Effect):
    ...     amount = Param(0.5, 'How much is taken away.', range='[0, 1]')
    ...
    ...     def needed(self, frame):
    ...         return self.amount > 0 or 'amount is 0'
    >>> Fade(amount=0.25).state()
    {'amount': 0.25}
    """

    #: Off without being removed; the pipeline puts it off after an error.
    enabled = True
    #: Whether `prepare` also runs when a frame is drawn to pick.
    picks = False
    #: Whether `render` needs colours above 1: such a frame has no multisampling.
    needs_hdr = False
    #: What it runs right before, of ``pvibr.effects.ORDER``; by default its class has a place.
    before: str | None = None

    #: What becomes of it where a browser draws the scene, 'shown' as it is, 'baked' by `bake_into`
    #: or 'lost', and as what, or why.
    web: tuple[str, str] = ('lost', 'works on frames, and a browser draws its own')
    #: Whether `render` asks ``pipeline.buffers`` for normals and numbers of surfaces.
    surfaces: Any = False
    pipeline: Any = None
    _revision = 0
    _name: str | None = None

    def __init__(self, **settings):
        self._set(self._checked(settings))

    def _checked(self, settings):
        params = params_of(type(self))
        unknown = sorted(set(settings) - set(params))
        if unknown:
            known = ', '.join(params) or 'none'
            msg = f'{self.name} has no setting {", ".join(unknown)}; it has: {known}'
            raise TypeError(msg)
        return {n: params[n].check(v, type(self).__name__) for n, v in settings.items()}

    def _set(self, settings):
        for name, value in settings.items():
            setattr(self, name, value)

    @property
    def name(self) -> str:
        """What reports, warnings and the state call it; the class's name unless set."""
        return self._name or type(self).__name__

    @name.setter
    def name(self, name):
        self._name = name

    @property
    def props(self) -> tuple:
        """The VTK props that it has in the scene; it is removed once all of them are."""
        return ()

    def attach(self, pipeline):
        """Take a place in a pipeline; things add their props to ``pipeline.renderer`` here.

        Parameters
        ----------
        pipeline : pvibr.pipeline.Pipeline
            Where it was added.
        """
        self.pipeline = pipeline

    def detach(self):
        """Leave the pipeline; things take their props out of the scene here."""
        self.pipeline = None

    def needed(self, frame) -> bool | str:
        """Tell whether a frame needs it.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            The frame about to be drawn.

        Returns
        -------
        bool or str
            True, or why not.
        """
        return True

    def reach(self, frame) -> float:
        """Return how far around itself a pixel looks: tiles of large pictures overlap by it.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            A tile.

        Returns
        -------
        float
            Pixels.
        """
        return 0.0

    def prepare(self, frame):
        """Do what must be done before the frame is drawn.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            The frame about to be drawn.
        """

    def finish(self, frame):
        """Put back what only the drawing needed, such as bound textures; the frame is drawn.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            The frame that `prepare` was given.
        """

    def bake_into(self, scene):
        """Hand what it shows to a scene without pvibr; called where `web` says 'baked'.

        Parameters
        ----------
        scene : pvibr.export.scene.BakedScene
            Takes meshes, copies of them, quads, lines, and what colours surfaces.
        """

    def rest(self):
        """Take back what `prepare` left in the scene: frames are drawn without it now."""

    def release(self):
        """Free what it holds on the GPU; the context is current. It may be used again."""

    def state(self) -> dict:
        """Return the settings as values that JSON keeps.

        Returns
        -------
        dict
            Setting to value; None stays None.
        """
        values = {name: getattr(self, name) for name in params_of(type(self))}
        return {n: list(v) if isinstance(v, tuple) else v for n, v in values.items()}

    def restore(self, state) -> list[str]:
        """Set the settings to what `state` returned; all of them or none.

        Parameters
        ----------
        state : dict
            Setting to value.

        Returns
        -------
        list of str
            Names that are no settings of this effect, left out.

        Raises
        ------
        TypeError, ValueError
            Where a value is not allowed.
        """
        known = params_of(type(self))
        self._set(self._checked({n: v for n, v in state.items() if n in known}))
        return [n for n in state if n not in known]

    def report(self) -> dict:
        """Return what it has to tell, beside what the pipeline knows.

        Returns
        -------
        dict
            ``bytes`` (int) is what it holds on the GPU.
        """
        return {'bytes': 0}
