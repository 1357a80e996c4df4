"""Cold start: from typing a command to its end, with nothing compiled before, and with all of it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from benchmarks.case import Case, Effort
from benchmarks.processes import command, run_all
from stiffdice.errors import StiffdiceError

SCENE = "{ground: {contact: gated}, launch: {angular_momentum: [0.3, 0.5, 0.2]}, duration: 0.1}\n"

# By what is told of it: model and scheme of a first run.
FIRST = {
    "sliding": ("sliding", "symplectic_euler"),
    "tumbling": ("tumbling", "symplectic_euler"),
    "event": ("tumbling", "event"),
}

_IMPORTING = "Python, NumPy, numba and xarray are imported"
_COMPILING = "numba compiles a hundred functions, LLVM some of it, on one core"


def _run(folder: Path, model: str, scheme: str, name: str = "out.h5") -> list[str]:
    scene = folder / "scene.yaml"
    scene.write_text(SCENE, encoding="utf-8")
    chosen = ["--model", model, "--scheme", scheme, "--steps", "100"]
    return command("run", str(scene), *chosen, "-o", str(folder / name))


def _first(model: str, scheme: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        run_all([_run(Path(folder), model, scheme)], Path(folder))


def _later(compiled: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        run_all([_run(Path(folder), *FIRST["tumbling"])], compiled)


@cache
def _compiled() -> tempfile.TemporaryDirectory[str]:
    """Return a folder in which the code of a tumbling run lies compiled."""
    folder = tempfile.TemporaryDirectory()
    _later(Path(folder.name))
    return folder


def _many(count: int) -> None:
    """Start so many first runs at once; raises StiffdiceError if they do not give the same bytes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run_all([_run(folder, *FIRST["tumbling"], f"out{k}.h5") for k in range(count)], folder)
        if len({(folder / f"out{k}.h5").read_bytes() for k in range(count)}) != 1:
            raise StiffdiceError(f"{count} runs started at once on an empty cache do not agree")


def _ready_later() -> Callable[[], None]:
    compiled = Path(_compiled().name)
    return lambda: _later(compiled)


def cases(effort: Effort) -> Iterator[Case]:
    """Yield help, imports, first and later runs, and many at once."""

    def process(name: str, what: str, call: Callable[[], None], times: int, holds: str) -> Case:
        return Case(name, what, "process", 1, lambda: call, times, holds, fresh=True)

    yield process(
        "help",
        "stiffdice --help",
        lambda: run_all([command("--help")]),
        effort.slow,
        "Python starts, argparse is imported",
    )
    for name, module, what in (
        ("simulate", "simulation.run", "the simulator"),
        ("sweep", "sweep.shard", "what a shard's job needs"),
    ):
        words = [sys.executable, "-c", f"import stiffdice.{module}"]
        yield process(
            f"import_{name}",
            f"import of {what}, a process and all",
            lambda words=words: run_all([words]),  # type: ignore[misc]
            effort.slow,
            _IMPORTING if name == "sweep" else "Python, NumPy and numba are imported",
        )
    for name, (model, scheme) in FIRST.items():
        yield process(
            f"first_run_{name}",
            f"first run on a machine, nothing compiled: {model}, {scheme}",
            lambda model=model, scheme=scheme: _first(model, scheme),  # type: ignore[misc]
            effort.fresh,
            _COMPILING,
        )
    yield Case(
        "later_run",
        "later run, compiled before: tumbling, symplectic_euler",
        "process",
        1,
        _ready_later,
        effort.slow,
        f"{_IMPORTING}, compiled code is loaded",
        fresh=True,
    )
    yield process(
        "many_first_runs",
        f"{effort.many} first runs at once on an empty cache and {os.cpu_count()} cores; all give the same bytes",
        lambda: _many(effort.many),
        effort.fresh,
        "each compiles for itself, as none is done before the others start",
    )
