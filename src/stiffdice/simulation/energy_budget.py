"""Where the energy of a run goes: into damping, drag, friction and springs, and what the scheme itself made or lost.

The work of a force over a step of h is h f̄·ū. ū is the mean of the velocities stored before and after the step;
f̄ = (1/2 + lag) f(before) + (1/2 − lag) f(after) is, to second order in h, the force in the middle of the time that
those two velocities span, which is `lag` steps early (`registry.LAGS`). With the mean velocity h f·ū is exactly the
kinetic energy that an impulse h f gives; with L/I and torques the same holds for the turning. So where f̄ is the very
force the step used, as for symplectic Euler (lag = 1/2, f̄ = f(before)), the works add up to the change of the kinetic
energy to round-off. With another scheme the error of f̄ counts as the scheme's: of second order but for the step of
a touch-down, and none where only springs and gravity act.

The energy is kinetic + m g z + the springs' S d²/2, the kinetic energy taken with the velocity at the stored place,
u − lag g h ẑ. That is what a scheme keeps in free flight: for symplectic Euler E − m g h u_z/2, but for a constant. It
changes by the works of damping, drag and friction, and by the scheme's work, the sum of three defects:

- spring: what the springs' force worked, less what the springs gave up;
- gravity: what the weight worked, less what the potential energy gave up; 0 for symplectic Euler;
- kick: what the kinetic energy gained, less what all forces worked; 0 for symplectic Euler.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import energy
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import (
    height_of,
    node_force,
    node_velocity,
    normal_force,
    normal_of,
    reaches,
    upward,
)
from stiffdice.dynamics.inertia import spin_of
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Array, Physics, States, physics_of, start_of
from stiffdice.dynamics.vector import Vector, cross, plus, plus_times, row, times, vector
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.plain_dataset import PlainDataset, PlainVariable
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend

# Schemes whose every step has a force to book.
BOOKED = [name for name in schemes.SCHEMES if name not in schemes.OWN_STEPS]

LARGEST = 10_000  # bounces whose rows are kept

# Steps made and booked at once: what caches hold.
_AT_ONCE = 2_000

# A step that books more [J] ends the ledger, so that all sums of what is booked stay within doubles.
LARGEST_WORK = 1e290

# What is booked of a step [J]; the last three are the scheme's.
AMOUNTS = {
    "damping_work": "work of damping on nodes below the ground, with what it cuts off the springs' push",
    "drag_work": "work of the ungated law on nodes above the ground, damping and friction",
    "friction_work": "work of friction on nodes below the ground",
    "spring_work": "energy that the springs gave up",
    "gravity_work": "potential energy given up",
    "spring_defect": "work of the springs' force less the energy that the springs gave up",
    "gravity_defect": "work of the weight less the potential energy given up, with what the velocity's lag makes of it",
    "kick_defect": "kinetic energy gained less the work of all forces",
}
# Words of `bounce_ended`.
ENDED = ("in_contact", "in_air")

DAMPING, _DRAG, FRICTION, SPRING = range(4)  # forces of the ground, in the order of AMOUNTS

# A state as the ledger sees it. forces: force [N] and torque [N m] of each of the ground's; motion: velocity [m/s] and
# L/I [rad/s]; energies [J], kinetic that of the stored velocity, less `lag` that of the velocity at the stored place;
# energy: their sum with that one; clearance [m]: of the lowest node, or a positive lower bound of it.
_VIEW = np.dtype(
    [
        ("forces", np.float64, (4, 6)),
        ("motion", np.float64, 6),
        *((name, np.float64) for name in ("kinetic", "potential", "elastic", "lag", "energy", "clearance")),
    ]
)

# Accounts, each a compensated sum over steps and what rounding loses, apart: of the run, its flights, and each bounce.
_RUN, _FLIGHTS, _BOUNCES = range(3)

_PLACE = "kinetic (of the velocity at the stored place), potential and elastic energy"

# Of a bounce: type, meaning and unit. A launch from within the ground begins one, at step 0.
_COLUMNS: dict[str, tuple[type, str, str]] = {
    "first_step": (np.int64, "last step with every node above the ground", "1"),
    "last_step": (np.int64, "first step in the air again, or the last one booked", "1"),
    "start": (np.float64, "time of the bounce's first step", "s"),
    "end": (np.float64, "time of the bounce's last step", "s"),
    "energy_before": (np.float64, f"{_PLACE} at the bounce's first step", "J"),
    "energy_after": (np.float64, f"{_PLACE} at the bounce's last step", "J"),
    "largest_elastic_energy": (np.float64, "most energy in the springs in the bounce", "J"),
}
_ROW = np.dtype([*((name, kind) for name, (kind, _, _) in _COLUMNS.items()), ("ended", np.int64)])


def ledger(
    scene: Scene,
    *,
    model: str = "tumbling",
    scheme: str = "symplectic_euler",
    steps: int = 10_000,
    budget: int | None = None,
) -> PlainDataset:
    """Run the scene's own launch step by step and return where its energy went, as variables of a run's file.

    Scalars: `launch_energy` and `end_energy` [J], of the velocity at the stored place; `bounce_count`; the AMOUNTS and
    `scheme_work`, the sum of the three defects, in the run and, as `flight_...`, in the steps that begin and end with
    every node above the ground. `bounce_...`, dimension `bounce`: the same for the first LARGEST bounces. The attribute
    `steps_done` is less than `steps` where the numbers left the range of doubles; the ledger ends there.

    model: `auto` takes the least that is exact for the scene. budget: steps at most; None does all. Raises InputError
    for an unknown name, a step count out of range, and a model that the scene or the scheme does not allow.
    """
    validation.choice("scheme", scheme, BOOKED)
    setup = backend.setup_of(scene, model, backend.OURS, scheme, steps)
    physics, h, lag = physics_of(scene), setup.step_size, setup.lag
    rows = np.zeros(min(LARGEST, setup.steps), _ROW)
    accounts = np.zeros((_BOUNCES + len(rows), 2, len(AMOUNTS)))
    states, launch, end = start_of(scene, setup.model), math.nan, setup.steps if budget is None else budget
    done, bounces, goes_on = 0, 0, True
    while goes_on:
        states = np.concatenate([states[-1:], np.zeros(min(_AT_ONCE, end - done), STATE)])
        schemes.advance(schemes.SCHEMES[scheme], MODELS[setup.model], physics, states, 1, h, schemes.TOLERANCE)
        views = np.zeros(len(states), _VIEW)
        _look(physics._replace(node_weight=0.0), states, lag * h, views)
        booked = _booked(physics, views[:-1], views[1:], lag, h)
        with np.errstate(all="ignore"):
            sound = np.abs(booked).sum(axis=1) < LARGEST_WORK
        count = len(sound) if sound.all() else int(sound.argmin())
        bounces = _post(accounts, rows, views, booked[:count], done, bounces)
        launch, now = launch if done > 0 else float(views["energy"][0]), float(views["energy"][count])
        done += count
        goes_on = count == len(sound) and done < end
    for name, step in (("start", "first_step"), ("end", "last_step")):
        rows[name] = rows[step] / setup.steps * scene.duration
    return PlainDataset(
        _variables(launch, now, bounces, rows[:bounces], accounts.sum(axis=1)), {}, {"steps_done": done}
    )


def _variables(
    launch: float, now: float, bounces: int, rows: npt.NDArray[np.void], booked: Array
) -> dict[str, PlainVariable]:
    """Return a ledger's variables; launch, now: energies [J]."""
    described: dict[str, tuple[tuple[str, ...], Any, str, str]] = {
        "launch_energy": ((), launch, f"{_PLACE} at the launch", "J"),
        "end_energy": ((), now, f"{_PLACE} at the last step booked", "J"),
        "bounce_count": ((), bounces, "bounces, those without a row included", "1"),
        **_works((), "", booked[_RUN], "the run"),
        **_works((), "flight_", booked[_FLIGHTS], "flights"),
        **{f"bounce_{name}": (("bounce",), rows[name], text, unit) for name, (_, text, unit) in _COLUMNS.items()},
        **_works(("bounce",), "bounce_", booked[_BOUNCES:][:bounces], "the bounce"),
    }
    variables = {
        name: PlainVariable(dimensions, np.asarray(values), {"long_name": text, "units": unit})
        for name, (dimensions, values, text, unit) in described.items()
    }
    ended = enum_attributes("whether the bounce was over at the last step booked", ENDED)
    variables["bounce_ended"] = PlainVariable(("bounce",), rows["ended"].astype(np.int8), ended)
    return variables


