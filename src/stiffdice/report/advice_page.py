"""An advice, and how a promise was kept, for people and for programs."""

from __future__ import annotations

import dataclasses
import json
import math
import shlex
from collections.abc import Sequence
from typing import Any

from stiffdice.advice.pilot import SAMPLES
from stiffdice.advice.result import Advice, Check, Option
from stiffdice.errors import printable
from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import duration, finite, readable
from stiffdice.scene.scene import Scene


def as_text(advice: Advice, arguments: Sequence[str]) -> str:
    """Return a page: what to do, what it costs, why, and the alternatives.

    arguments: of `stiffdice run` that name the scene, to show a command; without any none is shown.
    """
    best = advice.best
    rows = [("model", advice.model_reason)]
    if best is None:
        until = f"none found that keeps {advice.asked:.3g} radii until t = {advice.horizon:g} s"
        rows += [("scheme", until), ("floor", f"the path itself is known to {_short(advice.floor)} radii")]
    else:
        rows += _advised(advice, best)
    if advice.cut:
        rows.append(("until", f"t = {advice.horizon:g} s of {advice.duration:g} s: {advice.cut}"))
    if advice.growth is not None and advice.growth_per_landing is not None:
        growth = f"errors grow {_short(advice.growth)} times from the second of {advice.landings} landings to the end"
        rows.append(("growth", f"{growth}, {_short(advice.growth_per_landing)} times at each"))
    if best is not None:
        rows.append(("evidence", f"{best.basis}: {best.evidence}"))
    rows += [("outside", text) for text in advice.outside]
    base = math.nan if best is None else best.seconds
    headings = ("scheme", "steps", "tolerance", "error", "time", "", "")
    lines = [*_rows(rows), "", *aligned([headings, *(_cells(option, base) for option in advice.options)])]
    if best is not None and arguments:
        lines += ["", "  " + command(advice, arguments)]
    return "\n".join(map(printable, lines))


def _rows(rows: Sequence[tuple[str, str]]) -> list[str]:
    return [f"{label:10}{text}" for label, text in rows]


def _advised(advice: Advice, best: Option) -> list[tuple[str, str]]:
    how, margin = f"{best.steps:,} steps", "none needed: nothing touches"
    if best.omega_h is None:
        tolerance = "" if best.tolerance is None else f"tolerance {best.tolerance:.0e}, "
        how = f"{tolerance}{best.steps:,} output intervals"
        margin = f"none needed: {best.scheme} takes steps of its own and has no stability limit"
    elif best.margin is not None and best.limit is not None:
        limit = "stable at any step" if math.isinf(best.limit) else f"stability limit ωh = {best.limit:.3g}"
        margin = f"{_short(best.margin)} times: ωh = {best.omega_h:.2g} ({advice.mode}), {limit}"
    error = (
        f"about {_short(best.error)} radii, {advice.asked:.3g} asked: root mean square distance of the centre from the "
        f"exact path until t = {advice.horizon:g} s"
    )
    what = "pieces in closed form" if best.scheme == "exact" else "force evaluations"
    run_time = f"about {duration(best.seconds, 2)}, measured on this machine; {_short(best.evaluations)} {what}"
    return [("scheme", f"{best.scheme}, {how}"), ("error", error), ("run time", run_time), ("margin", margin)]


def _cells(option: Option, base: float) -> Sequence[str]:
    """Return a scheme's row, its time as a multiple of the advised one's, too."""
    more = "> " if option.error is None else ""
    return (
        option.scheme,
        more + (f"{option.steps:,}" if option.steps < 1e7 else readable(option.steps, 2)),
        "" if option.tolerance is None else f"{option.tolerance:.0e}",
        _short(option.error),
        more + duration(option.seconds, 2),
        "" if math.isnan(base) else f"{more}× {_short(option.seconds / base)}",
        option.basis if option.keeps else f"{option.basis}, may not keep it",
    )


def _short(value: float | None) -> str:
    return "unknown" if value is None else readable(value, 2)


def command(advice: Advice, arguments: Sequence[str]) -> str:
    """Return the command that does the advised run."""
    best = advice.best
    if best is None:
        return ""
    words = ["stiffdice", "run", *arguments]
    if advice.horizon != advice.duration:
        words += ["--set", f"duration={advice.horizon:g}"]
    words += ["--model", advice.model, "--scheme", best.scheme, "--steps", str(best.steps)]
    if best.tolerance is not None:
        words += ["--tolerance", f"{best.tolerance:.0e}"]
    return shlex.join([*words, "-o", "OUT.h5"])


def check_as_text(check: Check) -> str:
    """Return in two lines what was promised and what was found."""
    lost = "no number: the runs left the range of doubles"
    found = lost if math.isinf(check.found) else f"{_short(check.found)} radii"
    verdict = "kept" if check.kept else "NOT KEPT: take a smaller --error, and tell us the scene"
    rows = [("promised", f"{check.promised:.3g} radii"), ("found", f"{found}, against {check.against}: {verdict}")]
    return "\n".join(_rows(rows))


# What has a unit, or another name, for programs.
_KEYS = {
    "asked": "asked_radii",
    "duration": "duration_s",
    "horizon": "horizon_s",
    "best": "advised",
    "floor": "floor_radii",
    "mode": "fastest_contact",
    "error": "error_radii",
    "seconds": "run_time_s",
    "limit": "stability_limit",
    "promised": "promised_radii",
    "found": "found_radii",
}


def as_json(advice: Advice, check: Check | None = None) -> str:
    """Return the same for programs: units in the keys, null for what is unknown or has no number."""
    content = _plain(advice) | {"cut": advice.cut or None, "samples": SAMPLES, "check": check and _plain(check)}
    return json.dumps(content, indent=2)


def _plain(value: Any) -> Any:
    """Return an advice, or a part of one, as plain data; without runs and paths."""
    if isinstance(value, Scene):
        return value.as_mapping()
    if isinstance(value, (tuple, list)):
        return [_plain(part) for part in value]
    if isinstance(value, (Advice, Option, Check)):
        derived = [name for name, part in vars(type(value)).items() if isinstance(part, property)]
        names = [field.name for field in dataclasses.fields(value) if field.name != "paths"]
        return {_KEYS.get(name, name): _plain(getattr(value, name)) for name in [*names, *derived]}
    return finite(value) if isinstance(value, float) else value
