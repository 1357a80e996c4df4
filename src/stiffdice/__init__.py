"""How many time steps does a stiff ground cost, and what do you get for them?

Public: `open_results`.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

# By the module that has it: loaded when asked for, so that importing the package takes no time; and named, not
# imported, because the digest of all code follows what this file imports (`provenance.py`).
_PUBLIC = {"open_results": "stiffdice.io.labels"}


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
