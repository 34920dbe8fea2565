"""Items with NaN among their positions and sizes: refused, or hidden."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from pvibr.core.arguments import check_one_of

_REMEDY = "; nan='hide' hides such items"
_CHOICES = 'raise', 'hide'
#: What items that are all NaN have, by the shape of an item.
_NEUTRAL = {(4, 4): np.eye(4), (3, 3): np.eye(3), (4,): np.eye(4)[0]}


class NanRows:
    """Notes which items have NaN in the arguments that are checked with it."""

    def __init__(self, nan='raise'):
        check_one_of('nan', nan, _CHOICES)
        self.nan = nan
        #: Which items have NaN, shape (n,), by argument.
        self.by_name: dict[str, np.ndarray] = {}

    def anew(self) -> NanRows:
        """Return the same policy without items."""
        return NanRows(self.nan)

    @property
    def hides(self) -> bool:
        """Whether items with NaN are hidden."""
        return self.nan == 'hide'

    @property
    def mask(self) -> np.ndarray | None:
        """Which items have NaN in any argument, shape (n,), or None for none."""
        return np.any([*self.by_name.values()], 0) if self.by_name else None

    def changed(self, name, count, ids, nan_rows) -> NanRows:
        """Return the same for all of `count` items, where those of `ids` were checked again."""
        all_rows, mask, new_mask = self.anew(), self.mask, nan_rows.mask
        has_nan = np.zeros(count, bool) if mask is None else mask.copy()
        has_nan[ids] = False if new_mask is None else new_mask
        if has_nan.any():
            all_rows.by_name[name] = has_nan
        return all_rows

    def filled(self, name, values) -> np.ndarray:
        """Return values, a row per item, with those of a valid item in place of NaN."""
        with np.errstate(over='ignore', invalid='ignore'):
            if not np.isnan(values.sum()):  # faster than a test of each
                return values
        has_nan = np.isnan(values).reshape(len(values), -1).any(1)
        if not has_nan.any():  # infinities of both signs
            return values
        if not self.hides:
            raise ValueError(f'{name}[{np.argmax(has_nan)}] must be finite, got nan{_REMEDY}')
        filled_values = values.copy()
        valid_row = np.argmin(has_nan)
        is_any_valid = not has_nan[valid_row]
        neutral = _NEUTRAL.get(values.shape[1:], 0.0)
        filled_values[has_nan] = values[valid_row] if is_any_valid else neutral
        self.by_name[name] = has_nan
        return filled_values


def filled(nan_rows, name, values) -> np.ndarray:
    """Return values as :meth:`NanRows.filled` does, unchanged if there is no such policy."""
    return values if nan_rows is None or not values.ndim else nan_rows.filled(name, values)


@contextmanager
def advising(nan_rows):
    """Add to errors about values that are not finite that such items can be hidden."""
    try:
        yield
    except ValueError as error:
        if nan_rows is None or 'must be finite' not in str(error):
            raise
        raise ValueError(f'{error}{_REMEDY}') from error
