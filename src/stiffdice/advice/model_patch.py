"""What to change in a MuJoCo model, so that its contacts do what they should: the least that was found to help.

Contacts that are soft or over-damped get a new `solref`. Tried are the model's time step and its half, quarter and
eighth, then softer contacts where they are too stiff for the model's step, then still shorter steps, down to a 64th.
Each is tried on the compiled model, and all landings are measured once more. What helps is then written into the XML,
at the attributes that say it. Where nothing helps all contacts, those that turn or
move otherwise than straight down are left out.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import mujoco

from stiffdice.advice.model_check import (
    DAMPED,
    DEEP,
    GAIN,
    LADDER,
    PHASES,
    SUNK,
    Check,
    Contact,
    check_meetings,
)
from stiffdice.simulation.engines.mjcf.law import Law
from stiffdice.simulation.engines.mjcf.meeting import Touch
from stiffdice.simulation.engines.mjcf.model import Model, Tag

# How often the time step is halved before and after softer contacts are tried, and their ωh.
_CHEAP, _DEAR, _SOFT = 3, (4, 5, 6), 0.1
# The ωh from which a still shorter step may keep a contact from gaining energy.
_STIFF = 0.5
# Depths that are aimed at, in those that are allowed; and how much stiffer is tried at a time.
_AIM, _STIFFER = 0.8, 1.1


@dataclass(frozen=True)
class Change:
    """New numbers of a model: time step [s], None if it stays; `solref` by geom, and by <pair>."""

    timestep: float | None = None
    geoms: dict[int, tuple[float, float]] = field(default_factory=dict)
    pairs: dict[int, tuple[float, float]] = field(default_factory=dict)


class Advice(NamedTuple):
    """A unified diff of a model's file, None if nothing helps or can be written; and contacts left out of it."""

    patch: str | None
    beyond: tuple[Contact, ...]


def advised(check: Check, tell: Callable[[str], None] = lambda _: None) -> Advice:
    """Return what makes all contacts of a model pass; else those of bodies that fall and rise straight."""
    change = change_for(check, tell)
    if change is not None:
        return Advice(patch(check.model, change), ())
    straight = tuple(contact for contact in check.contacts if contact.touch.is_straight)
    others = tuple(contact for contact in check.contacts if not contact.touch.is_straight)
    if others and any(contact.verdicts for contact in straight):
        change = change_for(replace(check, contacts=straight), tell)
    return Advice(None if change is None else patch(check.model, change), others)


def change_for(check: Check, tell: Callable[[str], None] = lambda _: None) -> Change | None:
    """Return what makes all contacts of a model pass; None if nothing tried does."""
    own, tried = float(check.model.compiled.opt.timestep), [Change()]
    for halves, softer in [*((k, False) for k in range(_CHEAP + 1)), (0, True), *((k, False) for k in _DEAR)]:
        timestep = own / 2**halves
        change = _change(check, timestep, softer)
        if halves:
            change = replace(change, timestep=timestep)
        if change in tried or _is_hopeless(check, change, halves):
            continue
        tried.append(change)
        tell(f"trying a time step of {timestep:g} s" + " and softer contacts" * softer)
        if _passes(check, change):
            return change
    return None


def _is_hopeless(check: Check, change: Change, halves: int) -> bool:
    """Return whether the ladder has shown that a shorter time step does not help.

    It does not where energy grows at that step already, and beyond the ladder where its shortest step was no long one.
    """
    if halves > _CHEAP:
        return all(contact.rungs[0].omega_h < _STIFF for contact in check.contacts if contact.verdicts)
    if change.geoms or change.pairs:
        return False
    return any(contact.rungs[_CHEAP - halves].energy > GAIN for contact in check.contacts)


def _passes(check: Check, change: Change) -> bool:
    """Return whether a changed model has no verdict against it; contacts that had one are tried first."""
    contacts = sorted(check.contacts, key=lambda contact: not contact.verdicts)
    everyone = [meeting for contact in contacts for meeting, _ in [(contact.meeting, contact.touch), *contact.alike]]
    return check_meetings(changed(check.model, change), everyone, (LADDER[0], 1.0), stop=True).passed


def _change(check: Check, timestep: float, softer: bool) -> Change:
    """Return new `solref` for all contacts that need it at a time step [s]; softer: also if they are too stiff."""
    change, compiled = Change(), check.model.compiled
    for contact in check.contacts:
        kinds = {verdict.kind for verdict in contact.verdicts}
        if kinds & {"soft", "over_damped"}:
            solref = new_solref(contact, contact.law.at(timestep))
        elif softer and kinds:
            solref = _scaled(contact.law.solref, min(1.0, _SOFT / contact.own.omega_h), 1.0)
        else:
            continue
        for touch in (contact.touch, *(alike for _, alike in contact.alike)):
            change.pairs.update({pair: solref for pair in touch.pairs if pair >= 0})
            change.geoms.update(dict.fromkeys(_ruling(compiled, touch), solref))
    return change


