"""What counts of faces say of a die, for people and for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffdice.errors import printable
from stiffdice.experiments.dice import infer
from stiffdice.experiments.dice.axes import FACES, PAIRS, Array
from stiffdice.experiments.dice.counts import chi_square
from stiffdice.experiments.dice.infer import LEVEL, Posterior
from stiffdice.experiments.dice.response_table import Table
from stiffdice.experiments.dice.rolls import Rolls
from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import readable

# As people name axes: by the faces at their ends, the one with pip 1 first.
_ORDER = sorted(range(len(PAIRS)), key=PAIRS.__getitem__)


def as_text(given: Rolls, found: Posterior, tables: Sequence[Table], origin: str) -> str:
    """Return a page: the rolls, whether a fair die gives them, axes and centre of mass, and where χ and ψ are from.

    origin: of the response, as a person calls it.
    """
    square, chance = chi_square(np.array(given.counts))
    axis, gap = infer.longest(given)
    rows = [("rolls", f"{given.total:,}: {', '.join(map(str, given.counts))} of the faces 1 to 6")]
    if given.source:
        rows.append(("source", given.source))
    if given.note:
        rows.append(("note", given.note))
    rows += [
        (
            "fair?",
            f"χ² = {square:.3g}, 5 degrees of freedom: a fair die has more with a chance of {readable(chance, 2)}",
        ),
        ("longest", f"the axis {PAIRS[axis]}, by {gap:.1f} standard errors of the counts, whatever the coefficients"),
    ]
    names = [table.throw for table in tables]
    several = names if len(names) > 1 else []
    cells = [("axis", "length over the others'", *(f"if {name}" for name in several), "centre of mass, over the side")]
    for k in _ORDER:
        length, offset = infer.interval(found.length[:, k]), infer.interval(found.offset[:, k])
        towards = f"towards {FACES[k][offset[0] < 0]}"
        if offset[0] < 0:
            offset = (-offset[0], -offset[2], -offset[1])
        each = (np.median(found.length[found.throw == way, k]) for way in range(len(several)))
        parts = (_signed(100 * value) for value in each)
        cells.append((PAIRS[k], _percent(length, signed=True), *parts, f"{_percent(offset)} {towards}"))
    grounds = f"{_range(tables, 'restitution', 'e')}, {_range(tables, 'friction', 'μ')}"
    end = [
        ("response", f"{origin}; thrown: {', '.join(names)}; {grounds}"),
        ("", f"χ = {_number(infer.interval(found.chi))}, ψ = {_number(infer.interval(found.psi))} over all of these"),
    ]
    if found.beyond > 0.005:
        told = f"{found.beyond:.0%} of the posterior is beyond the shapes that were thrown (±{tables[0].stretch:.0%})"
        end.append(("beware", told))
    note = f"median and {LEVEL:.0%} interval; length: over the geometric mean of the two other axes, less one"
    lines = [*_rows(rows), "", *aligned(cells), f"  {note}", "", *_rows(end)]
    return "\n".join(map(printable, lines))


def _rows(rows: Sequence[tuple[str, str]]) -> list[str]:
    return [f"{label:10}{text}" for label, text in rows]


def _percent(found: tuple[float, float, float], *, signed: bool = False) -> str:
    middle, low, high = (_signed(100 * value) if signed else f"{100 * value:.2f}" for value in found)
    return f"{middle} % ({low} to {high})".replace("-", "−")


def _signed(value: float) -> str:
    return f"{value:+.2f}".replace("-", "−")


def _number(found: tuple[float, float, float]) -> str:
    middle, low, high = (f"{value:.2g}".replace("-", "−") for value in found)
    return f"{middle} ({low} to {high})"


def _range(tables: Sequence[Table], name: str, letter: str) -> str:
    ends = [getattr(table, name)[k] for table in tables for k in (0, -1)]
    return f"{letter} = {min(ends):g} to {max(ends):g}"


def as_json(given: Rolls, found: Posterior, tables: Sequence[Table], origin: str) -> str:
    """Return the same for programs: axes by their faces, parts of one instead of percent."""
    square, chance = chi_square(np.array(given.counts))
    axis, gap = infer.longest(given)
    axes: dict[str, Any] = {
        PAIRS[k]: {
            "length_over_others_less_one": _interval(found.length[:, k]),
            "offset_over_side": _interval(found.offset[:, k]) | {"towards_face": FACES[k][0]},
        }
        for k in _ORDER
    }
    content = {
        "counts": list(given.counts),
        "source": given.source,
        "chi_square": square,
        "chance_if_fair": chance,
        "longest_axis": PAIRS[axis],
        "longest_by_standard_errors": gap,
        "axes": axes,
        "response": {
            "origin": origin,
            "throws": [table.throw for table in tables],
            "chi": _interval(found.chi),
            "psi": _interval(found.psi),
        },
        "beyond_shapes_thrown": found.beyond,
    }
    return json.dumps(content, indent=2)


def _interval(samples: Array) -> dict[str, float]:
    middle, low, high = infer.interval(samples)
    return {"median": middle, "low": low, "high": high, "standard_deviation": float(np.std(samples))}
