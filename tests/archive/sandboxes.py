"""Whether this machine has a sandbox, for the tests of what runs in one."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from stiffdice.archive.sandbox import sandboxed
from stiffdice.errors import RefusedError


def lack() -> str:
    """Return why there is no sandbox here; nothing if there is one."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            sandboxed(Path(folder))
        except RefusedError as error:
            return str(error)
    return ""


needed = pytest.mark.skipif(bool(_lack := lack()), reason=_lack)
