"""The axes of a die, x, y, z, and the faces at their ends."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stiffdice.scene import die

Array = npt.NDArray[np.float64]

# By axis: the face that it comes out of, and the one opposite.
FACES = tuple(
    (towards, die.opposite(towards)) for axis in range(3) for towards in die.FACES if die.NORMALS[towards - 1, axis] > 0
)
PAIRS = tuple("-".join(map(str, sorted(pair))) for pair in FACES)


def pairs_of(counts: npt.NDArray[np.int64]) -> Array:
    """Return the counts of the pairs of faces on each axis, shape (..., 3), for those of the faces, shape (..., 6)."""
    return np.stack([counts[..., a - 1] + counts[..., b - 1] for a, b in FACES], axis=-1).astype(np.float64)
