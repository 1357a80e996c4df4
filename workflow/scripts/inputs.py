"""The files that a job is given: one that cannot be trusted is set aside, so that the next run makes it again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import job  # noqa: F401 (which says where the library is)
import xarray as xr

from stiffdice.errors import RefusedError
from stiffdice.io.reader import open_file

Say = Callable[[str], None]

# What is found where, as its file says itself.
_KINDS = {"runs": "run", "surveys": "sweep", "experiments": "experiment", "timings": "timing"}


class Inputs:
    """Reads files, and sets aside those that are refused: all of them, before the job ends with the first one's error.

    say: writes a line to the job's log, where `run.py` finds what was set aside and why.
    """

    def __init__(self, say: Say) -> None:
        self._say = say
        self._first: RefusedError | None = None

    @property
    def whole(self) -> bool:
        """Whether none was refused so far."""
        return self._first is None

    @contextmanager
    def reading(self, path: str) -> Iterator[None]:
        """Set a file aside, as NAME.damaged, if the block refuses it, and go on."""
        try:
            yield
        except RefusedError as error:
            reason = str(error).removeprefix(f"{path}: ")
            Path(path).replace(f"{path}.damaged")
            self._say(f"set aside: {path}: {reason}")
            told = f"{path}: {reason}; set aside as {Path(path).name}.damaged, and the same command makes it again"
            self._first = self._first or RefusedError(told)

    def check(self) -> None:
        """Raise RefusedError if any was refused."""
        if self._first is not None:
            raise self._first


def _check_kind(path: str, found: xr.Dataset) -> None:
    """Raise RefusedError if a file says that it is of another kind than its place is for."""
    place = Path(path)
    asked = _KINDS.get(place.parent.name, place.stem)
    kind = found.attrs.get("kind", asked)
    if kind != asked:
        raise RefusedError(f"{path}: kind = {kind}: this is the place of a file of kind {asked}")


def opened(paths: Iterable[tuple[str, str]], say: Say) -> dict[str, xr.Dataset]:
    """Return the datasets in files by name; raises InputError, RefusedError once all damaged ones are set aside."""
    inputs, data = Inputs(say), {}
    for name, path in paths:
        with inputs.reading(path):
            data[name] = open_file(path)
            _check_kind(path, data[name])
    inputs.check()
    return data
