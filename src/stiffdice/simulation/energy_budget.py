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
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import energy, model_selection
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS, height_of, node_force, normal_force, reaches
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, Physics, States, physics_of, start_of
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

# Schemes whose every step has a force to book.
BOOKED = [name for name in schemes.SCHEMES if name not in schemes.OWN_STEPS]

LARGEST = 10_000  # bounces whose rows are kept

# Steps after which compiled code returns, to see signals: a twentieth of a second.
_AT_ONCE = 100_000

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

_DAMPING, _DRAG, _FRICTION, _SPRING, _GRAVITY, _SPRING_DEFECT, _GRAVITY_DEFECT, _KICK_DEFECT = range(len(AMOUNTS))
_SIZE = len(AMOUNTS)
_FORCES = 4  # those of the ground, in the order of AMOUNTS: damping, drag, friction, springs

# A state as the ledger sees it. forces: force [N] and torque [N m] of each of the _FORCES; motion: velocity [m/s] and
# L/I [rad/s]; energies [J], kinetic that of the stored velocity, less `lag` that of the velocity at the stored place;
# clearance [m]: of the lowest node, or a positive lower bound of it.
_VIEW = np.dtype(
    [
        ("forces", np.float64, (_FORCES, 6)),
        ("motion", np.float64, 6),
        ("kinetic", np.float64),
        ("potential", np.float64),
        ("elastic", np.float64),
        ("lag", np.float64),
        ("clearance", np.float64),
    ]
)

# Where the books stand: steps done, bounces so far, and whether one is going on.
_STAND = np.dtype([("done", np.int64), ("bounces", np.int64), ("in_bounce", np.bool_)])

# Compensated sums over the steps of a run, of its flights, or of the bounce going on.
_ACCOUNT = np.dtype([("total", np.float64, _SIZE), ("rest", np.float64, _SIZE)])
_RUN, _FLIGHTS, _BOUNCE = range(3)

_ROW = np.dtype(
    [
        ("first_step", np.int64),
        ("last_step", np.int64),
        ("ended", np.bool_),
        ("energy_before", np.float64),
        ("energy_after", np.float64),
        ("largest_elastic_energy", np.float64),
        ("booked", np.float64, _SIZE),
    ]
)


@dataclass(frozen=True)
class Works:
    """The AMOUNTS [J] of a span of steps, shape () each, or of many, shape (bounce,) each."""

    damping_work: Array
    drag_work: Array
    friction_work: Array
    spring_work: Array
    gravity_work: Array
    spring_defect: Array
    gravity_defect: Array
    kick_defect: Array

    @property
    def scheme_work(self) -> Array:
        """What the scheme itself made, or lost if negative [J]."""
        return self.spring_defect + self.gravity_defect + self.kick_defect

    @property
    def energy_change(self) -> Array:
        """What all of it adds up to: the change of kinetic, potential and elastic energy [J]."""
        return self.damping_work + self.drag_work + self.friction_work + self.scheme_work


@dataclass(frozen=True)
class Bounces:
    """A row for each bounce, shape (bounce,) each.

    first_step: the last with every node above the ground (0 for a launch from within it). last_step: the first in the
    air again, or the ledger's last where ended is False. energy_before, energy_after: at those steps [J].
    largest_elastic_energy: the most that the springs held [J].
    """

    first_step: npt.NDArray[np.int64]
    last_step: npt.NDArray[np.int64]
    ended: npt.NDArray[np.bool_]
    energy_before: Array
    energy_after: Array
    largest_elastic_energy: Array
    works: Works


@dataclass(frozen=True)
class Ledger:
    """The energy of one run, booked.

    steps_done: fewer than `steps` where the numbers left the range of doubles; the books end there. run: works of all
    steps; flights: of the steps that begin and end with every node above the ground. bounces: rows of the first
    LARGEST of bounce_count. launch_energy, end_energy [J]: with the velocity at the stored place.
    """

    scene: Scene
    model: str
    scheme: str
    steps: int
    steps_done: int
    launch_energy: float
    end_energy: float
    run: Works
    flights: Works
    bounces: Bounces
    bounce_count: int


