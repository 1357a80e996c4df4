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
import xarray as xr

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
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Array, Physics, States, physics_of, start_of
from stiffdice.dynamics.vector import Vector, cross, plus, plus_times, row, times, vector
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend, fixed_step
from stiffdice.simulation.backend import Setup

# Schemes whose every step has a force to book.
BOOKED = [name for name in schemes.SCHEMES if name not in schemes.OWN_STEPS]

LARGEST = 10_000  # bounces whose rows are kept

# Steps made and booked at once: what caches hold.
_AT_ONCE = 2_000

# A step that books more [J] ends the ledger, so that all sums of what is booked stay within doubles.
LARGEST_WORK = 1e290

# What is booked of a step [J].
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

_DAMPING, _DRAG, _FRICTION, _SPRING = range(4)  # forces of the ground, in the order of AMOUNTS

# A state as the ledger sees it. forces: force [N] and torque [N m] of each of the ground's; motion: velocity [m/s] and
# L/I [rad/s]; energies [J], kinetic that of the stored velocity, less `lag` that of the velocity at the stored place;
# clearance [m]: of the lowest node, or a positive lower bound of it.
_VIEW = np.dtype(
    [
        ("forces", np.float64, (4, 6)),
        ("motion", np.float64, 6),
        *((name, np.float64) for name in ("kinetic", "potential", "elastic", "lag", "clearance")),
    ]
)

# Sums over the steps of the run, of its flights, and of each bounce: compensated, with what rounding loses apart.
_ACCOUNT = np.dtype([("total", np.float64, len(AMOUNTS)), ("rest", np.float64, len(AMOUNTS))])
_RUN, _FLIGHTS, _BOUNCES = range(3)

# A bounce. first_step: the last with every node above the ground (0 for a launch from within it). last_step: the first
# in the air again, or the ledger's last where it has not ended. Energies [J]: at those steps; the most in the springs.
_ROW = np.dtype(
    [
        *((name, np.int64) for name in ("first_step", "last_step")),
        ("ended", np.bool_),
        *((name, np.float64) for name in ("energy_before", "energy_after", "largest_elastic_energy")),
    ]
)


def ledger(
    scene: Scene,
    *,
    model: str = "tumbling",
    scheme: str = "symplectic_euler",
    steps: int = 10_000,
    budget: int | None = None,
) -> xr.Dataset:
    """Run the scene's own launch step by step and return where its energy went, as variables of a run's file.

    Scalars: `launch_energy` and `end_energy` [J], of the velocity at the stored place; `bounce_count`; the AMOUNTS and
    `scheme_work`, the sum of the three defects, in the run and, as `flight_...`, in the steps that begin and end with
    every node above the ground. `bounce_...`, dimension `bounce`: the same for the first LARGEST bounces. The attribute
    `steps_done` is less than `steps` where the numbers left the range of doubles; the ledger ends there.

    model: `auto` takes the least that is exact for the scene. budget: steps at most; None does all. Raises InputError
    for an unknown name, a step count out of range, and a model that the scene or the scheme does not allow.
    """
    validation.choice("scheme", scheme, BOOKED)
    books = _Books(backend.setup_of(scene, model, backend.OURS, scheme, steps))
    end = books.setup.steps if budget is None else budget
    while books.done < end and books.advance(min(_AT_ONCE, end - books.done)):
        pass
    return books.dataset()


