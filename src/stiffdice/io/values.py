"""Values that no file of ours has, whatever was computed."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice.errors import RefusedError
from stiffdice.io.structure import Contents


def check(contents: Contents, name: str, values: np.ndarray[Any, Any]) -> None:
    """Raise RefusedError at a coordinate that is not finite, and at an enum's value that has no word.

    Results may well be NaN or infinite: runs blow up.
    """
    if not values.size:
        return
    if name in contents.coordinates and values.dtype.kind == "f" and not np.isfinite(values).all():
        raise RefusedError(f"{name}: a coordinate that is not finite")
    count = contents.meanings.get(name)
    if count is not None and not (values.min() >= 0 and values.max() < count):
        wrong = values[(values < 0) | (values >= count)].flat[0]
        raise RefusedError(f"{name} = {wrong}: allowed is 0 to {count - 1}, which have a word in flag_meanings")