def keep(
    scene: Scene,
    *,
    model: str = "tumbling",
    scheme: str = "symplectic_euler",
    steps: int = 10_000,
    budget: int | None = None,
) -> Ledger:
    """Run the scene's own launch step by step and return the ledger of its energy.

    model: `auto` takes the least that is exact for the scene. budget: steps at most; None does all. Raises InputError
    for an unknown name, a step count out of range, and a model that the scene or the scheme does not allow.
    """
    validation.choice("scheme", scheme, BOOKED)
    steps = validation.count("steps", steps)
    model, _ = model_selection.chosen(model, [scene], scene.duration / steps)
    schemes.check_fit(scheme, scene, model)
    physics = physics_of(scene)
    accounts = np.zeros(3, _ACCOUNT)
    rows = np.zeros(min(LARGEST, steps), _ROW)
    tags = schemes.SCHEMES[scheme], MODELS[model], LAWS[scene.ground.contact]
    h, lag, stand = scene.duration / steps, schemes.LAGS[scheme], np.zeros(1, _STAND)
    state, views = start_of(scene, model), np.zeros(2, _VIEW)
    numbers = *tags, physics, physics._replace(node_weight=0.0)
    launch_energy = _begin(*numbers[2:], state, lag * h, views)
    end = steps if budget is None else budget
    while _keep(*numbers, state, end, h, lag, stand, views, accounts, rows):
        pass
    steps_done, bounce_count = int(stand["done"][0]), int(stand["bounces"][0])
    end_energy = _energy_of(views, steps_done)
    rows, booked = rows[:bounce_count], accounts["total"] + accounts["rest"]
    return Ledger(
        scene,
        model,
        scheme,
        steps,
        steps_done,
        launch_energy,
        end_energy,
        Works(*booked[_RUN]),
        Works(*booked[_FLIGHTS]),
        Bounces(
            first_step=rows["first_step"],
            last_step=rows["last_step"],
            ended=rows["ended"],
            energy_before=rows["energy_before"],
            energy_after=rows["energy_after"],
            largest_elastic_energy=rows["largest_elastic_energy"],
            works=Works(*rows["booked"].T),
        ),
        bounce_count,
    )


@njit(cache=True)
def _begin(law: Any, physics: Physics, weightless: Physics, states: States, late: float, views: Any) -> float:
    """View the launch, and return its energy [J]."""
    _look(law, physics, weightless, states[0], late, views[0])
    return _energy(views[0])


@njit(cache=True)
def _energy_of(views: Any, step: int) -> float:
    """Return the energy after a step, the last or the one before [J]."""
    return _energy(views[step % 2])


@njit(cache=True)
def _keep(
    scheme: Any,
    model: Any,
    law: Any,
    physics: Physics,
    weightless: Physics,
    states: States,
    end: int,
    h: float,
    lag: float,
    stands: npt.NDArray[np.void],
    views: npt.NDArray[np.void],
    accounts: npt.NDArray[np.void],
    rows: npt.NDArray[np.void],
) -> bool:
    """Do and book the next steps, up to number `end`; return whether there are more to do."""
    state, stand = states[0], stands[0]
    late = lag * h
    booked = np.zeros(_SIZE)
    row = rows[max(0, min(stand.bounces, rows.shape[0]) - 1)]
    first = stand.done + 1
    last = min(end, stand.done + _AT_ONCE)
    for i in range(first, last + 1):
        before, after = views[(i - 1) % 2], views[i % 2]
        schemes.step(scheme, model, law, physics, state, h, schemes.TOLERANCE)
        _look(law, physics, weightless, state, late, after)
        _book(booked, physics, before, after, lag, h)
        if not _size(booked) < LARGEST_WORK:
            return False
        stand.done = i
        _add(accounts[_RUN], booked)
        if before.clearance > 0.0 and after.clearance > 0.0:
            _add(accounts[_FLIGHTS], booked)
            continue
        if not stand.in_bounce:
            stand.in_bounce = True
            _open(accounts[_BOUNCE])
            if stand.bounces < rows.shape[0]:
                row = rows[stand.bounces]
                row.first_step = i - 1
                row.energy_before = _energy(before)
                row.largest_elastic_energy = before.elastic
            stand.bounces += 1
        _add(accounts[_BOUNCE], booked)
        if stand.bounces <= rows.shape[0]:
            _write(row, accounts[_BOUNCE], i, after)
        stand.in_bounce = after.clearance <= 0.0
    return last < end


