"""Two sides of an equation compared, and what is told where they differ by more than rounding explains."""

from __future__ import annotations

from collections.abc import Callable
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
    return _line(name, a, same, lambda k: f"{b[k]:.17g}, {why}")


def outside(name: str, found: npt.ArrayLike, fine: npt.ArrayLike, allowed: str) -> list[str]:
    """Return a line if values are not what is allowed; fine: where they are, of the same shape."""
    given, good = np.broadcast_arrays(found, fine)
    return _line(name, given, good, lambda k: allowed)


def _line(name: str, found: npt.NDArray[Any], fine: npt.NDArray[Any], allowed: Callable[[Any], str]) -> list[str]:
    """Return what is told of the first value that is not fine; allowed: at an index."""
    if fine.all():
        return []
    wrong = np.argwhere(~fine)
    k = tuple(wrong[0].tolist())
    value = f"{found[k]:.17g}" if found.dtype.kind == "f" else str(found[k])
    more = f" ({len(wrong)} of {found.size} values)" if found.size > 1 else ""
    return [f"{name}{list(k) if k else ''} = {value}: allowed is {allowed(k)}{more}"]
