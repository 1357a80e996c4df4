"""What was measured so far, in a file of JSON: an interrupted measurement goes on, a finished one is told again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.scale.measures import Session
from stiffdice.io.writer import write_bytes


class Record:
    """Numbers by name, stored whenever one changes; those of another key (other code, or study) are forgotten."""

    def __init__(self, path: Path, key: str) -> None:
        self._path = path
        try:
            self._data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            self._data = {}
        if self._data.get("key") != key:
            self._data = {"key": key}

    def __contains__(self, name: str) -> bool:
        return name in self._data

    def __getitem__(self, name: str) -> Any:
        return self._data[name]

    def get(self, name: str, otherwise: Any) -> Any:
        """Return what is noted under a name, or something else."""
        return self._data.get(name, otherwise)

    def __setitem__(self, name: str, value: Any) -> None:
        self._data[name] = value
        write_bytes((json.dumps(self._data, indent=1) + "\n").encode(), self._path)

    def sessions(self, name: str) -> list[Session]:
        """Return the calls of the workflow under a name, as far as they were noted."""
        return [Session(*session) for session in self.get(f"{name} sessions", [])]

    @contextmanager
    def session(self, name: str) -> Iterator[None]:
        """Note when a call of the workflow begins, and how long it takes, however it ends; kill -9 leaves the first."""
        before, begun, started = self.sessions(name), time.time(), time.perf_counter()
        self[f"{name} sessions"] = [*before, Session(begun, None)]
        try:
            yield
        finally:
            self[f"{name} sessions"] = [*before, Session(begun, time.perf_counter() - started)]
