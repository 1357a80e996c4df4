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
from stiffdice.dynamics.contact import LAWS, height_of, node_force, normal_force, reaches
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, Physics, States, physics_of, start_of
from stiffdice.dynamics.vector import Vector
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend
from stiffdice.simulation.backend import Setup

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

# Where the books stand: steps done, bounces so far, whether one is going on, energies [J] at the launch and now.
_STAND = np.dtype(
    [
        ("done", np.int64),
        ("bounces", np.int64),
        ("in_bounce", np.bool_),
        ("launch_energy", np.float64),
        ("energy", np.float64),
    ]
)

# Compensated sums over the steps of a run, of its flights, or of the bounce going on.
_ACCOUNT = np.dtype([("total", np.float64, _SIZE), ("rest", np.float64, _SIZE)])
_RUN, _FLIGHTS, _BOUNCE = range(3)

# A bounce. first_step: the last with every node above the ground (0 for a launch from within it). last_step: the first
# in the air again, or the ledger's last where it has not ended. Energies [J]: at those steps; the most in the springs.
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
    setup = backend.setup_of(scene, model, backend.OURS, scheme, steps)
    physics, state, h, lag = physics_of(scene), start_of(scene, setup.model), setup.step_size, setup.lag
    ground = LAWS[scene.ground.contact], physics, physics._replace(node_weight=0.0)
    accounts, rows = np.zeros(3, _ACCOUNT), np.zeros(min(LARGEST, setup.steps), _ROW)
    views, stand = np.zeros(2, _VIEW), np.zeros(1, _STAND)
    _begin(*ground, state, lag * h, views, stand)
    end = setup.steps if budget is None else budget
    tags = schemes.SCHEMES[scheme], MODELS[setup.model]
    while _advance(*tags, *ground, state, end, h, lag, stand, views, accounts, rows):
        pass
    return _dataset(setup, stand[0], rows[: stand["bounces"][0]], accounts["total"] + accounts["rest"])


@njit(cache=True)
def _begin(
    law: Any, physics: Physics, weightless: Physics, states: States, late: float, views: Any, stand: Any
) -> None:
    """View the launch."""
    _look(law, physics, weightless, states[0], late, views[0])
    stand[0].launch_energy = stand[0].energy = _energy(views[0])


@njit(cache=True)
def _advance(
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
        stand.energy = _energy(after)
        _add(accounts[_RUN], booked)
        if before.clearance > 0.0 and after.clearance > 0.0:
            _add(accounts[_FLIGHTS], booked)
            continue
        if not stand.in_bounce:
            stand.in_bounce = True
            accounts[_BOUNCE].total[:] = 0.0
            accounts[_BOUNCE].rest[:] = 0.0
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
        fx, fy, fz = node_force(law, weightless, depth, Vector(vx, vy, vz))
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
def _write(row: Any, account: Any, step: int, view: Any) -> None:
    """Bring a bounce's row up to a step."""
    row.last_step = step
    row.ended = view.clearance > 0.0
    row.energy_after = _energy(view)
    row.largest_elastic_energy = max(row.largest_elastic_energy, view.elastic)
    for k in range(account.total.shape[0]):
        row.booked[k] = account.total[k] + account.rest[k]


def _dataset(setup: Setup, stand: Any, rows: npt.NDArray[np.void], booked: Array) -> xr.Dataset:
    """Return the ledger of a run; booked: the AMOUNTS of the accounts, shape (account, amount)."""
    place = "kinetic (of the velocity at the stored place), potential and elastic energy"
    duration, first, last = setup.scene.duration, rows["first_step"], rows["last_step"]
    totals: dict[str, tuple[Any, str, str]] = {
        "launch_energy": (stand["launch_energy"], f"{place} at the launch", "J"),
        "end_energy": (stand["energy"], f"{place} at the last step booked", "J"),
        "bounce_count": (stand["bounces"], "bounces, those without a row included", "1"),
        **_works("", booked[_RUN], "the run"),
        **_works("flight_", booked[_FLIGHTS], "flights"),
    }
    columns: dict[str, tuple[Any, str, str]] = {
        "bounce_first_step": (first, "last step with every node above the ground", "1"),
        "bounce_last_step": (last, "first step in the air again, or the last one booked", "1"),
        "bounce_start": (first / setup.steps * duration, "time of the bounce's first step", "s"),
        "bounce_end": (last / setup.steps * duration, "time of the bounce's last step", "s"),
        "bounce_energy_before": (rows["energy_before"], f"{place} at the bounce's first step", "J"),
        "bounce_energy_after": (rows["energy_after"], f"{place} at the bounce's last step", "J"),
        "bounce_largest_elastic_energy": (
            rows["largest_elastic_energy"],
            "most energy in the springs in the bounce",
            "J",
        ),
        **_works("bounce_", rows["booked"], "the bounce"),
    }
    variables: dict[str, Any] = {
        name: (dimensions, values, {"long_name": text, "units": unit})
        for dimensions, described in (((), totals), (("bounce",), columns))
        for name, (values, text, unit) in described.items()
    }
    ended = enum_attributes("whether the bounce was over at the last step booked", ENDED)
    variables["bounce_ended"] = ("bounce", rows["ended"].astype(np.int8), ended)
    return xr.Dataset(variables, attrs={"steps_done": int(stand["done"])})


def _works(prefix: str, booked: Array, where: str) -> dict[str, tuple[Array, str, str]]:
    """Return values, meaning and unit of each amount, shape (..., amount), and of the scheme's work."""
    works = {name: (booked[..., k], text) for k, (name, text) in enumerate(AMOUNTS.items())}
    made = booked[..., _SPRING_DEFECT] + booked[..., _GRAVITY_DEFECT] + booked[..., _KICK_DEFECT]
    works["scheme_work"] = made, "energy that the scheme made, the sum of its defects"
    return {prefix + name: (values, f"{text}, in {where}", "J") for name, (values, text) in works.items()}
