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

As an engine (`simulator: scipy`) it is LSODA, which tells the state after each of our steps between its own; each
`advance` goes on from where the last one ended, in a new integration.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import scipy
from scipy.integrate import ode, odeint, solve_ivp

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, TURNING, Array, Physics, States, physics_of, start_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.fixed_step import Path

LAG = 0.0
SCHEME = "lsoda"

# The absolute tolerance of each component, in units of the relative one and of the component's natural size.
ABSOLUTE = 0.01

# Steps between two samples after which a run is given up.
_MOST_STEPS = 100_000

# Of a difference that stands for a derivative, in units of each component's natural size.
_NUDGE = 1e-9

_NUMBERS = len(Physics._fields)

Slope = Callable[[float, Array, Array, States], Array]
Slopes = Callable[[float, Array, Array, States, Array], Array]
Given = tuple[Slope, Slopes, Array, States]
Solution = tuple[Array, int]


@njit
def _physics(numbers: Array) -> Physics:
    """Return the scene's numbers; a named tuple takes longer to hand over than an array."""
    n = numbers
    return Physics(
        n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14]
    )  # fmt: skip


@njit
def _put(model: Any, numbers: Array, y: Array, state: Any) -> None:
    """Make the state that a solution vector stands for; its quaternion need not be a unit."""
    for axis in range(3):
        state.position[axis] = y[axis]
        state.velocity[axis] = y[3 + axis]
    nodes = state.node_offset
    if not models.turns(model):
        for k in range(nodes.shape[0]):
            for axis in range(3):
                nodes[k, axis] = numbers[_NUMBERS + 3 * k + axis]
        return
    for axis in range(3):
        state.angular_momentum[axis] = y[10 + axis]
        state.angular_velocity[axis] = y[10 + axis] / _physics(numbers).inertia
    w, x, y_, z = y[6], y[7], y[8], y[9]
    length = math.sqrt(w * w + x * x + y_ * y_ + z * z)
    w, x, y_, z = w / length, x / length, y_ / length, z / length
    for k in range(nodes.shape[0]):
        a, b, c = (numbers[_NUMBERS + 3 * k], numbers[_NUMBERS + 3 * k + 1], numbers[_NUMBERS + 3 * k + 2])
        tx, ty, tz = 2 * (y_ * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y_ * a)
        nodes[k, 0] = a + w * tx + (y_ * tz - z * ty)
        nodes[k, 1] = b + w * ty + (z * tx - x * tz)
        nodes[k, 2] = c + w * tz + (x * ty - y_ * tx)


@njit
def _rate(model: Any, law: Any, y: Array, numbers: Array, room: States) -> Array:
    """Return dy/dt: velocity and force over mass; for a turning cube the quaternion's rate, q' = ω q/2, and torque."""
    physics, state = _physics(numbers), room[0]
    _put(model, numbers, y, state)
    wrench = models.force(model, law, physics, state)
    rate = np.empty(y.shape[0])
    for axis in range(3):
        rate[axis] = y[3 + axis]
        rate[3 + axis] = wrench[axis] / physics.mass
    if models.turns(model):
        wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
        rate[6] = -(wx * y[7] + wy * y[8] + wz * y[9]) / 2
        rate[7] = (wx * y[6] + wy * y[9] - wz * y[8]) / 2
        rate[8] = (wy * y[6] + wz * y[7] - wx * y[9]) / 2
        rate[9] = (wz * y[6] + wx * y[8] - wy * y[7]) / 2
        for axis in range(3):
            rate[10 + axis] = wrench[3 + axis]
    return rate


@cache
def equations(model: str, law: str) -> tuple[Slope, Slopes]:
    """Return dy/dt and its Jacobian, compiled for one model and contact law: tags to hand over would double the time.

    (t, y, numbers, room) -> dy/dt. (t, y, numbers, room, sizes) -> its Jacobian by differences, shape (component,
    component).
    """
    model_tag, law_tag = MODELS[model], LAWS[law]

    @njit(cache=True)
    def slope(t: float, y: Array, numbers: Array, room: States) -> Array:
        return _rate(model_tag, law_tag, y, numbers, room)

    @njit(cache=True)
    def slopes(t: float, y: Array, numbers: Array, room: States, sizes: Array) -> Array:
        size = y.shape[0]
        here, there, jacobian = _rate(model_tag, law_tag, y, numbers, room), y.copy(), np.empty((size, size))
        for j in range(size):
            there[j] = y[j] + _NUDGE * sizes[j]
            moved = _rate(model_tag, law_tag, there, numbers, room)
            for i in range(size):
                jacobian[i, j] = (moved[i] - here[i]) / (there[j] - y[j])
            there[j] = y[j]
        return jacobian

    return slope, slopes


@njit(cache=True)
def _states(model: Any, numbers: Array, solution: Array, states: States) -> None:
    for k in range(states.shape[0]):
        _put(model, numbers, solution[k], states[k])


def prepare(scene: Scene, model: str, method: str, samples: int, tolerance: float) -> Callable[[], Path]:
    """Return a function that solves the scene's motion by a method of METHODS.

    samples: equal parts of the duration, after each of which the state is known. tolerance [1]: SciPy's rtol. Raises
    InputError for an unknown name or a number out of range.
    """
    solve = METHODS[validation.choice("method", method, METHODS)]
    validation.choice("model", model, MODELS)
    tolerance = validation.number("tolerance", tolerance, "1", above=0)
    times = np.linspace(0.0, scene.duration, validation.count("samples", samples) + 1)
    sizes, launch = _sizes(scene, model), start_of(scene, model)
    given = _given(scene, model, launch)

    def run() -> Path:
        solution, evaluations = _solved(solve, _start(launch, model), times, tolerance, sizes, given)
        states = np.zeros(len(times), STATE)
        _states(MODELS[model], given[2], solution, states)
        return Path(states, evaluations, evaluations)

    return run