class _Books:
    """The ledger of a run so far. done: steps booked. bounces: how many. energies [J]: at the launch and now."""

    def __init__(self, setup: Setup) -> None:
        self.setup, self._physics = setup, physics_of(setup.scene)
        self._tags = schemes.SCHEMES[setup.scheme], MODELS[setup.model]
        self._rows = np.zeros(min(LARGEST, setup.steps), _ROW)
        self._accounts = np.zeros(_BOUNCES + len(self._rows), _ACCOUNT)
        self._state = start_of(setup.scene, setup.model)
        self.done, self.bounces = 0, 0
        self.energies = [float(_energy(self._views(self._state))[0])] * 2

    def _views(self, states: States) -> npt.NDArray[np.void]:
        views, late = np.zeros(len(states), _VIEW), self.setup.lag * self.setup.step_size
        _look(self._physics._replace(node_weight=0.0), states, late, views)
        return views

    def advance(self, count: int) -> bool:
        """Do and book so many steps; return whether all numbers stayed within doubles."""
        h = self.setup.step_size
        states = np.concatenate([self._state, np.zeros(count, STATE)])
        fixed_step.advance(*self._tags, self._physics, states, 1, h, schemes.TOLERANCE)
        self._state, views = states[-1:], self._views(states)
        booked = _booked(self._physics, views[:-1], views[1:], self.setup.lag, h)
        with np.errstate(all="ignore"):
            sound = np.abs(booked).sum(axis=1) < LARGEST_WORK
        count = len(sound) if sound.all() else int(sound.argmin())
        if count > 0:
            self._post(views[: count + 1], booked[:count])
        return count == len(sound)

    def _post(self, views: npt.NDArray[np.void], booked: Array) -> None:
        """Add what is booked of steps, shape (step, amount), to the accounts; views: before, between and after them."""
        up, energies, elastic = views["clearance"] > 0.0, _energy(views), views["elastic"]
        steps, rows = self.done + np.arange(1, len(views)), self._rows
        bounces = ~(up[:-1] & up[1:])
        begins = bounces & (up[:-1] | (steps == 1))
        number = self.bounces - 1 + np.cumsum(begins)  # of the bounce that a step is part of, if it is
        _add(self._accounts, np.where(bounces, _BOUNCES + number, _FLIGHTS), booked)
        inside = np.flatnonzero(bounces & (number < len(rows)))
        first, bounce = inside[begins[inside]], number[inside]
        rows["first_step"][number[first]] = steps[first] - 1
        rows["energy_before"][number[first]] = energies[first]
        rows["largest_elastic_energy"][number[first]] = elastic[first]
        # Of the steps of one bounce the last is what stays.
        rows["last_step"][bounce] = steps[inside]
        rows["ended"][bounce] = up[inside + 1]
        rows["energy_after"][bounce] = energies[inside + 1]
        np.maximum.at(rows["largest_elastic_energy"], bounce, elastic[inside + 1])
        self.done, self.energies[1] = int(steps[-1]), float(energies[-1])
        self.bounces += int(begins.sum())

    def dataset(self) -> xr.Dataset:
        """Return the ledger's variables."""
        place = "kinetic (of the velocity at the stored place), potential and elastic energy"
        rows, booked = self._rows[: self.bounces], self._accounts["total"] + self._accounts["rest"]
        (launch, end), first, last = self.energies, rows["first_step"], rows["last_step"]
        totals: dict[str, tuple[Any, str, str]] = {
            "launch_energy": (launch, f"{place} at the launch", "J"),
            "end_energy": (end, f"{place} at the last step booked", "J"),
            "bounce_count": (self.bounces, "bounces, those without a row included", "1"),
            **_works("", booked[_RUN], "the run"),
            **_works("flight_", booked[_FLIGHTS], "flights"),
        }
        springs = "the springs in the bounce"
        start, stop = (step / self.setup.steps * self.setup.scene.duration for step in (first, last))
        columns: dict[str, tuple[Any, str, str]] = {
            "bounce_first_step": (first, "last step with every node above the ground", "1"),
            "bounce_last_step": (last, "first step in the air again, or the last one booked", "1"),
            "bounce_start": (start, "time of the bounce's first step", "s"),
            "bounce_end": (stop, "time of the bounce's last step", "s"),
            "bounce_energy_before": (rows["energy_before"], f"{place} at the bounce's first step", "J"),
            "bounce_energy_after": (rows["energy_after"], f"{place} at the bounce's last step", "J"),
            "bounce_largest_elastic_energy": (rows["largest_elastic_energy"], f"most energy in {springs}", "J"),
            **_works("bounce_", booked[_BOUNCES:][: self.bounces], "the bounce"),
        }
        variables: dict[str, Any] = {
            name: (dimensions, values, {"long_name": text, "units": unit})
            for dimensions, described in (((), totals), (("bounce",), columns))
            for name, (values, text, unit) in described.items()
        }
        ended = enum_attributes("whether the bounce was over at the last step booked", ENDED)
        variables["bounce_ended"] = ("bounce", rows["ended"].astype(np.int8), ended)
        return xr.Dataset(variables, attrs={"steps_done": self.done})


@njit(cache=True)
def _look(physics: Physics, states: States, late: float, views: npt.NDArray[np.void]) -> None:
    """View states whose velocity is `late` [s]; physics: without the nodes' weight, so that forces are the ground's."""
    for k in range(len(states)):
        state, view = states[k], views[k]
        for axis in range(3):
            view.motion[axis] = state.velocity[axis]
            view.motion[3 + axis] = state.angular_momentum[axis] / physics.inertia
        fall = physics.gravity * late
        view.kinetic = energy.kinetic(physics, state)
        view.potential = energy.potential(physics, state)
        view.elastic = energy.elastic(physics, state)
        view.lag = physics.mass * fall * (state.velocity[2] - 0.5 * fall)
        view.clearance = _feel(physics, state, view.forces)


@njit
def _feel(physics: Physics, state: Any, forces: Any) -> float:
    """Add up each force of the ground over the nodes, as the models do, and return the clearance [m]."""
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
            _pull(forces[_SPRING], arm, times(spring, n))
            _pull(forces[_DAMPING], arm, times(push - spring, n))
            _pull(forces[_FRICTION], arm, plus_times(force, -push, n))
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


@np.errstate(all="ignore")
def _energy(views: npt.NDArray[np.void]) -> Array:
    """Return the energies with the velocity at the stored place [J]."""
    return np.asarray(views["kinetic"] + views["potential"] + views["elastic"] - views["lag"])


@njit(cache=True)
def _add(accounts: npt.NDArray[np.void], parts: npt.NDArray[np.int64], booked: Array) -> None:
    """Add each step to the run's account, and to that of its part if there is one (compensated, Neumaier 1974)."""
    for step in range(len(booked)):
        for number in (_RUN, parts[step]):
            if number >= len(accounts):
                continue
            account = accounts[number]
            for k in range(booked.shape[1]):
                total, amount = account.total[k], booked[step, k]
                account.total[k] = total + amount
                if abs(total) >= abs(amount):
                    account.rest[k] += (total - account.total[k]) + amount
                else:
                    account.rest[k] += (amount - account.total[k]) + total


def _works(prefix: str, booked: Array, where: str) -> dict[str, tuple[Array, str, str]]:
    """Return values, meaning and unit of each amount, shape (..., amount), and of the scheme's work."""
    works = {name: (booked[..., k], text) for k, (name, text) in enumerate(AMOUNTS.items())}
    made = booked[..., -3:].sum(axis=-1)
    works["scheme_work"] = made, "energy that the scheme made, the sum of its defects"
    return {prefix + name: (values, f"{text}, in {where}", "J") for name, (values, text) in works.items()}