def _ruling(compiled: mujoco.MjModel, touch: Touch) -> list[int]:
    """Return the geoms whose `solref` counts in a contact: both, but where one has the higher priority."""
    rank = compiled.geom_priority
    pairs = [geoms for geoms, pair in zip(touch.geoms, touch.pairs, strict=True) if pair < 0]
    return [geom for geoms in pairs for geom in geoms if rank[geom] == max(rank[list(geoms)])]


def new_solref(contact: Contact, law: Law) -> tuple[float, float]:
    """Return the `solref` of a contact that is neither soft nor over-damped, at the time step of a law."""
    size, scale = contact.meeting.size, 1.0
    damping = min(1.0, 1 / law.damping_ratio(contact.spring))
    while True:
        tried = replace(law, solref=_scaled(contact.law.solref, scale, damping))
        depth = max(tried.bounce(contact.speed, phase * contact.speed * law.timestep)[1] for phase in PHASES)
        firm = depth <= _AIM * DEEP * size and tried.rest_depth() <= _AIM * SUNK * size
        if (firm and tried.damping_ratio(depth) < DAMPED) or scale > 1e6 or not math.isfinite(depth):
            return tried.solref
        scale *= _STIFFER


def _scaled(solref: tuple[float, float], stiffer: float, damping: float) -> tuple[float, float]:
    """Return `solref` with ω and ζ times as large, to three digits."""
    one, two = solref
    if one > 0:
        one, two = one / (stiffer * damping), two * damping
    else:
        one, two = one * stiffer**2, two * stiffer * damping
    return float(f"{one:.3g}"), float(f"{two:.3g}")


def changed(model: Model, change: Change) -> Model:
    """Return a model with new numbers, as compiled."""
    compiled = copy(model.compiled)
    if change.timestep is not None:
        compiled.opt.timestep = change.timestep
    for geom, solref in change.geoms.items():
        compiled.geom_solref[geom] = solref
    for pair, solref in change.pairs.items():
        compiled.pair_solref[pair] = solref
    return replace(model, compiled=compiled)


def patch(model: Model, change: Change) -> str | None:
    """Return a change as a unified diff of the model's file; None if a part of it is in an included file."""
    edits: list[tuple[int, int, str]] = []
    if change.timestep is not None:
        edits.append(_timestep(model, change.timestep))
    for kind, numbers in (("geom", change.geoms), ("pair", change.pairs)):
        for number, solref in numbers.items():
            tag = _tag_of(model, kind, number)
            if tag is None:
                return None
            edits.append(_attribute(model, tag, "solref", f"{solref[0]:g} {solref[1]:g}"))
    raw = model.text.encode()
    for start, end, text in sorted(set(edits), reverse=True):
        raw = raw[:start] + text.encode() + raw[end:]
    return _diff(model.text, raw.decode(), str(model.path))


def _diff(old: str, new: str, path: str) -> str:
    lines = difflib.unified_diff(old.splitlines(True), new.splitlines(True), path, path)
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


def _timestep(model: Model, timestep: float) -> tuple[int, int, str]:
    """Return the edit that sets the time step: in the last <option> that has one, in the first, or in a new one."""
    options = [tag for tag in model.tags if tag.name == "option" and tag.parents == ("mujoco",)]
    for tag in [*(tag for tag in reversed(options) if "timestep" in tag.attributes), *options[:1]]:
        return _attribute(model, tag, "timestep", f"{timestep:g}")
    end = model.tags[0].end
    return end, end, f'\n  <option timestep="{timestep:g}"/>'


def _attribute(model: Model, tag: Tag, name: str, value: str) -> tuple[int, int, str]:
    """Return the edit that sets an attribute of a tag: bytes from, to, and what is there then."""
    raw = model.text.encode()[tag.start : tag.end]
    match = re.search(rb"""\s%s\s*=\s*(?:"([^"]*)"|'([^']*)')""" % name.encode(), raw)
    if match:
        start, end = match.span(1 if match[1] is not None else 2)
        return tag.start + start, tag.start + end, value
    place = tag.start + len(raw.removesuffix(b">").removesuffix(b"/").rstrip())
    return place, place, f' {name}="{value}"'


def _tag_of(model: Model, kind: str, number: int) -> Tag | None:
    """Return the tag of a geom or <pair> in the model's own file; None if it is not there for sure."""
    spec = mujoco.MjSpec.from_file(str(model.path))
    parts = spec.geoms if kind == "geom" else spec.pairs
    name, line = parts[number].name, parts[number].info
    tags = [tag for tag in model.tags if tag.name == kind and "default" not in tag.parents]
    if name:
        return next((tag for tag in tags if tag.attributes.get("name") == name), None)
    if any(tag.name in ("include", "attach") for tag in model.tags):
        return None  # lines are of other files, too
    alike = [k for k, part in enumerate(parts) if part.info == line and not part.name]
    there = [tag for tag in tags if f"line {_line(model, tag)}" == line and "name" not in tag.attributes]
    return there[min(alike.index(number), len(there) - 1)] if there else None


def _line(model: Model, tag: Tag) -> int:
    return model.text.encode().count(b"\n", 0, tag.start) + 1
