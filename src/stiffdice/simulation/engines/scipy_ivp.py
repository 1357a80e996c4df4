"""SciPy's DOP853, LSODA and Radau on the same equations of motion: the same compiled forces, in one call from Python.

What is solved for is place, velocity and, for a turning cube, a quaternion and the angular momentum. Each method has
the setting that was fastest for it at equal error, out of those tried (throw to t = 3 s, S = 10² … 10¹²):

- DOP853 as `ode("dop853")`, whose loop is compiled: it stops at every sample, some 14 evaluations each, and still takes
  a third of the time of `solve_ivp`, which interpolates. LSODA as `odeint`, a compiled loop that interpolates: a third
  of the time of `solve_ivp`. Radau is `solve_ivp`'s only.
- Integration is not restarted at touch-down and lift-off: to find them (`events`) costs more than it saves.
- No `max_step`: a step over a whole contact ends so deep in the ground, or sees it at a stage, that it is rejected.
- Radau has its Jacobian by differences within compiled code: SciPy's own needs up to thousands of times the steps above
  S = 10⁸. Each counts as as many evaluations as it makes.
- Absolute tolerances are 0.01 of the relative one times a natural size of each component: the radius, the speed √(2E/m)
  and the angular momentum √(2EI) of the launch's energy E, and one. Factors from 1 to 10⁻⁴ gave the same curve.

Each `advance` goes on from where the last one ended, in a new integration; as an engine (`simulator: scipy`) it is
LSODA, which tells the state after each of our steps between its own.
"""

from __future__ import annotations

import math
import warnings
from abc import abstractmethod
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import ode, odeint, solve_ivp

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.inertia import Isotropic
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, TURNING, Array, Physics, States, physics_of, start_of
from stiffdice.integrators.event_driven.active_set import NODES, SIZE, give, normalise, quaternion_rate
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.adapter import Engine

# The absolute tolerance of each component, in units of the relative one and of the component's natural size.
ABSOLUTE = 0.01

# Steps between two samples after which a run is given up.
_MOST_STEPS = 100_000

# Of a difference that stands for a derivative, in units of each component's natural size.
_NUDGE = 1e-9

# What the equations need beside the motion, one record, as named tuples take longer to hand over. nodes: at the launch;
# motion: as in `active_set`, its quaternion made a unit; state: which that stands for.
_ROOM = np.dtype(
    [
        ("physics", [(name, np.float64) for name in Physics._fields[:-1]]),
        ("nodes", np.float64, (NODES, 3)),
        ("motion", np.float64, SIZE),
        ("state", STATE),
    ]
)
Room = npt.NDArray[np.void]

Slope = Callable[[float, Array, Room], Array]
Slopes = Callable[[float, Array, Room, Array], Array]


@njit
def _physics_of(p: Any) -> Physics:
    """Return the physics of a cube from a record of its numbers."""
    forces = p.stiffness, p.damping, p.friction, p.onset, p.approach_damping
    sizes = p.nx, p.ny, p.nz, p.cutoff, p.node_weight, p.weight, p.reach, p.radius, p.side
    return Physics(p.mass, p.gravity, p.inertia, *forces, *sizes, Isotropic())


@njit
def _put(model: Any, y: Array, room: Any) -> None:
    """Make the state that a solution vector stands for; its quaternion need not be a unit."""
    turning = bool(models.turns(model))
    for part in range(y.shape[0]):
        room.motion[part] = y[part]
    if turning:
        normalise(room.motion)
    give(turning, _physics_of(room.physics), room.nodes, room.motion, room.state)


@njit
def _rate(model: Any, y: Array, room: Any) -> Array:
    """Return dy/dt: velocity and force over mass; for a turning cube torque, and the quaternion's rate."""
    _put(model, y, room)
    wrench = models.force(model, _physics_of(room.physics), room.state)
    rate = np.empty(y.shape[0])
    for axis in range(3):
        rate[axis] = y[3 + axis]
        rate[3 + axis] = wrench[axis] / room.physics.mass
    if models.turns(model):
        spin = room.state.angular_velocity
        rate[6], rate[7], rate[8] = wrench[3], wrench[4], wrench[5]
        turned = quaternion_rate(spin[0] / 2, spin[1] / 2, spin[2] / 2, y[9], y[10], y[11], y[12])
        rate[9], rate[10], rate[11], rate[12] = turned
    return rate


@cache
def equations(model: str) -> tuple[Slope, Slopes]:
    """Return dy/dt and its Jacobian, compiled for one model: a tag to hand over would double the time.

    (t, y, room) -> dy/dt. (t, y, room, sizes) -> its Jacobian by differences, shape (component, component).
    """
    tag = MODELS[model]

    @njit(cache=True)
    def slope(t: float, y: Array, room: Room) -> Array:
        return _rate(tag, y, room[0])

    @njit(cache=True)
    def slopes(t: float, y: Array, room: Room, sizes: Array) -> Array:
        size = y.shape[0]
        here, there, jacobian = _rate(tag, y, room[0]), y.copy(), np.empty((size, size))
        for j in range(size):
            there[j] = y[j] + _NUDGE * sizes[j]
            jacobian[:, j] = (_rate(tag, there, room[0]) - here) / (there[j] - y[j])
            there[j] = y[j]
        return jacobian

    return slope.dispatcher, slopes.dispatcher


