"""Two sides of an equation compared, and what is told where they differ by more than rounding explains."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

# Of one rounding, relative to its result: half of it, to be safe by two.
ROUNDING = float(np.finfo(np.float64).eps)
# Below it doubles have no full precision.
TINY = float(np.finfo(np.float64).tiny)


def unequal(name: str, found: npt.ArrayLike, right: npt.ArrayLike, room: npt.ArrayLike, why: str) -> list[str]:
    """Return a line if values differ from what they must be by more than `room`, all of one shape.

    Infinities and not-a-numbers are to be where the right values have them. why: the equation.
    """
    a, b = np.broadcast_arrays(np.asarray(found, np.float64), np.asarray(right, np.float64))
    same = (a == b) | (np.isnan(a) & np.isnan(b)) | (np.abs(a - b) <= np.asarray(room) + TINY)
    if same.all():
        return []
    wrong = np.argwhere(~same)
    k = tuple(int(index) for index in wrong[0])
    return [f"{name}{_place(k)} = {a[k]:.17g}: allowed is {b[k]:.17g}, {why}{_more(len(wrong), a.size)}"]


def outside(name: str, found: npt.ArrayLike, fine: npt.ArrayLike, allowed: str) -> list[str]:
    """Return a line if values are not what is allowed; fine: where they are, of the same shape."""
    given, good = np.broadcast_arrays(np.asarray(found), np.asarray(fine))
    if good.all():
        return []
    wrong = np.argwhere(~good)
    k = tuple(int(index) for index in wrong[0])
    return [f"{name}{_place(k)} = {_shown(given[k])}: allowed is {allowed}{_more(len(wrong), good.size)}"]


def _place(index: tuple[int, ...]) -> str:
    return f"[{', '.join(map(str, index))}]" if index else ""


def _more(count: int, of: int) -> str:
    return f" ({count} of {of} values)" if of > 1 else ""


def _shown(value: Any) -> str:
    return f"{value:.17g}" if isinstance(value, np.floating) else str(value)