@njit
def _look(law: Any, physics: Physics, weightless: Physics, state: Any, late: float, view: Any) -> None:
    """View a state whose velocity is `late` [s]."""
    for axis in range(3):
        view.motion[axis] = state.velocity[axis]
        view.motion[3 + axis] = state.angular_momentum[axis] / physics.inertia
    fall = physics.gravity * late
    view.kinetic = energy.kinetic(physics, state)
    view.potential = energy.potential(physics, state)
    view.elastic = energy.elastic(physics, state)
    view.lag = physics.mass * fall * (state.velocity[2] - 0.5 * fall)
    view.clearance = _feel(law, physics, weightless, state, view.forces)


@njit
def _feel(law: Any, physics: Physics, weightless: Physics, state: Any, forces: Any) -> float:
    """Add up each force of the ground over the nodes, as the models do, and return the clearance [m]."""
    forces[:] = 0.0
    clearance = height_of(physics, state) - physics.reach
    if not reaches(law, clearance):
        return clearance
    clearance = math.inf
    x, y, z = state.position[0], state.position[1], state.position[2]
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        rx, ry, rz = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        depth = -(physics.nx * (x + rx) + physics.ny * (y + ry) + physics.nz * (z + rz))
        vx = ux + (wy * rz - wz * ry)
        vy = uy + (wz * rx - wx * rz)
        vz = uz + (wx * ry - wy * rx)
        speed = physics.nx * vx + physics.ny * vy + physics.nz * vz
        fx, fy, fz = node_force(law, weightless, depth, vx, vy, vz)
        if depth > 0.0:
            spring = physics.stiffness * depth
            push = normal_force(law, depth, speed, physics.stiffness, physics.damping)
            _press(forces[_SPRING], physics, rx, ry, rz, spring)
            _press(forces[_DAMPING], physics, rx, ry, rz, push - spring)
            grip = fx - push * physics.nx, fy - push * physics.ny, fz - push * physics.nz
            _pull(forces[_FRICTION], rx, ry, rz, *grip)
        else:
            _pull(forces[_DRAG], rx, ry, rz, fx, fy, fz)
        clearance = min(clearance, -depth)
    return clearance


@njit
def _press(wrench: Any, physics: Physics, rx: float, ry: float, rz: float, push: float) -> None:
    """Add a force along the normal on the node at r, and its torque."""
    _pull(wrench, rx, ry, rz, push * physics.nx, push * physics.ny, push * physics.nz)


@njit
def _pull(wrench: Any, rx: float, ry: float, rz: float, fx: float, fy: float, fz: float) -> None:
    """Add a force on the node at r, and its torque."""
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += fz
    wrench[3] += ry * fz - rz * fy
    wrench[4] += rz * fx - rx * fz
    wrench[5] += rx * fy - ry * fx


@njit
def _book(booked: Any, physics: Physics, before: Any, after: Any, lag: float, h: float) -> None:
    """Book a step of h [s] between two views."""
    early, late = h * (0.5 + lag), h * (0.5 - lag)
    for force in range(_FORCES):
        work = 0.0
        for part in range(6):
            impulse = early * before.forces[force, part] + late * after.forces[force, part]
            work += impulse * (0.5 * (before.motion[part] + after.motion[part]))
        booked[force] = work
    spring = booked[_SPRING]
    weight = -physics.weight * h * (0.5 * (before.motion[2] + after.motion[2]))
    works = booked[_DAMPING] + booked[_DRAG] + booked[_FRICTION] + spring + weight
    booked[_SPRING] = before.elastic - after.elastic
    booked[_GRAVITY] = before.potential - after.potential
    booked[_SPRING_DEFECT] = spring - booked[_SPRING]
    booked[_GRAVITY_DEFECT] = weight - booked[_GRAVITY] - (after.lag - before.lag)
    booked[_KICK_DEFECT] = (after.kinetic - before.kinetic) - works