def _works(
    dimensions: tuple[str, ...], prefix: str, booked: Array, where: str
) -> dict[str, tuple[tuple[str, ...], Array, str, str]]:
    """Return dimensions, values, meaning and unit of each amount, shape (..., amount), and of the scheme's work."""
    works = {name: (booked[..., k], text) for k, (name, text) in enumerate(AMOUNTS.items())}
    works["scheme_work"] = booked[..., -3:].sum(axis=-1), "energy that the scheme made, the sum of its defects"
    return {prefix + name: (dimensions, values, f"{text}, in {where}", "J") for name, (values, text) in works.items()}


@njit(cache=True)
def _look(physics: Physics, states: States, late: float, views: npt.NDArray[np.void]) -> None:
    """View states whose velocity is `late` [s]; physics: without the nodes' weight, so that forces are the ground's."""
    for k in range(len(states)):
        state, view = states[k], views[k]
        spin = spin_of(physics.body, physics, state, vector(state.angular_momentum))
        for axis in range(3):
            view.motion[axis], view.motion[3 + axis] = state.velocity[axis], spin[axis]
        fall = physics.gravity * late
        view.kinetic = energy.kinetic(physics, state)
        view.potential = energy.potential(physics, state)
        view.elastic = energy.elastic(physics, state)
        view.lag = physics.mass * fall * (state.velocity[2] - 0.5 * fall)
        view.energy = view.kinetic + view.potential + view.elastic - view.lag
        view.clearance = feel(physics, state, view.forces)


