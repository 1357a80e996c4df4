"""One run: its times, energies, rigid body, free flights, launch, verdict and ledger, from its scene and its states."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice import scene as scenes
from stiffdice import schemes, simulators, theory
from stiffdice.criteria import CRITERIA
from stiffdice.sanity import books, verdicts
from stiffdice.sanity.bounds import ROUNDING, outside, unequal
from stiffdice.scene import Scene
from stiffdice.state import TURNING, Array, Physics, physics_of, start_of
from stiffdice.verdict import Verdict


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a run's file that cannot be so."""
    scene, found = scene_of(dataset)
    run = _Run(dataset, scene)
    found += _attributes(run)
    found += _times(run)
    if found:  # what follows stands on them
        return found
    found += _finite(run) or [
        *_launch(run),
        *_energies(run),
        *_rigid(run),
        *_moved_as_it_says(run),
        *_flights(run),
        *_judged(run),
        *_airborne_energy(run),
    ]
    if "launch_energy" in dataset:
        found += books.problems(dataset, run.steps, scene.duration, _highest(run))
        found += _booked_ends(run)
    return found


def scene_of(dataset: xr.Dataset) -> tuple[Scene, list[str]]:
    """Return the scene in a file, and a line if it is not the one of its digest; raises InputError if it is none."""
    scene = scenes.from_mapping(json.loads(dataset.attrs["scene"]))
    told = dataset.attrs["scene_digest"]
    return scene, [] if told == scene.digest else [f"scene_digest = {told}: allowed is {scene.digest}, its scene's"]


@dataclass
class _Run:
    """What a run's file holds, as numbers."""

    dataset: xr.Dataset
    scene: Scene

    @property
    def model(self) -> str:
        return str(self.dataset.attrs["model"])

    @property
    def lag(self) -> float | None:
        """By how many steps the velocity is behind the place; None of an engine, which need not be installed."""
        ours = self.dataset.attrs.get("simulator", simulators.OURS) == simulators.OURS
        return schemes.LAGS[str(self.dataset.attrs["scheme"])] if ours else None

    @property
    def steps(self) -> int:
        return int(self.dataset.attrs["steps"])

    @property
    def h(self) -> float:
        """The step size [s]."""
        return self.scene.duration / self.steps

    @cached_property
    def physics(self) -> Physics:
        return physics_of(self.scene)

    @cached_property
    def launch(self) -> np.void:
        """The state at the launch, a STATE record."""
        return start_of(self.scene, self.model)[0]

    def _values(self, name: str) -> Array:
        return np.asarray(self.dataset[name].values, np.float64)

    @cached_property
    def position(self) -> Array:
        return self._values("position")

    @cached_property
    def velocity(self) -> Array:
        return self._values("velocity")

    @cached_property
    def momentum(self) -> Array:
        """The angular momentum, shape (time, axis); none where the model does not turn the cube."""
        return self._values("angular_momentum") if self.model in TURNING else np.zeros_like(self.position)

    @cached_property
    def offsets(self) -> Array:
        """The nodes relative to the centre, shape (time or 1, node, axis)."""
        return self._values("node_offset") if self.model in TURNING else self.launch["node_offset"][None]

    @cached_property
    def step(self) -> npt.NDArray[np.int64]:
        return np.asarray(self.dataset["step"].values)

    @property
    def every(self) -> int:
        """How many steps are between two states."""
        return int(self.step[1] - self.step[0]) if len(self.step) > 1 else 0

    @property
    def steps_done(self) -> int:
        return int(self.dataset["steps_done"])

    @cached_property
    def normal(self) -> Array:
        return np.array(self.scene.ground.normal)

    @cached_property
    def depths(self) -> Array:
        """How deep each node is in the ground [m], shape (time, node); summed as the simulator sums."""
        n, x, r = self.normal, self.position, self.offsets
        height = n[0] * x[:, 0] + n[1] * x[:, 1] + n[2] * x[:, 2]
        return -(height[:, None] + n[0] * r[..., 0] + n[1] * r[..., 1] + n[2] * r[..., 2])

    @cached_property
    def blur(self) -> Array:
        """How much of a depth may be rounding [m], shape (time,): of six products and five sums, and of turning r."""
        return 16 * ROUNDING * (np.abs(self.position) @ np.abs(self.normal) + 2 * self.physics.reach)

    @property
    def has_end(self) -> bool:
        """Whether the last state kept is that of the last step."""
        return bool(self.step[-1] == self.steps_done)


