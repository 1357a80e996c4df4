"""What `stiffdice ground` tells, as text and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from stiffdice.advice import engine_ladder
from stiffdice.advice.contact_design import Contact
from stiffdice.advice.engine_ladder import KEPT, Ladder
from stiffdice.advice.engine_parameters import Parameters
from stiffdice.advice.materials import MATERIALS
from stiffdice.advice.step_limits import LEAST, MOST, PHASES, Limits
from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import duration, finite, readable

_HEADS = {"energy": "energy 5 %", "restitution_5": "e 5 %", "restitution_1": "e 1 %", "path": "path 1 %"}


def contact_lines(contact: Contact) -> list[str]:
    """Return what a contact is, and the keys of a scene's ground that has it."""
    ground, cube, e, weighed = (
        contact.scene.ground,
        contact.scene.cube,
        contact.restitution,
        contact.restitution_with_weight,
    )
    block = ", ".join(f"{key}: {value}" for key, value in contact.ground().items())
    fell = "" if weighed > 0 else ": the cube stays on the ground"
    lines = [
        f"ground    S = {ground.stiffness:.6g} kg/s², D = {ground.damping:.6g} kg/s per node, {contact.law}; "
        f"ζ = {contact.zeta:.4g}, ω = {contact.omega:.6g} rad/s",
        f"landing   flat, at {contact.speed:.4g} m/s: e = {e:.4g} without weight, {weighed:.4g} with it{fell}",
        f"contact   {duration(contact.contact_time, 4)}; {_length(contact.depth)} deep, "
        f"{_length(contact.depth_at_rest)} at rest; at most {contact.peak_force:.4g} N",
    ]
    if contact.depth >= cube.side:
        lines.append(
            "warning   deeper than the cube is high: its upper nodes come to the ground, and all of this is off"
        )
    elif contact.depth > 0.1 * cube.side:
        lines.append(f"warning   {contact.depth / cube.side:.0%} of the side deep: a soft ground for such a landing")
    return [*lines, "", f"ground: {{{block}}}"]


def _length(value: float) -> str:
    size, unit = next(((s, u) for s, u in ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")) if value >= s), (1e-9, "nm"))
    return f"{readable(value / size, 4)} {unit}"


def limit_lines(limits: Mapping[str, Limits], contact: Contact) -> list[str]:
    """Return the longest steps by scheme, as a table."""
    rows = [["scheme", "linear", *_HEADS.values()]]
    for scheme, found in limits.items():
        rows.append([scheme, _step(found.linear), *(_step(found.kept[name]) for name in _HEADS)])
    rows.append(["event, exact", *["none"] * (len(_HEADS) + 1)])
    return [
        f"longest steps (a contact takes {duration(contact.contact_time, 3)})",
        *aligned(rows),
        "linear: theory, of a cube that rocks on its face, too. The others are measured, by flat bounces without",
        f"weight at {PHASES} phases, ωh from {LEAST:g} to {MOST:g}: energy grows by so much of what comes in, e is",
        "off by so much of it, the path by so much of the radius when the cube lands again. none: no limit;",
        "0: no step tried is short enough.",
    ]


def _step(seconds: float) -> str:
    return "none" if math.isinf(seconds) else "0" if seconds == 0 else duration(seconds, 2)


def ladder_lines(ladder: Ladder, contact: Contact) -> list[str]:
    """Return what an engine makes of a contact by timestep, and the longest that keep it."""
    columns = ladder.columns
    names = [f"{column.way}, {column.kind}" for column in columns]
    rows = [["timestep", "ωh", *names]]
    for rung in ladder.rungs:
        told = (_spread(rung.found.get(column)) for column in columns)
        rows.append([duration(rung.timestep), f"{rung.omega_h:.3g}", *told])
    kept = [["longest timestep", "e 5 %", "e 1 %", "energy 5 %"]]
    for name, column in zip(names, columns, strict=True):
        found = (ladder.longest(column, criterion, contact.restitution) for criterion in KEPT)
        kept.append([name, *("none" if h is None else duration(h) for h in found)])
    head = f"{ladder.version}: e of a flat bounce, {contact.restitution:.4g} asked, at {engine_ladder.PHASES} phases"
    return [
        head if ladder.installed else f"{ladder.engine} is not measured: {ladder.version}",
        *aligned(rows),
        f"predicted: {engine_ladder.LIKE_WORDS[ladder.engine]}",
        *(["–: D is less than S h"] if any(column.way == engine_ladder.LESS for column in columns) else []),
        "",
        *aligned(kept),
    ]


def _spread(found: tuple[float, float] | None) -> str:
    return "–" if found is None else f"{found[0]:.4f} to {found[1]:.4f}"


def paste_lines(engine: str, told: Parameters, h: float) -> list[str]:
    """Return what to paste into an engine."""
    rows = [[name, str(value)] for name, value in told.values.items()]
    notes = [f"- {note}" for note in told.notes]
    return [f"{engine}, for a timestep of {duration(h)}", *aligned(rows), *notes, "", told.paste]


def material_lines() -> list[str]:
    """Return the table of materials."""
    rows = [["name", "e", "", "speed [m/s]", "what", "source"]]
    rows += [[name, f"{m.restitution:g}", m.spread, m.speeds, m.pair, m.source] for name, m in MATERIALS.items()]
    return aligned(rows)


def limits_as_data(limits: Mapping[str, Limits]) -> dict[str, Any]:
    """Return the longest steps [s] by scheme and criterion, as plain data; none where there is no limit."""
    return {
        scheme: {"linear": finite(found.linear), **{name: finite(h) for name, h in found.kept.items()}}
        for scheme, found in limits.items()
    }


def ladder_as_data(ladder: Ladder, contact: Contact) -> dict[str, Any]:
    """Return a ladder as plain data: of each way and kind, restitutions by timestep and the longest timesteps [s]."""
    columns = []
    for column in ladder.columns:
        found = [
            {"timestep_s": rung.timestep, "omega_h": rung.omega_h, "restitution": list(rung.found[column])}
            for rung in ladder.rungs
            if column in rung.found
        ]
        longest = {name: ladder.longest(column, name, contact.restitution) for name in KEPT}
        columns.append({**column._asdict(), "bounces": found, "longest_timestep_s": longest})
    return {"name": ladder.engine, "version": ladder.version, "installed": ladder.installed, "columns": columns}
