"""An advice, and how a promise was kept, for people and for programs."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from typing import Any

from stiffdice.advice.check import Check
from stiffdice.advice.pilot import SAMPLES
from stiffdice.advice.result import Advice, Option
from stiffdice.errors import printable

_HEADINGS = ("scheme", "steps", "tolerance", "error", "time", "", "")
_LABEL = 10


def as_text(advice: Advice, arguments: Sequence[str]) -> str:
    """Return a page: what to do, what it costs, why, and the alternatives.

    arguments: of `stiffdice run` that name the scene, to show a command; without any none is shown.
    """
    best = advice.best
    lines = [_row("model", advice.model_reason), *(_none_found(advice) if best is None else _advised(advice, best))]
    if advice.cut:
        lines.append(_row("until", f"t = {advice.horizon:g} s of {advice.duration:g} s: {advice.cut}"))
    if advice.growth is not None:
        growth = f"errors grow {_short(advice.growth)} times from the second of {advice.landings} landings to the end"
        lines.append(_row("growth", f"{growth}, {advice.growth_per_landing:.2g} times at each"))
    if best is not None:
        lines.append(_row("evidence", f"{best.basis}: {best.evidence}"))
    lines += [_row("outside", text) for text in advice.outside]
    lines += ["", *_table(advice)]
    if best is not None and arguments:
        lines += ["", "  " + command(advice, arguments)]
    return "\n".join(map(printable, lines))


def _row(label: str, text: str) -> str:
    return f"{label.ljust(_LABEL)}{text}"


def _none_found(advice: Advice) -> list[str]:
    return [
        _row("scheme", f"none found that keeps {advice.asked:.3g} radii until t = {advice.horizon:g} s"),
        _row("floor", f"the path itself is known to {_short(advice.floor)} radii"),
    ]


def _advised(advice: Advice, best: Option) -> list[str]:
    how = f"{best.steps:,} steps"
    if best.omega_h is None:
        tolerance = "" if best.tolerance is None else f"tolerance {best.tolerance:.0e}, "
        how = f"{tolerance}{best.steps:,} output intervals"
    error = (
        f"about {_short(best.error)} radii, {advice.asked:.3g} asked: root mean square distance of the centre from the "
        f"exact path until t = {advice.horizon:g} s"
    )
    return [
        _row("scheme", f"{best.scheme}, {how}"),
        _row("error", error),
        _row("run time", f"about {_time(best.seconds)}, measured on this machine; {_work(best)}"),
        _row("margin", _margin(best, advice.mode)),
    ]


def _work(option: Option) -> str:
    if option.scheme == "exact":
        return f"{_short(option.evaluations)} pieces in closed form"
    if option.evaluations < 1:
        return "no force to evaluate"
    each = option.seconds / option.evaluations
    return f"{_short(option.evaluations)} force evaluations of {_time(each)}"


def _margin(option: Option, mode: str) -> str:
    if option.omega_h is None:
        return f"none needed: {option.scheme} takes steps of its own and has no stability limit"
    if option.margin is None:
        return "none needed: nothing touches"
    step = f"ωh = {option.omega_h:.2g} ({mode})"
    if math.isinf(option.margin):
        return f"none needed: {option.scheme} is stable at any step; {step}"
    if not option.limit:
        return f"none: {step}, stability limit ωh = 0: an error in contact grows at any step"
    limit = f"stability limit ωh = {option.limit:.3g}"
    if option.margin < 1:
        return f"none: {step}, beyond the {limit}"
    return f"{_short(option.margin)} times: {step}, {limit}"


def _table(advice: Advice) -> list[str]:
    """Return a line for each scheme, the time as multiples of the advised one's."""
    base = advice.best.seconds if advice.best is not None else math.nan
    rows: list[Sequence[str]] = [_HEADINGS, *(_cells(option, base) for option in advice.options)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_HEADINGS))]
    return [
        "  " + "  ".join(part.ljust(width) for part, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def _cells(option: Option, base: float) -> Sequence[str]:
    more = "> " if option.error is None else ""
    return (
        option.scheme,
        more + (f"{option.steps:,}" if option.steps < 1e7 else f"{option.steps:.1e}"),
        "" if option.tolerance is None else f"{option.tolerance:.0e}",
        "unknown" if option.error is None else _short(option.error),
        more + _time(option.seconds),
        "" if math.isnan(base) else f"{more}× {_short(option.seconds / base)}",
        option.basis if option.keeps else f"{option.basis}, may not keep it",
    )


def _short(value: float | None) -> str:
    """Return a number to two digits as people write it."""
    if value is None:
        return "unknown"
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if 10 <= rounded < 1e6 else f"{rounded:.2g}"


_UNITS = ((365.25 * 86400, "years"), (86400, "days"), (3600, "h"), (60, "min"), (1, "s"), (1e-3, "ms"), (1e-6, "µs"))


def _time(seconds: float) -> str:
    """Return a time to two digits in the unit that suits it."""
    for unit, name in _UNITS:
        if seconds >= unit:
            return f"{_short(seconds / unit)} {name}"
    return f"{_short(seconds / 1e-9)} ns"


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
    found = f"{_short(check.found)} radii"
    if math.isinf(check.found):
        found = "no number: the runs left the range of doubles"
    verdict = "kept" if check.kept else "NOT KEPT: take a smaller --error, and tell us the scene"
    rows = [
        _row("promised", f"{check.promised:.3g} radii"),
        _row("found", f"{found}, against {check.against}: {verdict}"),
    ]
    return "\n".join(rows)


def as_json(advice: Advice, check: Check | None = None) -> str:
    """Return the same for programs: units in the keys, null for what is unknown or has no number."""
    content: dict[str, Any] = {
        "scene": advice.scene.as_mapping(),
        "asked_radii": advice.asked,
        "duration_s": advice.duration,
        "horizon_s": advice.horizon,
        "cut": advice.cut or None,
        "model": advice.model,
        "model_reason": advice.model_reason,
        "advised": None if advice.best is None else _option(advice.best),
        "options": [_option(option) for option in advice.options],
        "floor_radii": _finite(advice.floor),
        "landings": advice.landings,
        "growth": _finite(advice.growth),
        "growth_per_landing": _finite(advice.growth_per_landing),
        "fastest_contact": advice.mode,
        "samples": SAMPLES,
        "outside": list(advice.outside),
        "check": None,
    }
    if check is not None:
        content["check"] = {
            "promised_radii": check.promised,
            "found_radii": _finite(check.found),
            "kept": check.kept,
            "against": check.against,
        }
    return json.dumps(content, indent=2)


def _option(option: Option) -> dict[str, Any]:
    return {
        "scheme": option.scheme,
        "steps": option.steps,
        "tolerance": option.tolerance,
        "error_radii": _finite(option.error),
        "keeps": option.keeps,
        "basis": option.basis,
        "evidence": option.evidence,
        "evaluations": option.evaluations,
        "run_time_s": option.seconds,
        "omega_h": _finite(option.omega_h),
        "stability_limit": _finite(option.limit),
        "margin": _finite(option.margin),
    }


def _finite(value: float | None) -> float | None:
    """Return a number, or none where it is not one that JSON has."""
    return value if value is not None and math.isfinite(value) else None
