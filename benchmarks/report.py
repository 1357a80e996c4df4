"""A bench as a page of Markdown, and as a table for programs."""

from __future__ import annotations

import math

import xarray as xr

from benchmarks.aims import Reached, reached
from benchmarks.compare import Change, changes, differences
from benchmarks.rows import Row, best_of, rows_of
from stiffdice.report.markdown_table import Table, rendered

_NOTE = (
    "Medians of interleaved rounds; ± half the range between the quartiles. Cycles: of the fastest clock seen. At "
    "least: what the operations take of which each waits for the one before, with the latencies measured; or, marked *,"
    " what all of them would take at the measured FMA peak. Peak: share of that which is used."
)


def duration(seconds: float) -> str:
    """Return a time as a person writes it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return "—" if math.isnan(seconds) else f"{seconds / 1e-12:.3g} ps"


def _number(value: float, form: str = ".3g") -> str:
    return f"{value:{form}}" if math.isfinite(value) else "—"


def _percent(value: float) -> str:
    return _number(100 * value, ".0f" if value >= 0.1 else ".2g") + (" %" if math.isfinite(value) else "")


def page(bench: xr.Dataset, before: xr.Dataset | None, name: str, before_name: str = "") -> str:
    """Return the whole page: the machine, the aims, what was measured, and what changed since another bench."""
    parts = ["\n".join(_head(bench, name)), _section(_aims(bench)), _section(_measured(bench))]
    if before is not None:
        parts.append(_section(_changed(bench, before, before_name)))
    missing = [part for part in str(bench.attrs["missing"]).split("; ") if part]
    if missing:
        parts.append("\n".join(["## Left out", "", *(f"- {part}" for part in missing)]) + "\n")
    return "\n".join(parts)


def _section(table: Table) -> str:
    return f"#{table.markdown}"


def _head(bench: xr.Dataset, name: str) -> list[str]:
    told = bench.attrs
    told_of = {str(part.attrs["version"]) for part in bench.data_vars.values() if "version" in part.attrs}
    engines = sorted(part for part in told_of if part not in str(told["versions"]))
    cycle, peak = best_of(bench, "cycle"), best_of(bench, "fma_peak")
    return [
        f"# Benchmark {name}",
        "",
        *(["A quick one: too short to tell times by.", ""] if told["quick"] else []),
        f"- {told['machine_processor']}, {told['machine_cores']} cores, {told['machine_system']}; load before "
        f"{told['machine_load_1_minute']}",
        f"- {told['versions']}{''.join(f'; {part}' for part in engines)}",
        f"- {told['compiler']} for {told['compiler_target']}, vectors of {told['vector_width']} bits",
        f"- clock {_number(1e-9 / cycle)} GHz, FMA peak of one core {_number(1e-9 / peak)} GFlop/s, "
        f"{_number(cycle / peak)} flops a cycle (two units would do {4 * int(told['vector_width']) // 64})",
        "",
    ]


def _aims(bench: xr.Dataset) -> Table:
    rows = [[aim.what, aim.aimed, _value(aim), _percent(aim.spread), _met(aim)] for aim in reached(bench)]
    return rendered("Aims", ["", "aimed at", "reached", "±", ""], rows)


def _value(aim: Reached) -> str:
    if math.isnan(aim.value):
        return "not measured"
    return duration(aim.value) if aim.unit == "s" else f"{aim.value:,.0f}" if aim.value >= 1000 else f"{aim.value:.3g}"


def _met(aim: Reached) -> str:
    return "" if aim.met is None else "yes" if aim.met else "no"


def _measured(bench: xr.Dataset) -> Table:
    columns = ["", "time", "±", "rate [1/s]", "cycles", "at least", "peak", "what holds it back"]
    return rendered("Measured", columns, [_cells(row) for row in rows_of(bench)], _NOTE)


def _cells(row: Row) -> list[str]:
    counted = row.per not in ("process", "sweep")
    return [
        row.what,
        f"{duration(row.seconds)} / {row.per}",
        _percent(row.spread),
        _number(1 / row.seconds) if counted else "",
        _number(row.cycles) if counted else "",
        _number(row.bound) + ("*" if row.bound_by == "peak" else "") if row.bound_by else "",
        _percent(row.share) if math.isfinite(row.share) else "",
        row.limited_by,
    ]


def _changed(bench: xr.Dataset, before: xr.Dataset, name: str) -> Table:
    found = changes(bench, before)
    rows = [[_what(bench, case), _number(change.ratio), *_verdict(change)] for case, change in found.items()]
    gone = [str(case) for case in before.data_vars if case not in bench]
    rows += [[_what(before, case), "—", "—", "not measured now"] for case in gone]
    other = differences(bench, before)
    why = "Not the same machine or versions, or not a quiet one, so times differ for other reasons, too"
    note = f"{why}: {'; '.join(other)}." if other else ""
    return rendered(f"Since {name}", ["", "new/old", "noise", ""], rows, note)


def _what(bench: xr.Dataset, case: str) -> str:
    return str(bench[case].attrs["what"])


def _verdict(change: Change) -> list[str]:
    bold = "**" if change.verdict in ("slower", "faster") else ""
    return [_percent(change.noise), f"{bold}{change.verdict}{bold}"]


def csv(bench: xr.Dataset) -> str:
    """Return every case in a line, for programs."""
    columns = ["case", "per", "unit", "median", "spread", "samples", "cycles", "cycles_at_least", "bound_by"]
    columns += ["share_of_peak", "limited_by", "version"]
    rows = [
        [
            *(row.name, row.per, row.unit, f"{row.seconds:.6g}", f"{row.spread:.3g}", row.samples),
            *(f"{row.cycles:.6g}", f"{row.bound:.6g}", row.bound_by, f"{row.share:.4g}", row.limited_by, row.version),
        ]
        for row in rows_of(bench)
    ]
    return rendered("", columns, rows).csv
