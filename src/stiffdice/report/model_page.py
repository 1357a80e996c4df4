"""What was found of a MuJoCo model, for people and for programs."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from stiffdice.advice.model_check import Check, Contact, Rung, Span
from stiffdice.errors import printable
from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import finite

if TYPE_CHECKING:
    from stiffdice.advice.model_patch import Advice


def as_text(check: Check, advice: Advice | None = None) -> str:
    """Return a page: every contact, what is wrong with it, and what to change. advice: None where nothing is wrong."""
    blocks = [_head(check), *(_contact(contact) for contact in check.contacts)]
    if check.missed:
        blocks.append(["never touch: " + "; ".join(f"{one} on {other}" for one, other in check.missed)])
    if check.left:
        blocks.append([f"{check.left} more pairs of bodies are not measured"])
    lines = [printable(line) for block in blocks for line in [*block, ""]]
    if advice is not None and advice.patch:
        but = ", ".join(" on ".join(contact.meeting.names) for contact in advice.beyond)
        told = f"all but {but} passes" if but else "all of this passes"
        lines += [f"what to change, so that {told} (patch -p0):", "", advice.patch.rstrip("\n")]
    elif advice is not None:
        lines.append("what to change: nothing that was tried makes all of this pass, and can be written into this file")
    return "\n".join(lines).rstrip("\n")


def _head(check: Check) -> list[str]:
    option = check.model.compiled.opt
    names = ("euler", "RK4", "implicit", "implicitfast")
    scheme = names[option.integrator] if option.integrator < len(names) else "another integrator"
    cone = ("pyramidal", "elliptic")[option.cone]
    bad = sum(bool(contact.verdicts) for contact in check.contacts)
    told = f"{bad} of {len(check.contacts)} contacts with something wrong" if bad else "nothing wrong"
    return [f"{check.model.path}: {told}; timestep {option.timestep:g} s, {scheme}, {cone} cones"]


def _contact(contact: Contact) -> list[str]:
    law, own, size = contact.law, contact.own, contact.meeting.size
    spring = contact.spring
    solref, solimp = (" ".join(f"{number:.6g}" for number in numbers) for numbers in (law.solref, law.solimp))
    rows = [
        ("contact", f"solref {solref}, solimp {solimp}; contacts: {contact.touch.contacts}"),
        ("spring", f"{law.stiffness(spring):.3g} N/m, {law.damping(spring):.3g} N s/m on {law.mass:.3g} kg"),
        ("", f"ω = {law.frequency(spring):.3g} rad/s, ζ = {law.damping_ratio(spring):.3g}, ωh = {own.omega_h:.3g}"),
        ("e", f"predicted {_span(own.predicted)}, measured {_span(own.measured)}"),
        ("", f"{law.restitution(spring):.3f} of this spring without gravity, in short steps"),
        ("depth", f"predicted {_parts(own.predicted_depth, size)}, measured {_parts(own.depth, size)}"),
        ("", f"at rest {_parts(law.rest_depth(), size)}"),
    ]
    if law.is_slowed:
        rows.append(("refsafe", f"timeconst {law.solref[0]:.3g} s counts as {law.timeconst:.3g} s, two time steps"))
    if contact.touch.why:
        rows.append(("not linear", "; ".join(contact.touch.why) + ": what is measured counts"))
    rows += [("verdict", verdict.sentence) for verdict in contact.verdicts] or [("verdict", "fine")]
    one, other = contact.meeting.names
    head = f"{one} on {other}: {size:.3g} m, dropped from its size, {contact.speed:.3g} m/s"
    alike = [f"  and alike: {'; '.join(' on '.join(one.names) for one, _ in contact.alike)}"] if contact.alike else []
    headings = ("timestep", "ωh", "e predicted", "e measured", "energy", "depth")
    table = [headings, *(_cells(rung, contact) for rung in contact.rungs)]
    return [head, *alike, *(f"  {label:11}{text}" for label, text in rows), "", *aligned(table)]


def _cells(rung: Rung, contact: Contact) -> tuple[str, ...]:
    own = " *" if rung is contact.own else ""
    energy = "blew up" if math.isinf(rung.energy) else f"× {rung.energy:.3g}"
    spans = (_span(rung.predicted), _span(rung.measured))
    return f"{rung.timestep:g} s{own}", f"{rung.omega_h:.2g}", *spans, energy, _parts(rung.depth, contact.meeting.size)


def _span(span: Span) -> str:
    return f"{_short(span.mean)} ({_short(span.low)} to {_short(span.high)})"


def _short(value: float) -> str:
    return f"{value:.3f}" if value < 10 else f"{value:.2g}"


def _parts(depth: float, size: float) -> str:
    return f"{depth:.2g} m ({depth / size:.2%})" if math.isfinite(depth) else "without end"


def as_json(check: Check, advice: Advice | None = None) -> str:
    """Return the same for programs: units in the keys, null for what has no number."""
    option = check.model.compiled.opt
    content = {
        "model": str(check.model.path),
        "timestep_s": float(option.timestep),
        "passed": check.passed,
        "contacts": [_plain(contact) for contact in check.contacts],
        "never_touch": check.missed,
        "not_measured": check.left,
        "patch": advice and advice.patch,
        "not_patched": [contact.meeting.names for contact in advice.beyond] if advice else [],
    }
    return json.dumps(content, indent=2)


def _plain(contact: Contact) -> dict[str, Any]:
    law, spring = contact.law, contact.spring
    numbers = {
        "size_m": contact.meeting.size,
        "speed_m_per_s": contact.speed,
        "effective_mass_kg": law.mass,
        "stiffness_n_per_m": law.stiffness(spring),
        "damping_n_s_per_m": law.damping(spring),
        "omega_rad_per_s": law.frequency(spring),
        "damping_ratio": law.damping_ratio(spring),
        "restitution_in_short_steps": law.restitution(spring),
        "rest_depth_m": law.rest_depth(),
        "restitution_difference": contact.difference,
    }
    return {
        "bodies": contact.meeting.names,
        "alike": [meeting.names for meeting, _ in contact.alike],
        "with": "floor" if contact.meeting.is_floor else "body",
        "solref": law.solref,
        "solimp": law.solimp,
        "contacts": contact.touch.contacts,
        "not_linear": contact.touch.why,
        "straight": contact.touch.is_straight,
        **{name: finite(value) for name, value in numbers.items()},
        "verdicts": [verdict._asdict() for verdict in contact.verdicts],
        "ladder": [_rung(rung) for rung in contact.rungs],
    }


def _rung(rung: Rung) -> dict[str, Any]:
    return {
        "timestep_s": rung.timestep,
        "omega_h": rung.omega_h,
        "predicted": {name: finite(value) for name, value in rung.predicted._asdict().items()},
        "measured": {name: finite(value) for name, value in rung.measured._asdict().items()},
        "energy_ratio": finite(rung.energy),
        "predicted_depth_m": finite(rung.predicted_depth),
        "depth_m": finite(rung.depth),
    }
