"""Scalar bars of things that were sent to workers: they stay in the plotter."""

from __future__ import annotations

from pvibr.things.scalar_bars import Bar


class KeptBar:
    """The scalar bar of a thing that is no longer in this process, with its colours as sent."""

    def __init__(self, thing):
        self._mapper, self._title = thing.scalar_mapper(), thing.scalar_title()
        self.bar: Bar | None = thing.bar
        self.pipeline, self.has_names = thing.pipeline, thing.has_names

    def scalar_mapper(self):
        """Return the mapper with the lookup table of the scalars."""
        return self._mapper

    GetMapper = scalar_mapper

    @property
    def mapper(self):
        """The same, as PyVista asks for it."""
        return self._mapper

    def scalar_title(self) -> str:
        """Return the title of the scalar bar."""
        return self._title

    def has_bar(self) -> bool:
        """Return True: the thing had one."""
        return True


def kept_bars(things) -> list[KeptBar]:
    """Return the bars of those things that are coloured by scalars."""
    return [KeptBar(t) for t in things if t.bar is not None and t.scalar_mapper() is not None]
