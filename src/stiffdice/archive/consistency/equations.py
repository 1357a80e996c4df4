"""Equations that the numbers of a file must fulfil: of a run, of shards, of the sweep that they make up, of its edges.

Of a run: counts, energies, rigid body, verdict and ledger, from its scene and its states.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import TURNING, Array, physics_of, start_of
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene import scene as scenes
from stiffdice.scene.scene import Scene
from stiffdice.simulation import energy_budget
from stiffdice.simulation.criteria.judge import ending, judge
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.outcome import SEVERITY, Verdict
from stiffdice.sweep import stability_limits

# Of one rounding, relative to its result: half of it, to be safe by two.
ROUNDING = float(np.finfo(np.float64).eps)
# Below it doubles have no full precision.
TINY = float(np.finfo(np.float64).tiny)

# Of one rotation of the nodes: the rounding of its axis, of sine and cosine, of the matrix, and of three products.
_ROUNDINGS_OF_A_TURN = 32

# How a run ended that ended early: its budget was spent, or what is graver.
_EARLY = SEVERITY[SEVERITY.index(Verdict.UNDECIDED) :]
# How a run may have ended that its measures do not show.
_ENDINGS = (Verdict.UNRESOLVED, Verdict.SANK, Verdict.STALLED, Verdict.UNDECIDED)

# How far a limit in a text of six digits may be from the number that it stands for, relative to it.
_SIX_DIGITS = 5e-6

_DEFECTS = ("spring_defect", "gravity_defect", "kick_defect")
_WORKS = ("damping_work", "drag_work", "friction_work", *_DEFECTS)

# Of the logarithms (base 10) through which a power law goes: a hundred terms of a size up to 20, twice rounded.
_FIT_ROUNDING = 100 * 20 * 2 * ROUNDING

# What a file and the one that it is made from say alike.
_SHARED = (
    *("scene_digest", "model", "scheme", "simulator", "simulator_version", "code_digest", "early_stop"),
    *("members", "runs_digest"),
)


def of_run(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a run's file that cannot be so."""
    scene = scenes.from_mapping(json.loads(dataset.attrs["scene"]))
    steps, done = int(dataset.attrs["steps"]), int(dataset["steps_done"])
    omega_h = linear_theory.omega_h(scene, steps)
    if found := counts(dataset, scene.duration, omega_h, "√(4 S/m) times the step size"):  # what follows stands on them
        return found
    whole = done == steps or int(dataset["verdict"]) in _EARLY
    measures = {part.MEASURE: float(dataset.get(part.MEASURE, np.nan)) for part in CRITERIA.values()}
    found = [
        *_energies(dataset, scene),
        *(_rigid(dataset, scene) if str(dataset.attrs["model"]) in TURNING else []),
        *outside("steps_done", done, whole, "all steps, or a verdict that ends a run early"),
        *_verdicts(dataset, measures),
    ]
    return found + (_ledger(dataset, steps, scene.duration) if "launch_energy" in dataset else [])