def _attributes(run: _Run) -> list[str]:
    attributes, scene = run.dataset.attrs, run.scene
    found = unequal("step_size", attributes["step_size"], run.h, 2 * ROUNDING * run.h, "duration / steps")
    omega_h = theory.omega_h(scene, run.steps)
    found += unequal("omega_h", attributes["omega_h"], omega_h, 8 * ROUNDING * omega_h, "√(4 S/m) times the step size")
    spin = attributes["angular_momentum_at_launch"]
    found += unequal("angular_momentum_at_launch", spin, scene.launch.spin, 0.0, "the scene's launch")
    phase = float(run.dataset["touchdown_phase"])
    found += outside(
        "touchdown_phase", phase, 0 < phase <= 1 or np.isnan(phase), "a number above 0, at most 1, or none"
    )
    done, evaluations = run.steps_done, int(run.dataset["evaluations"])
    found += outside("steps_done", done, 0 <= done <= run.steps, f"a number from 0 to {run.steps}")
    return found + outside("evaluations", evaluations, evaluations >= 0, "a number >= 0")


def _times(run: _Run) -> list[str]:
    """Every K-th step from the launch on, as far as the run went; the time of a step is step/steps of the duration."""
    step = run.step
    every = max(run.every, 1)
    found = unequal("step", step, np.arange(len(step)) * every, 0.0, f"every {every}th step from the launch on")
    if len(step) > 1 and len(step) != run.steps_done // every + 1:
        found.append(f"step: {len(step)} states; allowed are {run.steps_done // every + 1}, as steps_done is")
    right = step / run.steps * run.scene.duration
    return found + unequal("time", run.dataset["time"].values, right, 2 * ROUNDING * right, "step / steps * duration")


def _finite(run: _Run) -> list[str]:
    """A run that leaves the range of doubles ends there; no state is kept of it."""
    named = {"position": run.position, "velocity": run.velocity, "angular_momentum": run.momentum}
    found = []
    for name, given in (named | {"node_offset": run.offsets}).items():
        found += outside(name, given, np.isfinite(given), "a number that is finite")
    return found


def _launch(run: _Run) -> list[str]:
    """The first state is the scene's launch; of the nodes up to the rounding of its rotation."""
    launch, why = run.launch, "the scene's launch"
    found = unequal("position[0]", run.position[0], launch["position"], 0.0, why)
    found += unequal("velocity[0]", run.velocity[0], launch["velocity"], 0.0, why)
    if run.model in TURNING:
        found += unequal("angular_momentum[0]", run.momentum[0], launch["angular_momentum"], 0.0, why)
        room = 16 * ROUNDING * run.physics.reach
        found += unequal("node_offset[0]", run.offsets[0], launch["node_offset"], room, why)
    return found


def _kinetic(run: _Run) -> Array:
    u, spin = run.velocity, run.momentum
    moving = 0.5 * run.physics.mass * (u[:, 0] * u[:, 0] + u[:, 1] * u[:, 1] + u[:, 2] * u[:, 2])
    turning = spin[:, 0] * spin[:, 0] + spin[:, 1] * spin[:, 1] + spin[:, 2] * spin[:, 2]
    return np.asarray(moving + 0.5 * turning / run.physics.inertia)


def _potential(run: _Run) -> Array:
    return np.asarray(run.physics.mass * run.physics.gravity * run.position[:, 2])


def _elastic(run: _Run) -> Array:
    return np.asarray((0.5 * run.physics.stiffness * np.maximum(0.0, run.depths) ** 2).sum(axis=1))


def _energies(run: _Run) -> list[str]:
    """Of sums without a difference in them, as kinetic energy, rounding is relative; a depth is a difference."""
    kinetic, potential, elastic = _kinetic(run), _potential(run), _elastic(run)
    values = {name: run.dataset[f"{name}_energy"].values for name in ("kinetic", "potential", "elastic")}
    pressed = np.maximum(0.0, run.depths + run.blur[:, None])
    unsure = (run.physics.stiffness * run.blur[:, None] * pressed).sum(axis=1) + 16 * ROUNDING * elastic
    both = values["kinetic"] + values["potential"]
    return [
        *unequal("kinetic_energy", values["kinetic"], kinetic, 8 * ROUNDING * kinetic, "m u²/2 + L²/(2 I)"),
        *unequal("potential_energy", values["potential"], potential, 4 * ROUNDING * np.abs(potential), "m g z"),
        *unequal("elastic_energy", values["elastic"], elastic, unsure, "the sum of S d²/2 over the nodes"),
        *unequal("energy_paper", run.dataset["energy_paper"].values, both, 0.0, "kinetic_energy + potential_energy"),
    ]


# Of one rotation of the nodes: the rounding of its axis, of sine and cosine, of the matrix, and of three products.
_ROUNDINGS_OF_A_TURN = 32