@njit(cache=True)
def _states(model: Any, solution: Array, room: Room, states: States) -> None:
    for k in range(states.shape[0]):
        _put(model, solution[k], room[0])
        states[k] = room[0].state


def room_of(scene: Scene, launch: States) -> Room:
    """Return what the equations need to know of a scene and a launch, shape (1,)."""
    room = np.zeros(1, _ROOM)
    room["physics"], room["nodes"], room["state"] = tuple(physics_of(scene))[:-1], launch["node_offset"], launch
    return room


class _SpentError(Exception):
    """All evaluations that were allowed are done."""


class _Solver(Engine):
    """One run, told every h [s], standing where `advance` left it."""

    LAG = 0.0
    PACKAGE = "scipy"

    def __post_init__(self) -> None:
        physics, (launch,) = physics_of(self.scene), self.launch
        energy = sum(float(part[0]) for part in energies(physics, start_of(self.scene, self.model)))
        energy = max(energy, physics.mass * physics.gravity * physics.radius)
        parts = [launch["position"], launch["velocity"]]
        sizes = [physics.radius] * 3 + [math.sqrt(2 * energy / physics.mass)] * 3
        if self.model in TURNING:
            parts += [launch["angular_momentum"], [1.0, 0.0, 0.0, 0.0]]
            sizes += [math.sqrt(2 * energy * physics.inertia)] * 3 + [1.0] * 4
        self._y, self._sizes = np.concatenate(parts), np.array(sizes, float)  # natural sizes; see the module's words
        self._room = room_of(self.scene, self.launch)
        self._plain, self._slopes = equations(self.model)
        # A counter in Python takes a part of the time of an evaluation.
        self._slope: Slope = self._plain if self.most is None else self._counted
        self._evaluations, self._limit = 0, math.inf if self.most is None else self.most

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations.

        Not-a-number from where the solver fails on, and everywhere where it would take more evaluations than `most`.
        """
        times: Array = self.h * every * np.arange(len(states) + 1.0)
        solution, evaluations = np.full((len(times), len(self._y)), np.nan), 0
        if np.isfinite(self._y).all():
            before = self._evaluations
            with warnings.catch_warnings():  # a run that fails is a result
                warnings.simplefilter("ignore")
                try:
                    found, evaluations = self._solve(times)
                    solution[: len(found)] = found
                except _SpentError:
                    evaluations = int(self._limit) - before
        _states(MODELS[self.model], solution[1:], self._room, states)
        self._y = solution[-1]
        return evaluations

    def _counted(self, t: float, y: Array, room: Room) -> Array:
        """Return dy/dt. Between two of these Python sees a signal, which within odeint it does not."""
        self._evaluations += 1
        if self._evaluations > self._limit:
            raise _SpentError
        return self._plain(t, y, room)

    @abstractmethod
    def _solve(self, times: Array) -> tuple[Array, int]:
        """Return the solution at these times [s], shape (time, component), fewer if it fails, and evaluations."""


class Dop853(_Solver):
    """Dormand and Prince's method of order 8."""

    SCHEME = "dop853"

    def _solve(self, times: Array) -> tuple[Array, int]:
        before, solution = self._evaluations, [self._y]
        solver = ode(self._counted).set_f_params(self._room)
        absolute = float(ABSOLUTE * self.tolerance * self._sizes.min())  # it takes one for all
        solver.set_integrator("dop853", rtol=self.tolerance, atol=absolute, nsteps=_MOST_STEPS)
        solver.set_initial_value(self._y, times[0])
        for time in times[1:]:
            reached = solver.integrate(time)
            if not solver.successful():
                break
            solution.append(reached)
        return np.array(solution), self._evaluations - before


class Lsoda(_Solver):
    """Adams' methods and, where the motion is stiff, backward differentiation."""

    SCHEME = "lsoda"

    def _solve(self, times: Array) -> tuple[Array, int]:
        solution, told = odeint(
            self._slope,
            self._y,
            times,
            args=(self._room,),
            tfirst=True,
            rtol=self.tolerance,
            atol=ABSOLUTE * self.tolerance * self._sizes,
            mxstep=_MOST_STEPS,
            full_output=True,
        )
        done = told["message"] == "Integration successful."
        return solution if done else solution[:1], int(told["nfe"][-1])


class Radau(_Solver):
    """The implicit Runge-Kutta method of order 5."""

    SCHEME = "radau"

    def _solve(self, times: Array) -> tuple[Array, int]:
        found = solve_ivp(
            lambda t, y: self._slope(t, y, self._room),
            (times[0], times[-1]),
            self._y,
            method="Radau",
            t_eval=times,
            rtol=self.tolerance,
            atol=ABSOLUTE * self.tolerance * self._sizes,
            jac=lambda t, y: self._slopes(t, y, self._room, self._sizes),
        )
        return found.y.T, int(found.nfev + (len(self._y) + 1) * found.njev)


# By the names of their schemes.
SOLVERS: dict[str, type[Engine]] = {solver.SCHEME: solver for solver in (Dop853, Lsoda, Radau)}
