"""Arrays in a JSON text: all of them in one block, compressed, as the page's script unpacks it."""

from __future__ import annotations

import base64
import gzip
from typing import Any

import numpy as np
import numpy.typing as npt

# JavaScript's typed arrays by NumPy's types.
_TYPES = {"f8": "Float64Array", "f4": "Float32Array", "i4": "Int32Array", "u2": "Uint16Array", "u1": "Uint8Array"}


class Packer:
    """Collects arrays; what `put` returns says where in the block one lies."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0

    def put(self, values: npt.ArrayLike, kind: str) -> dict[str, Any]:
        """Store numbers as `f8`, `f4`, `i4`, `u2` or `u1`, little-endian, in C's order; return their place, as JSON."""
        data = np.asarray(values).astype(f"<{kind}")
        image = data.tobytes()
        place = {"type": _TYPES[kind], "at": self._length, "count": data.size}
        image += bytes(-len(image) % 8)  # a typed array begins at a multiple of its width
        self._parts.append(image)
        self._length += len(image)
        return place

    def block(self) -> str:
        """Return all arrays, gzip and base64; equal arrays give equal text."""
        return base64.b64encode(gzip.compress(b"".join(self._parts), 9, mtime=0)).decode()