def _rigid(run: _Run) -> list[str]:
    """Distances between nodes are the cube's, but for the rounding of every turn since the launch.

    A turn needs a force, so there are not more of them than evaluations, or than steps of free flight.
    """
    if run.model not in TURNING:
        return []
    nodes = run.scene.cube.node_offsets()
    first, second = np.triu_indices(len(nodes), 1)
    right = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    found = np.linalg.norm(run.offsets[:, first] - run.offsets[:, second], axis=2)
    turns = 16 + max(run.steps_done, int(run.dataset["evaluations"]))
    room = _ROUNDINGS_OF_A_TURN * ROUNDING * turns * run.physics.reach
    centre = run.offsets.sum(axis=1)
    return [
        *unequal("distances between nodes of node_offset", found, right, room, "the cube's, which is rigid"),
        *unequal("sum of node_offset", centre, 0.0, 8 * room, "the centre is amid the nodes"),
    ]


# By which velocity a scheme moves the centre in a step: that at its end, or at its begin.
_MOVES_BY = {"symplectic_euler": 1, "implicit_euler": 1, "forward_euler": 0}


def _moved_as_it_says(run: _Run) -> list[str]:
    """Where every step is kept and the scheme is one of these, x' = x + h u, to the rounding of a sum.

    `implicit_euler` adds the ground's part to that of free flight, so that both velocities round.
    """
    which = _MOVES_BY.get(str(run.dataset.attrs["scheme"])) if run.lag is not None else None
    if which is None or run.every != 1:
        return []
    x, u, h = run.position, run.velocity, run.h
    right = x[:-1] + h * u[which : len(u) - 1 + which]
    swept = h * (np.abs(u[1:]) + np.abs(u[:-1]) + h * run.physics.gravity)
    room = 8 * ROUNDING * (np.abs(x[:-1]) + np.abs(x[1:]) + swept)
    return unequal("position[1:]", x[1:], right, room, "the place before + step size * velocity")


def _flights(run: _Run) -> list[str]:
    """From a state that flies until the next one, the centre follows the scheme's parabola, and the spin stays.

    Along the ground's normal that is concave, so that the cube is clear of the ground in between if it is at both
    ends, by more than the scheme may be off the parabola. The `ungated` law does nothing to a cube that only rises.
    """
    if run.lag is None or run.every == 0:
        return []
    physics, h, k, n = run.physics, run.h, run.every, run.normal
    x, u, spin = run.position[:-1], run.velocity[:-1], run.momentum[:-1]
    fall = np.array([0.0, 0.0, -physics.gravity])
    later_u = u + k * h * fall
    later_x = x + k * h * (u + h * fall * ((k + 2 * run.lag) / 2))
    size_u, size_x = (np.maximum(np.abs(a), np.abs(b)).max(axis=1) for a, b in ((u, later_u), (x, later_x)))
    flies = np.ones(len(x), bool) if run.model == "flying" else _clear(run, x, u, later_x, later_u)
    room_u = 16 * ROUNDING * k * (size_u + 8 * h * physics.gravity)
    room_x = 16 * ROUNDING * k * (size_x + k * h * size_u) + k * h * room_u
    room_spin = 4 * ROUNDING * k * np.abs(spin).max(axis=1)
    why = "free flight from the state before"
    found = []
    for name, given, right, room in (
        ("velocity", run.velocity, later_u, room_u),
        ("position", run.position, later_x, room_x),
        ("angular_momentum", run.momentum, spin, room_spin),
    ):
        found += unequal(f"{name}[1:]", given[1:], np.where(flies[:, None], right, given[1:]), room[:, None], why)
    return found if n[2] >= 0 or run.model == "flying" else []


def _clear(run: _Run, x: Array, u: Array, later_x: Array, later_u: Array) -> npt.NDArray[np.bool_]:
    """Return from which states the cube certainly flies until the next one, shape (time − 1,)."""
    physics, n, h = run.physics, run.normal, run.h
    pull = physics.gravity * n[2]
    speed, later_speed = u @ n, later_u @ n
    margin = physics.reach + 4 * h * (np.maximum(np.abs(speed), np.abs(later_speed)) + h * abs(pull))
    clear = np.minimum(x @ n, later_x @ n) > margin
    if run.scene.ground.contact == "gated" or physics.damping == 0:
        return np.asarray(clear)
    if run.model in TURNING:
        return np.zeros(len(x), bool)
    return np.asarray(clear & (np.minimum(speed, later_speed) > 4 * h * abs(pull)))