def of_shard(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a shard, or in some cells of one, that cannot be so."""
    steps, done = dataset["steps"].values[:, None], dataset["steps_done"].values
    cells = np.rec.fromarrays([dataset[name].values for name in ("contact", "stiffness", "steps")])
    once = np.isin(np.arange(len(cells)), np.unique(cells, return_index=True)[1])
    return [
        *outside("steps", steps[:, 0], once, "a cell that is not there already"),
        *outside("steps_done", done, (done >= 0) & (done <= steps), "a number from 0 to steps"),
        *_verdicts(dataset, {part.MEASURE: dataset[part.MEASURE].values for part in CRITERIA.values()}),
    ]


def _verdicts(dataset: xr.Dataset, measures: Mapping[str, npt.ArrayLike]) -> list[str]:
    """Verdicts and endings are what the measures, all of their shape, give.

    Where it is not known which criteria were asked, a verdict is at least how its run ended. Raises ValueError if a
    file's `criteria` says something else.
    """
    stored = dataset["verdict"].values
    ended = dataset["ending"].values if "ending" in dataset else stored  # not in files of before it was stored
    right = ending(measures, {name: ended == name for name in _ENDINGS})
    found = outside("ending", ended, ended == right, "what the measures say, or graver") if "ending" in dataset else []
    if "criteria" not in dataset.attrs:
        bad = (right != Verdict.PASSED) & (right != Verdict.UNRESOLVED)  # graver than any criterion
        return found + outside("verdict", stored, ~bad | (stored == right), "how the run ended")
    least, most, text = {}, {}, str(dataset.attrs["criteria"])
    for part in text.split("; "):
        told = re.fullmatch(r"(\w+): (\w+) <= (\S+)", part)
        if told is None or told[1] not in CRITERIA or told[2] != CRITERIA[told[1]].MEASURE:
            raise ValueError(f"criteria = {text!r}: allowed are parts such as energy: energy_ratio <= 1.05")
        limit, base = float(told[3]), CRITERIA[told[1]].BASE
        least[told[1]], most[told[1]] = limit * (1 - _SIX_DIGITS) - base, limit * (1 + _SIX_DIGITS) - base
    strict, lenient = judge(least, measures, right), judge(most, measures, right)
    return found + outside("verdict", stored, (stored == strict) | (stored == lenient), "what its measures say")


def counts(dataset: xr.Dataset, duration: float, omega_h: float, why: str) -> list[str]:
    """Every K-th step from the launch on, as far as the run went; the time of a step is step/steps of the duration.

    omega_h [1]: of the run's fastest contact; why: what it is.
    """
    steps, done, step = int(dataset.attrs["steps"]), int(dataset["steps_done"]), dataset["step"].values
    h, right = duration / steps, step / steps * duration
    every = max(1, int(step[1] - step[0])) if len(step) > 1 else 1
    found = [
        *unequal("step_size", dataset.attrs["step_size"], h, 2 * ROUNDING * h, "duration / steps"),
        *unequal("omega_h", dataset.attrs["omega_h"], omega_h, 8 * ROUNDING * omega_h, why),
        *outside("steps_done", done, 0 <= done <= steps, f"a number from 0 to {steps}"),
        *unequal("step", step, np.arange(len(step)) * every, 0.0, f"every {every}th step from the launch on"),
    ]
    if len(step) > 1 and len(step) != done // every + 1:
        found.append(f"step: {len(step)} states; allowed are {done // every + 1}, as steps_done is")
    return found + unequal("time", dataset["time"].values, right, 2 * ROUNDING * right, "step / steps * duration")


def _energies(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """State by state, from velocities and places, to the rounding of their sums.

    A depth d of the 8 nodes is off by up to b, the rounding of six products, five sums and of turning the nodes; so the
    sum of S d²/2 is by up to 4 b √(S ΣS d²/2) + 4 S b², by the inequality of Cauchy and Schwarz.
    """
    physics, model = physics_of(scene), str(dataset.attrs["model"])
    states = np.repeat(start_of(scene, model), dataset.sizes["time"])
    for name in ("position", "velocity", *(("angular_momentum", "node_offset") if model in TURNING else ())):
        states[name] = dataset[name].values
    kinetic, potential, elastic = energies(physics, states)
    blur = 16 * ROUNDING * (np.abs(states["position"]) @ np.abs(scene.ground.normal) + 2 * physics.reach)
    room = 4 * blur * np.sqrt(physics.stiffness * elastic) + 4 * physics.stiffness * blur**2 + 16 * ROUNDING * elastic
    paper = dataset["kinetic_energy"].values + dataset["potential_energy"].values
    return [
        *unequal("kinetic_energy", dataset["kinetic_energy"], kinetic, 8 * ROUNDING * kinetic, "m u²/2 + L²/(2 I)"),
        *unequal("potential_energy", dataset["potential_energy"], potential, 4 * ROUNDING * np.abs(potential), "m g z"),
        *unequal("elastic_energy", dataset["elastic_energy"], elastic, room, "the sum of S d²/2 over the nodes"),
        *unequal("energy_paper", dataset["energy_paper"], paper, 0.0, "kinetic_energy + potential_energy"),
    ]


def _rigid(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """Distances between nodes are the cube's, but for the rounding of every turn since the launch.

    A turn needs a force, so there are not more of them than evaluations, or than steps of free flight.
    """
    return rigid(dataset["node_offset"].values, scene, max(int(dataset["steps_done"]), int(dataset["evaluations"])))


def rigid(offsets: Array, scene: Scene, turns: int) -> list[str]:
    """The same of offsets, shape (time, 8, 3), after at most so many turns."""
    nodes = scene.cube.node_offsets()
    first, second = np.triu_indices(len(nodes), 1)
    right = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    found = np.linalg.norm(offsets[:, first] - offsets[:, second], axis=2)
    length = np.linalg.norm(offsets.sum(axis=1), axis=1)
    room = _ROUNDINGS_OF_A_TURN * ROUNDING * (16 + turns) * physics_of(scene).reach
    return [
        *unequal("distances between nodes of node_offset", found, right, room, "the cube's, which is rigid"),
        *unequal(
            "length of the sum of node_offset", length, np.linalg.norm(nodes.sum(axis=0)), 14 * room, "the cube's"
        ),
    ]


def _ledger(dataset: xr.Dataset, steps: int, duration: float) -> list[str]:
    """What is booked adds up to what the energy changed by; the last step of a bounce may be the first of the next."""
    rows, count = dataset.sizes["bounce"], int(dataset["bounce_count"])
    first, last = dataset["bounce_first_step"].values, dataset["bounce_last_step"].values
    found = [
        *outside("bounce_count", count, rows == min(count, energy_budget.LARGEST), f"{rows}, the rows of the ledger"),
        *outside("bounce_last_step", last, (last > first) & (last <= steps), f"after its first step, up to {steps}"),
        *outside("bounce_first_step", first[1:], first[1:] >= last[:-1], "not before the bounce before has ended"),
    ]
    for name, step in (("bounce_start", first), ("bounce_end", last)):
        right = step / steps * duration
        found += unequal(name, dataset[name].values, right, 2 * ROUNDING * right, "step / steps * duration")
    for prefix in ("", "flight_", "bounce_"):
        parts = [dataset[prefix + name].values for name in _DEFECTS]
        roundings = 2 * ROUNDING * sum(map(np.abs, parts))
        work = f"{prefix}scheme_work"
        found += unequal(work, dataset[work].values, sum(parts), roundings, "its three defects")
    # Twelve roundings of the largest energy of its states in every step, which the compensated sums then keep.
    energy = np.sum([np.abs(dataset[f"{name}_energy"].values) for name in ("kinetic", "potential", "elastic")], axis=0)
    step = 12 * ROUNDING * (energy.max() + np.max(dataset["bounce_largest_elastic_energy"].values, initial=0.0))
    for prefix, before, after, steps_of in (
        ("", "launch_energy", "end_energy", np.asarray(steps)),
        ("bounce_", "bounce_energy_before", "bounce_energy_after", last - first),
    ):
        booked = [dataset[prefix + name].values for name in _WORKS]
        room = steps_of * (step + 2 * ROUNDING * sum(map(np.abs, booked)))
        change = dataset[after].values - dataset[before].values
        found += unequal(f"sum of {prefix}works", sum(booked), change, room, "the change of the energy")
    # A run is its flights and its bounces; a compensated sum rounds once, but for the square of a rounding a step.
    for name in energy_budget.AMOUNTS if count <= energy_budget.LARGEST else ():
        amount, flights, bounces = (dataset[prefix + name].values for prefix in ("", "flight_", "bounce_"))
        size = np.abs(amount) + np.abs(flights) + np.abs(bounces).sum()
        room = (8 + rows + steps * steps * ROUNDING) * ROUNDING * size
        found += unequal(name, amount, flights + bounces.sum(), room, "that of the flights and of all bounces")
    return found


def of_cells(dataset: xr.Dataset) -> list[str]:
    """Return a line for every count in a collected sweep that cannot be so."""
    members, failing, counts = int(dataset.attrs["members"]), dataset["failing"].values, dataset["verdicts"].values
    passed = counts[:, meanings_of(dataset["verdict"]).index("passed")]
    most = members - failing.max(axis=0)
    return [
        *outside("failing", failing, (failing >= 0) & (failing <= members), f"a number from 0 to {members}"),
        *unequal("sum of verdicts", counts.sum(axis=1), members, 0.0, "the members of a cell"),
        *outside("verdicts of passed", passed, passed <= most, "at most the members that fail no criterion"),
    ]


def same_as_collected(dataset: xr.Dataset, again: xr.Dataset) -> list[str]:
    """Return a line for all that a sweep says otherwise than its shards, which it does to the last bit.

    Of the runs no more is asked than of the sweep.
    """
    whole, runs = (json.loads(str(found.attrs.get("config", "{}"))) for found in (dataset, again))
    said = _said_otherwise(dataset.attrs, again.attrs, _SHARED, "its shards")
    return said + _said_otherwise(whole, runs, runs, "its shards", "config.") + _differences(dataset, again, {})


def _said_otherwise(
    said: Mapping[str, Any], right: Mapping[str, Any], names: Iterable[str], whose: str, above: str = ""
) -> list[str]:
    return [
        f"{above}{name} = {said.get(name)}: allowed is {right.get(name)}, that of {whose}"
        for name in names
        if str(said.get(name)) != str(right.get(name))
    ]


def same_as_found(dataset: xr.Dataset, collected: xr.Dataset) -> list[str]:
    """Return a line for every variable of a frontier that is not what its sweep says.

    Counts and edges are equal; power laws to the rounding of their sums, as libraries add in other orders.
    """
    with np.errstate(all="ignore"):
        again = stability_limits.find(collected)
    rooms: dict[str, npt.ArrayLike] = dict.fromkeys(stability_limits.FIT, _FIT_ROUNDING)
    for name in ("factor", "centre"):
        rooms[name] = np.log(10) * _FIT_ROUNDING * np.abs(again[name].values)
    for name in ("limit", "pass_fraction_low", "pass_fraction_high"):
        rooms[name] = 16 * ROUNDING * np.abs(again[name].values) + 4 * ROUNDING
    said = _said_otherwise(dataset.attrs, collected.attrs, (*_SHARED, "config_digest"), "its sweep")
    return said + _differences(dataset, again, rooms)


def _differences(dataset: xr.Dataset, again: xr.Dataset, rooms: Mapping[Any, npt.ArrayLike]) -> list[str]:
    found = []
    for name, right in again.variables.items():
        given = dataset.variables.get(name)
        if given is None:
            found.append(f"{name}: is missing")
        elif given.sizes != right.sizes or given.dims != right.dims:
            found.append(f"{name}{dict(given.sizes)}: allowed is {dict(right.sizes)}")
        elif given.attrs.get("flag_meanings") != right.attrs.get("flag_meanings"):
            found.append(f"{name}: flag_meanings: allowed are {right.attrs.get('flag_meanings')}")
        else:
            found += unequal(str(name), given.values, right.values, rooms.get(name, 0.0), "computed again")
    return found


def unequal(name: str, found: npt.ArrayLike, right: npt.ArrayLike, room: npt.ArrayLike, why: str) -> list[str]:
    """Return a line if values differ from what they must be by more than `room`, all of one shape.

    Infinities and not-a-numbers are to be where the right values have them. why: the equation.
    """
    a, b = np.broadcast_arrays(np.asarray(found, np.float64), np.asarray(right, np.float64))
    same = (a == b) | (np.isnan(a) & np.isnan(b)) | (np.abs(a - b) <= np.asarray(room) + TINY)
    return outside(name, a, same, lambda k: f"{b[k]:.17g}, {why}")


def outside(name: str, found: npt.ArrayLike, fine: npt.ArrayLike, allowed: str | Callable[[Any], str]) -> list[str]:
    """Return a line on the first value that is not allowed, if one is not; fine: which are, of the same shape.

    allowed: in words, or a function that says it at an index.
    """
    given, good = np.broadcast_arrays(found, fine)
    if good.all():
        return []
    wrong = np.argwhere(~good)
    k = tuple(wrong[0].tolist())
    value = f"{given[k]:.17g}" if given.dtype.kind == "f" else str(given[k])
    more = f" ({len(wrong)} of {given.size} values)" if given.size > 1 else ""
    told = allowed if isinstance(allowed, str) else allowed(k)
    return [f"{name}{list(k) if k else ''} = {value}: allowed is {told}{more}"]
