"""What was measured as a page of Markdown, and as a table for programs; the page is in docs/explanation/scale.md."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

from benchmarks.scale.extension import Extension
from benchmarks.scale.measures import Grown
from benchmarks.scale.workers import Workers
from stiffdice.report.markdown_table import Table, rendered


class Quantity(NamedTuple):
    """A row: its name for programs, in words, its unit, how it follows from one size's numbers, what is aimed at."""

    name: str
    words: str
    unit: str
    of: Callable[[Grown], float]
    goal: str = ""


def _core_seconds(grown: Grown) -> float:
    return grown.wall * grown.cores


QUANTITIES = [
    Quantity("runs", "runs", "1", lambda grown: grown.runs),
    Quantity("cells", "cells", "1", lambda grown: grown.cells),
    Quantity("wall", "wall time", "s", lambda grown: grown.wall),
    Quantity("sessions", "calls of the workflow that it took", "1", lambda grown: grown.sessions),
    Quantity("jobs", "jobs", "1", lambda grown: grown.jobs),
    Quantity("shards", "of them shards", "1", lambda grown: grown.shards),
    Quantity(
        "simulation",
        "core-seconds in simulation",
        "%",
        lambda grown: 100 * grown.simulation / _core_seconds(grown),
        "≥ 80",
    ),
    Quantity(
        "start_up",
        "in start-up of jobs, files, drawing",
        "%",
        lambda grown: 100 * (grown.in_jobs - grown.simulation) / _core_seconds(grown),
    ),
    Quantity(
        "snakemake",
        "in Snakemake, or without a job",
        "%",
        lambda grown: 100 * (1 - grown.in_jobs / _core_seconds(grown)),
    ),
    Quantity("dag", "dry run: wall time", "s", lambda grown: grown.dag.wall, "< 10"),
    Quantity("dag_cpu", "dry run: processor time", "s", lambda grown: grown.dag.cpu),
    Quantity("dag_peak", "dry run: peak memory", "MB", lambda grown: grown.dag.peak / 1e6, "< 500"),
    Quantity("longest", "longest shard's job", "s", lambda grown: grown.longest),
    Quantity("balance", "longest over median, of a sweep's", "1", lambda grown: grown.balance, "≤ 2"),
    Quantity("shard_peak", "peak memory of a shard's job", "MB", lambda grown: grown.shard_peak / 1e6),
    Quantity("collect_peak", "peak memory of collecting", "MB", lambda grown: grown.collect_peak / 1e6),
    Quantity("collecting", "collecting", "s", lambda grown: grown.collecting),
    Quantity("collecting_cell", "collecting, a cell", "ms", lambda grown: 1e3 * grown.collecting / grown.cells),
    Quantity("files", "files of results", "1", lambda grown: grown.files),
    Quantity("shard_bytes", "shards, a run", "B", lambda grown: grown.shard_bytes / grown.runs),
    Quantity("bytes", "all results, a run", "B", lambda grown: grown.bytes / grown.runs),
    Quantity("sweep_bytes", "`sweep.h5`, of all sweeps", "MB", lambda grown: grown.sweep_bytes / 1e6),
    Quantity("sweep_bytes_cell", "`sweep.h5`, a cell", "B", lambda grown: grown.sweep_bytes / grown.cells),
    Quantity("verify", "`stiffdice verify`: wall time", "s", lambda grown: grown.verify.wall),
    Quantity("verify_peak", "`stiffdice verify`: peak memory", "MB", lambda grown: grown.verify.peak / 1e6),
]


def page(
    grown: Sequence[Grown], workers: Workers | None, extension: Extension | None, machine: Mapping[str, Any]
) -> Table:
    """Return the page, and the same numbers as CSV: a line for each quantity of each size, not rounded."""
    parts = [_growth(grown), _told(machine)]
    if workers is not None:
        parts.append(_workers(workers))
    if extension is not None:
        parts.append(_extension(extension))
    return Table("\n".join(parts), _csv(grown, workers, extension))