@njit
def feel(physics: Physics, state: Any, forces: Any) -> float:
    """Add up each force of the ground over the nodes, as the models do, and return the clearance [m].

    physics: without the nodes' weight. forces [N, N m]: shape (4, 6), of DAMPING, drag, FRICTION and SPRING.
    """
    clearance = height_of(physics, state) - physics.reach
    if not reaches(physics, clearance):
        return float(clearance)
    clearance = math.inf
    n = normal_of(physics)
    for k in range(len(state.node_offset)):
        arm, velocity = row(state.node_offset, k), node_velocity(state, k)
        depth = -upward(physics, plus(vector(state.position), arm))
        force = node_force(physics, depth, velocity)
        if depth > 0.0:
            spring, speed = physics.stiffness * depth, upward(physics, velocity)
            push = normal_force(physics, depth, speed)
            _pull(forces[SPRING], arm, times(spring, n))
            _pull(forces[DAMPING], arm, times(push - spring, n))
            _pull(forces[FRICTION], arm, plus_times(force, -push, n))
        else:
            _pull(forces[_DRAG], arm, force)
        clearance = min(clearance, -depth)
    return clearance


@njit
def _pull(wrench: Any, arm: Vector, force: Vector) -> None:
    """Add a force on a node, and its torque."""
    torque = cross(arm, force)
    for axis in range(3):
        wrench[axis] += force[axis]
        wrench[3 + axis] += torque[axis]


@np.errstate(all="ignore")  # of a run that leaves the range of doubles
def _booked(physics: Physics, before: npt.NDArray[np.void], after: npt.NDArray[np.void], lag: float, h: float) -> Array:
    """Return the AMOUNTS of steps of h [s] between two views each, shape (step, amount)."""
    early, late = h * (0.5 + lag), h * (0.5 - lag)
    mean = 0.5 * (before["motion"] + after["motion"])
    impulses = early * before["forces"] + late * after["forces"]
    damping, drag, friction, spring = (impulses * mean[:, None, :]).sum(axis=2).T
    weight = -physics.weight * h * mean[:, 2]
    of_springs, of_gravity = before["elastic"] - after["elastic"], before["potential"] - after["potential"]
    gravity_defect = weight - of_gravity - (after["lag"] - before["lag"])
    kick_defect = (after["kinetic"] - before["kinetic"]) - (damping + drag + friction + spring + weight)
    defects = spring - of_springs, gravity_defect, kick_defect
    return np.stack([damping, drag, friction, of_springs, of_gravity, *defects], axis=1)


@njit(cache=True)
def _post(
    accounts: Array, rows: npt.NDArray[np.void], views: npt.NDArray[np.void], booked: Array, done: int, bounces: int
) -> int:
    """Add what is booked of steps, shape (step, amount), to the accounts and the rows; return the bounces in all.

    views: before, between and after them. done: steps before. Sums are compensated (Neumaier 1974).
    """
    for step in range(len(booked)):
        before, after = views[step], views[step + 1]
        part = _FLIGHTS
        if not (before.clearance > 0.0 and after.clearance > 0.0):
            begins = before.clearance > 0.0 or done + step == 0
            bounces += 1 if begins else 0
            part = _BOUNCES + bounces - 1
            if bounces <= len(rows):
                row = rows[bounces - 1]
                if begins:
                    row.first_step, row.energy_before = done + step, before.energy
                    row.largest_elastic_energy = before.elastic
                row.last_step, row.energy_after = done + step + 1, after.energy
                row.ended = 1 if after.clearance > 0.0 else 0
                row.largest_elastic_energy = max(row.largest_elastic_energy, after.elastic)
        for number in (_RUN, part):
            for k in range(booked.shape[1] if number < len(accounts) else 0):
                total, amount = accounts[number, 0, k], booked[step, k]
                now = total + amount
                large, small = (total, amount) if abs(total) >= abs(amount) else (amount, total)
                accounts[number, 0, k] = now
                accounts[number, 1, k] += (large - now) + small
    return bounces
