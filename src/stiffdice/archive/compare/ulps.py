"""How many doubles lie between two."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def ulps(a: npt.NDArray[np.floating[Any]], b: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint64]:
    """Return how many steps of `numpy.nextafter` lead from `a` to `b`, elementwise, in their shape.

    A unit in the last place (ulp) is such a step, here as everywhere in `stiffdice diff`: from 1.0 up it is 2⁻⁵², down
    2⁻⁵³, and from zero 5e-324. Steps are counted through zero and the subnormal numbers; -0.0 is where 0.0 is. From
    the largest double to infinity is one.

    a, b: of one type (float16, float32 or float64) and shape, without NaN. Floating-point numbers of one sign are in
    the order of their bits read as whole numbers (IEEE 754), which is what makes them countable.
    """
    places_a, places_b = _places(a), _places(b)
    # Modulo 2⁶⁴ the difference is right even where it is beyond int64.
    up, down = places_b.view(np.uint64) - places_a.view(np.uint64), places_a.view(np.uint64) - places_b.view(np.uint64)
    return np.where(places_b > places_a, up, down)


def _places(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.int64]:
    """Return the place of each number in the row of all of its type, both zeros at 0."""
    native = np.ascontiguousarray(values, values.dtype.newbyteorder("=")).reshape(np.shape(values))
    whole = np.dtype(f"i{native.dtype.itemsize}")
    bits = native.view(whole)
    lowest = np.iinfo(whole).min
    return np.where(bits < 0, lowest - bits, bits).astype(np.int64)