def unfit(scene: Scene, model: str) -> str | None:
    """Return None: every scene and model can be represented."""
    return None


def versions() -> str:
    """Return the engine's name and version."""
    return f"scipy {scipy.__version__}"


def start(scene: Scene, model: str, launch: States, h: float, tolerance: float, most: int = schemes.BUDGET) -> Lsoda:
    """Return a run of LSODA from a launch, shape (1,), told every h [s]; tolerance [1]: SciPy's rtol.

    most: force evaluations, after which it ends.
    """
    return Lsoda(scene, model, launch, h, tolerance, most)


class Lsoda:
    """One run, standing where `advance` left it."""

    def __init__(self, scene: Scene, model: str, launch: States, h: float, tolerance: float, most: int) -> None:
        """Take the scene's numbers, and the state of the launch, shape (1,)."""
        self._model, self._h, self._tolerance, self._left = model, h, tolerance, most
        self._sizes, self._y = _sizes(scene, model), _start(launch, model)
        self._slope, slopes, numbers, room = _given(scene, model, launch)
        self._given: Given = self._counted, slopes, numbers, room

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        times: Array = self._h * every * np.arange(len(states) + 1.0)
        before = self._left
        try:
            solution, evaluations = _solved(_lsoda, self._y, times, self._tolerance, self._sizes, self._given)
        except _SpentError:
            solution, evaluations = np.full((len(times), len(self._y)), np.nan), before
        _states(MODELS[self._model], self._given[2], solution[1:], states)
        self._y = solution[-1]
        return evaluations

    def _counted(self, t: float, y: Array, numbers: Array, room: States) -> Array:
        """Return dy/dt. Between two of these Python sees a signal, which within odeint it does not."""
        self._left -= 1
        if self._left < 0:
            raise _SpentError
        return self._slope(t, y, numbers, room)


class _SpentError(Exception):
    """All evaluations that were allowed are done."""


def _solved(
    solve: Callable[[Array, Array, float, Array, Given], Solution],
    start: Array,
    times: Array,
    tolerance: float,
    sizes: Array,
    given: Given,
) -> Solution:
    """Return what a method of METHODS finds, shape (time, component): not-a-number from where it fails on."""
    whole = np.full((len(times), len(start)), np.nan)
    if not np.isfinite(start).all():
        return whole, 0
    with warnings.catch_warnings():  # a run that fails is a result
        warnings.simplefilter("ignore")
        solution, evaluations = solve(start, times, tolerance, sizes, given)
    whole[: len(solution)] = solution
    return whole, evaluations


def _given(scene: Scene, model: str, launch: States) -> Given:
    """Return what the equations of motion of a scene and model need besides the time and the solution."""
    numbers: Array = np.array([*physics_of(scene), *launch["node_offset"].ravel()])
    return *equations(model, scene.ground.contact), numbers, np.zeros(1, STATE)


def _start(launches: States, model: str) -> Array:
    (launch,) = launches
    parts = [launch["position"], launch["velocity"]]
    if model in TURNING:
        parts += [[1.0, 0.0, 0.0, 0.0], launch["angular_momentum"]]
    return np.concatenate(parts)


def _sizes(scene: Scene, model: str) -> Array:
    """Return a natural size of each component; see the module's words."""
    physics = physics_of(scene)
    energy = sum(float(part[0]) for part in energies(physics, start_of(scene, model)))
    energy = max(energy, physics.mass * physics.gravity * physics.radius)
    sizes = [physics.radius] * 3 + [math.sqrt(2 * energy / physics.mass)] * 3
    if model in TURNING:
        sizes += [1.0] * 4 + [math.sqrt(2 * energy * physics.inertia)] * 3
    return np.array(sizes, float)


def _dop853(start: Array, times: Array, tolerance: float, sizes: Array, given: Given) -> Solution:
    slope, _, numbers, room = given
    evaluations = 0

    def counted(t: float, y: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        return slope(t, y, numbers, room)

    solver = ode(counted)
    absolute = float(ABSOLUTE * tolerance * sizes.min())  # it takes one for all
    solver.set_integrator("dop853", rtol=tolerance, atol=absolute, nsteps=_MOST_STEPS)
    solver.set_initial_value(start, times[0])
    solution = [start]
    for time in times[1:]:
        reached = solver.integrate(time)
        if not solver.successful():
            break
        solution.append(reached)
    return np.array(solution), evaluations


def _lsoda(start: Array, times: Array, tolerance: float, sizes: Array, given: Given) -> Solution:
    slope, _, numbers, room = given
    solution, told = odeint(
        slope,
        start,
        times,
        args=(numbers, room),
        tfirst=True,
        rtol=tolerance,
        atol=ABSOLUTE * tolerance * sizes,
        mxstep=_MOST_STEPS,
        full_output=True,
    )
    done = told["message"] == "Integration successful."
    return solution if done else solution[:1], int(told["nfe"][-1])


def _radau(start: Array, times: Array, tolerance: float, sizes: Array, given: Given) -> Solution:
    slope, slopes, numbers, room = given
    found = solve_ivp(
        lambda t, y: slope(t, y, numbers, room),
        (times[0], times[-1]),
        start,
        method="Radau",
        t_eval=times,
        rtol=tolerance,
        atol=ABSOLUTE * tolerance * sizes,
        jac=lambda t, y: slopes(t, y, numbers, room, sizes),
    )
    return found.y.T, int(found.nfev + (len(start) + 1) * found.njev)


METHODS: dict[str, Callable[[Array, Array, float, Array, Given], Solution]] = {
    "dop853": _dop853,
    "lsoda": _lsoda,
    "radau": _radau,
}
