"""Make a bench: gather the cases, take their times, store them, and tell what they are and what changed."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from benchmarks import BENCHMARKS, report
from benchmarks.case import FULL, QUICK, Case, Effort, Missing
from benchmarks.roof import compiler
from benchmarks.rounds import measured
from benchmarks.store import PART, dataset_of, last_in, path_for
from benchmarks.store import QUICK as QUICK_FILE
from stiffdice.errors import OutputError
from stiffdice.experiments.timing import machine
from stiffdice.io.reader import open_file
from stiffdice.io.writer import write_bytes, write_dataset
from stiffdice.scene import validation

# Without it nothing is known of cycles.
ALWAYS = "roof"


class Stored(NamedTuple):
    """A bench that was made: its file, beside which lie the page and a table for programs, and the page."""

    path: Path
    page: str


def gathered(names: Sequence[str], effort: Effort) -> tuple[list[Case], list[Missing]]:
    """Return the cases of the benchmarks of these names, in the registry's order, and what cannot be measured.

    Raises InputError for an unknown name.
    """
    for name in names:
        validation.choice("benchmark", name, BENCHMARKS)
    wanted = [name for name in BENCHMARKS if not names or name in names or name == ALWAYS]
    found = [part for name in wanted for part in importlib.import_module(BENCHMARKS[name]).cases(effort)]
    return [part for part in found if isinstance(part, Case)], [part for part in found if isinstance(part, Missing)]


def bench(
    folder: Path,
    *,
    names: Sequence[str] = (),
    quick: bool = False,
    against: Path | None = None,
    tell: Callable[[str], None] = lambda text: None,
) -> Stored:
    """Measure, store in a folder as HDF5, Markdown and CSV, and compare with the last stored bench there.

    names: of BENCHMARKS; none takes all. quick: too short to tell a time by, but all of it. against: a file of another
    bench to compare with. tell: is told what is done next.
    Raises InputError for an unknown name or a file that cannot be read, OutputError where nothing can be written.
    """
    effort = QUICK if quick else FULL
    kind = QUICK_FILE if quick else PART if names else ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: {error.strerror}") from None
    last = last_in(folder, kind) if against is None else against
    before = None if last is None else open_file(last)
    told = machine() | compiler()  # the load is that from before
    cases, missing = gathered(names, effort)
    samples = measured(cases, effort.rounds, tell)
    found = dataset_of(cases, missing, samples, told | {"quick": int(quick), "jobs": effort.many})
    return _stored(found, path_for(folder, kind), before, "" if last is None else last.stem)


def _stored(found: xr.Dataset, path: Path, before: xr.Dataset | None, before_name: str) -> Stored:
    page = report.page(found, before, path.stem, before_name)
    write_dataset(found, path)
    write_bytes(page.encode(), path.with_suffix(".md"))
    write_bytes(report.csv(found).encode(), path.with_suffix(".csv"))
    return Stored(path, page)