def _measures(run: _Run) -> dict[str, float]:
    names = [criterion.MEASURE for criterion in CRITERIA.values()]
    return {name: float(run.dataset[name]) if name in run.dataset else np.nan for name in names}


def _judged(run: _Run) -> list[str]:
    measures, verdict = _measures(run), int(run.dataset["verdict"])
    found = verdicts.of_measures({name: value for name, value in measures.items() if name in run.dataset})
    ended = run.dataset["ending"].values if "ending" in run.dataset else None
    found += verdicts.problems(verdict, ended, measures, verdicts.limits_in(str(run.dataset.attrs["criteria"])))
    found += verdicts.early(run.steps_done, run.steps, verdict)
    stalled = _stalled(run)
    found += outside(
        "verdict", verdict, (verdict != Verdict.STALLED) | stalled, "stalled only if no step moves the cube"
    )
    if run.has_end and verdict == Verdict.SANK:
        below = bool((run.depths[-1] > -run.blur[-1]).all())
        found += outside("verdict", verdict, below, "sank only if every node ends below the ground")
    return found


def _stalled(run: _Run) -> bool:
    place, speed = run.launch["position"], run.launch["velocity"]
    return bool(((speed != 0) & (place + run.h * speed == place)).any())


def _behind(run: _Run) -> Array:
    """Return what of the kinetic energy is due to the velocity's lag behind the place [J]."""
    assert run.lag is not None, "asked of our own schemes"
    late = run.lag * run.h * run.physics.gravity
    return np.asarray(run.physics.mass * late * (run.velocity[:, 2] - 0.5 * late))


def _airborne_energy(run: _Run) -> list[str]:
    """The measure energy_ratio is the largest of all steps in the air: of those kept at least, if all are kept just it.

    As `criteria/energy.py` has it, in numpy: 1 + (E − E at the launch) over the launch's energy above that of rest.
    """
    if run.lag is None or "energy_ratio" not in run.dataset:
        return []
    physics, measure = run.physics, float(run.dataset["energy_ratio"])
    kinetic, potential, elastic, behind = _kinetic(run), _potential(run), _elastic(run), _behind(run)
    flying = kinetic - behind + potential
    sizes = kinetic + np.abs(potential) + np.abs(behind)
    pull = physics.gravity * run.normal[2]
    sag = 0.0
    if pull > 0:
        hardly = physics.mass * pull < 4 * physics.stiffness * physics.side
        sag = physics.mass * pull / 4 / physics.stiffness if hardly else physics.side
    height = float(run.normal @ run.position[0])
    high = physics.mass * physics.gravity * abs(run.normal[2]) * (max(0.0, height - physics.side / 2) + sag / 2)
    whole = kinetic[0] + elastic[0] + high
    whole = whole if whole > 0 else 1.0
    ratio = 1 + (flying - (flying[0] + elastic[0])) / whole
    room = 16 * ROUNDING * ((sizes + sizes[0] + elastic[0]) / whole + np.abs(ratio))
    clearance = -run.depths.max(axis=1)
    first = 1.0 if clearance[0] > 0 else 0.0
    sure, maybe = clearance[1:] > run.blur[1:], clearance[1:] > -run.blur[1:]
    least = np.max((ratio - room)[1:], where=sure, initial=0.0)
    found = outside("energy_ratio", measure, not measure < least, f"a number >= {least:.17g}, of the states kept")
    if run.every == 1 and run.has_end and run.steps_done == run.steps:
        most = np.max((ratio + room)[1:], where=maybe, initial=first)
        found += outside("energy_ratio", measure, not measure > most, f"a number <= {most:.17g}, of all states")
    return found


def _highest(run: _Run) -> float:
    """Return the largest energy of the states kept [J]."""
    return float((_kinetic(run) + np.abs(_potential(run)) + _elastic(run)).max())


def _booked_ends(run: _Run) -> list[str]:
    """The ledger begins and ends with the energies of the first and the last state, velocities taken at the place."""
    if run.lag is None:
        return []
    energy = _kinetic(run) + _potential(run) + _elastic(run) - _behind(run)
    size = _kinetic(run) + np.abs(_potential(run)) + np.abs(_behind(run)) + _elastic(run)
    pressed = (run.physics.stiffness * run.blur[:, None] * np.maximum(0.0, run.depths + run.blur[:, None])).sum(axis=1)
    room = 16 * ROUNDING * size + pressed
    dataset, why = run.dataset, "the energy of the state"
    found = unequal("launch_energy", dataset["launch_energy"], energy[0], room[0], why)
    if run.has_end and run.steps_done == run.steps and np.isfinite(energy).all():
        found += unequal("end_energy", dataset["end_energy"], energy[-1], room[-1], why)
    return found