def _growth(grown: Sequence[Grown]) -> str:
    rows = []
    for quantity in QUANTITIES:
        values = [quantity.of(size) for size in grown]
        unit = "" if quantity.unit == "1" else f" [{quantity.unit}]"
        rows.append([f"{quantity.words}{unit}", *map(_number, values), quantity.goal])
    heads = ["", *(f"{size.runs:.0e}".replace("e+0", "e").replace("e+", "e") for size in grown), "aimed at"]
    return rendered("Growth", heads, rows).markdown.replace("# Growth\n", "### From few runs to many\n")


def _told(machine: Mapping[str, Any]) -> str:
    return (
        f"On {machine['machine_cores']} cores of {machine['machine_processor']}, load "
        f"{machine['machine_load_1_minute']} before, {machine['versions']}; {str(machine['measured_at'])[:10]}.\n"
    )


def _workers(workers: Workers) -> str:
    rows = [
        ["wall time, median [s]", *map(_number, (median(workers.one), median(workers.two)))],
        ["wall time, each [s]", *(", ".join(map(_number, times)) for times in (workers.one, workers.two))],
        ["in simulation, median [s]", *map(_number, map(median, (workers.one_simulation, workers.two_simulation)))],
    ]
    note = (
        f"Gain: {workers.gain:.2f} (aimed at: ≥ 1.8). The same simulation takes {workers.slower:.2f} times as long "
        f"beside another; the workflow alone would leave {workers.gain * workers.slower:.2f}."
    )
    title = f"Two workers against one, {workers.runs:,} runs"
    return f"##{rendered(title, ['', 'one', 'two'], rows, note).markdown}"


def _extension(extension: Extension) -> str:
    steps = extension.grid, extension.extended, extension.at_once
    rows = [
        ["runs in the grid", *(f"{step.runs:,}" for step in steps)],
        ["shards made", *(str(step.shards) for step in steps)],
        ["runs simulated", *(f"{step.simulated:,}" for step in steps)],
        ["in simulation [s]", *(_number(step.simulation) for step in steps)],
        ["wall time [s]", *(_number(step.wall) for step in steps)],
    ]
    grid, extended, at_once = steps
    kept, worth = (1 - extended.simulation / at_once.simulation, grid.simulation / at_once.simulation)
    note = (
        f"{grid.runs:,} of {extended.runs:,} runs were there, worth {worth:.0%} of the simulation that the extended "
        f"grid takes in one go; extending it saved {kept:.0%}. The runs of the last two are "
        f"{'the same, digest by digest' if extension.same else 'NOT the same'}."
    )
    heads = ["", "grid", "extended", "in one go"]
    return f"##{rendered('A grid that is extended', heads, rows, note).markdown}"


def _number(value: float) -> str:
    """Return a number with three digits, or all before the point; a dash for none."""
    if not math.isfinite(value):
        return "—"
    digits = 0 if value == 0 else max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{digits}f}" if value != round(value) else f"{value:,.0f}"


def _csv(grown: Sequence[Grown], workers: Workers | None, extension: Extension | None) -> str:
    rows: list[list[object]] = [
        [size.runs, quantity.name, quantity.unit, f"{quantity.of(size):.6g}"]
        for size in grown
        for quantity in QUANTITIES
    ]
    if workers is not None:
        numbers = {"gain": workers.gain, "simulation_slower": workers.slower}
        rows += [[workers.runs, f"workers_{name}", "1", f"{value:.6g}"] for name, value in numbers.items()]
        for name in ("one", "two", "one_simulation", "two_simulation"):
            rows += [[workers.runs, f"workers_{name}", "s", f"{value:.6g}"] for value in getattr(workers, name)]
    if extension is not None:
        for name in ("grid", "extended", "at_once"):
            step = getattr(extension, name)
            numbers = {"wall": step.wall, "simulation": step.simulation}
            rows += [[step.runs, f"extension_{name}_{key}", "s", f"{value:.6g}"] for key, value in numbers.items()]
            rows.append([step.runs, f"extension_{name}_shards", "1", step.shards])
            rows.append([step.runs, f"extension_{name}_simulated", "1", step.simulated])
        rows.append([extension.extended.runs, "extension_same", "1", int(extension.same)])
    return rendered("", ["runs", "quantity", "unit", "value"], rows).csv