@njit
def _energy(view: Any) -> float:
    """Return the energy with the velocity at the stored place [J]."""
    return view.kinetic + view.potential + view.elastic - view.lag


@njit
def _size(booked: Any) -> float:
    """Return the sum of the amounts' magnitudes [J]; not-a-number if one is."""
    size = 0.0
    for amount in booked:
        size += abs(amount)
    return size


@njit
def _add(account: Any, booked: Any) -> None:
    """Add what is booked to an account's sums, with what rounding loses kept apart (Neumaier 1974)."""
    for k in range(booked.shape[0]):
        total, amount = account.total[k], booked[k]
        account.total[k] = total + amount
        if abs(total) >= abs(amount):
            account.rest[k] += (total - account.total[k]) + amount
        else:
            account.rest[k] += (amount - account.total[k]) + total


@njit
def _open(account: Any) -> None:
    """Begin an account anew."""
    for k in range(account.total.shape[0]):
        account.total[k] = 0.0
        account.rest[k] = 0.0


@njit
def _write(row: Any, account: Any, step: int, view: Any) -> None:
    """Bring a bounce's row up to a step."""
    row.last_step = step
    row.ended = view.clearance > 0.0
    row.energy_after = _energy(view)
    row.largest_elastic_energy = max(row.largest_elastic_energy, view.elastic)
    for k in range(account.total.shape[0]):
        row.booked[k] = account.total[k] + account.rest[k]


def variables(ledger: Ledger) -> dict[str, Any]:
    """Return the ledger as variables of a run's file, (dimensions, values, attributes) by name as in `dataset.py`.

    The run's totals are scalars; rows of bounces, `bounce_...`, have the dimension `bounce`.
    """
    rows, place = ledger.bounces, "kinetic (of the velocity at the stored place), potential and elastic energy"
    columns: dict[str, tuple[Any, str, str]] = {
        "first_step": (rows.first_step, "last step with every node above the ground", "1"),
        "last_step": (rows.last_step, "first step in the air again, or the last one booked", "1"),
        "start": (_time(ledger, rows.first_step), "time of the bounce's first step", "s"),
        "end": (_time(ledger, rows.last_step), "time of the bounce's last step", "s"),
        "energy_before": (rows.energy_before, f"{place} at the bounce's first step", "J"),
        "energy_after": (rows.energy_after, f"{place} at the bounce's last step", "J"),
        "largest_elastic_energy": (rows.largest_elastic_energy, "most energy in the springs in the bounce", "J"),
    }
    columns |= {name: (values, f"{text}, in the bounce", "J") for name, values, text in _booked(rows.works)}
    totals: dict[str, tuple[Any, str, str]] = {
        "launch_energy": (ledger.launch_energy, f"{place} at the launch", "J"),
        "end_energy": (ledger.end_energy, f"{place} at the last step booked", "J"),
        "bounce_count": (ledger.bounce_count, "bounces, those without a row included", "1"),
    }
    totals |= {name: (values, f"{text}, in the run", "J") for name, values, text in _booked(ledger.run)}
    totals |= {f"flight_{name}": (values, f"{text}, in flights", "J") for name, values, text in _booked(ledger.flights)}
    ended = enum_attributes("whether the bounce was over at the last step booked", ENDED)
    return (
        {name: ((), value, {"long_name": text, "units": unit}) for name, (value, text, unit) in totals.items()}
        | {
            f"bounce_{name}": ("bounce", values, {"long_name": text, "units": unit})
            for name, (values, text, unit) in columns.items()
        }
        | {"bounce_ended": ("bounce", rows.ended.astype(np.int8), ended)}
    )


def _time(ledger: Ledger, step: npt.NDArray[np.int64]) -> Array:
    return step / ledger.steps * ledger.scene.duration


def _booked(works: Works) -> list[tuple[str, Array, str]]:
    """Return name, values and meaning of each amount, and of the scheme's work."""
    amounts = [(name, getattr(works, name), text) for name, text in AMOUNTS.items()]
    return [*amounts, ("scheme_work", works.scheme_work, "energy that the scheme made, the sum of its defects")]
