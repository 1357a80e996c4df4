"""Numbers of several members side by side, in compiled code; what there is of them, and what it does, is in `lanes.py`.

load(array, row, width): a row of an array of doubles, shape (row, width). store(array, row, value): keep lanes there.
where(mask, yes, no): `yes` in the lanes of the mask and `no` in the others. bits(mask): a whole number, lane k its bit
k.
"""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import Intrinsic


def _lanes() -> Any:
    from stiffdice.dynamics import lanes

    return lanes


load: Any = Intrinsic(_lanes, "load")
store: Any = Intrinsic(_lanes, "store")
where: Any = Intrinsic(_lanes, "where")
bits: Any = Intrinsic(_lanes, "bits")
