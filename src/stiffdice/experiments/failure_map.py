"""One number of a scene from nothing to far beyond use, against steps from 1 to 10⁹: where and how runs fail.

Every run ends with a verdict, and soon: it stops when it has blown up; free flight and, for a flat cube that slides
without friction, contact are taken in closed form (`fast_forward.py`); a cube that has not the energy to
leave the ground is decided. Friction leaves a flat cube's vertical motion alone, to the last bit: where it can only
take energy, a run has the verdict of its twin without friction. A run that needs more than its budget is undecided.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import TOUCHING, TURNING, Array, start_of
from stiffdice.errors import InputError
from stiffdice.integrators.linear_stability import fewest_steps, half_turn_steps
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.outcome import BLOW_UP, Verdict
from stiffdice.simulation.run import Run, simulate

SCHEME = "symplectic_euler"

# The spin of the axis `spin` is about this direction: along no edge and no diagonal of the cube.
_SPIN_ABOUT = np.array([1.0, 2.0, 3.0]) / math.sqrt(14)


def _with_mass(scene: Scene, mass: float) -> Scene:
    return dataclasses.replace(scene, cube=dataclasses.replace(scene.cube, mass=mass))


def _with_radius(scene: Scene, radius: float) -> Scene:
    """Return the scene with a true cube of this radius [m], launched as high above the ground as the scene's own."""
    cube = dataclasses.replace(scene.cube, radius=radius, geometry="exact")
    return _at_clearance(dataclasses.replace(scene, cube=cube), _clearance(scene))


def _with_spin(scene: Scene, rate: float) -> Scene:
    x, y, z = (float(part) for part in _SPIN_ABOUT * rate * scene.cube.moment_of_inertia)
    return dataclasses.replace(scene, launch=dataclasses.replace(scene.launch, angular_momentum=(x, y, z)))


def _clearance(scene: Scene) -> float:
    """Return how far above the ground the lowest node is at the launch [m]."""
    nodes = start_of(scene, "sliding")["node_offset"][0]
    return float(((nodes + scene.launch.position) @ np.array(scene.ground.normal)).min())


def _at_clearance(scene: Scene, clearance: float) -> Scene:
    """Return the scene moved along the ground's normal until its lowest node is so high above the ground [m]."""
    normal, place = np.array(scene.ground.normal), np.array(scene.launch.position)
    # The height anew, not a difference: it shall be exact to the last bit on level ground.
    height = clearance - float((start_of(scene, "sliding")["node_offset"][0] @ normal).min())
    x, y, z = (float(part) for part in place - normal * (normal @ place) + normal * height)
    launch = dataclasses.replace(scene.launch, position=(x, y, z))
    return dataclasses.replace(scene, launch=launch)


def _still(scene: Scene, clearance: float) -> Scene:
    still = dataclasses.replace(scene.launch, velocity=(0.0, 0.0, 0.0), angular_momentum=(0.0, 0.0, 0.0))
    return _at_clearance(dataclasses.replace(scene, launch=still), clearance)


STARTS: Mapping[str, Callable[[Scene], Scene]] = {
    "launch": lambda scene: scene,
    "at_rest": lambda scene: _still(scene, -min(linear_theory.sag(scene), scene.cube.side)),
    "touching": lambda scene: _still(scene, 0.0),
    "deep": lambda scene: _still(scene, -scene.cube.side / 2),
    "far_below": lambda scene: _still(scene, -3 * scene.cube.side),
}


class Axis(NamedTuple):
    """One number of a scene, its values, and how a scene gets one of them. kept: what does not change with it."""

    long_name: str
    units: str
    values: Sequence[float]
    placed: Callable[[Scene, float], Scene]
    kept: str


def _decades(first: int, last: int) -> list[float]:
    return [float(f"1e{exponent}") for exponent in range(first, last + 1)]


AXES: dict[str, Axis] = {
    "stiffness": Axis(
        "ground stiffness",
        "kg s-2",
        [0.0, *_decades(-6, 16)],
        lambda scene, value: scene.with_ground(stiffness=value),
        "all else as in the scene",
    ),
    "damping": Axis(
        "ground damping",
        "kg s-1",
        [0.0, *_decades(-3, 12)],
        lambda scene, value: scene.with_ground(damping=value),
        "all else as in the scene",
    ),
    "friction": Axis(
        "friction coefficient",
        "1",
        [0.0, *_decades(-3, 3)],
        lambda scene, value: scene.with_ground(friction=value),
        "all else as in the scene",
    ),
    "mass": Axis("mass of the cube", "kg", _decades(-9, 9), _with_mass, "ground and launch as in the scene"),
    "radius": Axis(
        "radius of the cube, exact geometry",
        "m",
        _decades(-9, 9),
        _with_radius,
        "the launch keeps its velocity and the height of the lowest node above the ground",
    ),
    "spin": Axis("rate of spin at the launch", "rad s-1", [0.0, *_decades(-2, 12)], _with_spin, "its axis"),
    "start": Axis(
        "start",
        "1",
        range(len(STARTS)),
        lambda scene, value: list(STARTS.values())[int(value)](scene),
        "all but `launch` start without motion: lowest node as at rest, touching, half a side deep, three sides deep",
    ),
}

# About two a decade, and but for the ends not round: a step that is a whole fraction of all else in a scene is special.
STEPS = tuple(np.logspace(0, 9, 20).round().tolist())

# What theory says of the steps a value needs, or may have: `limit_steps`.
LIMITS = ("contact", "drag", "turn", "stall")


def measure(
    scene: Scene,
    *,
    axis: str = "stiffness",
    model: str = "sliding",
    values: Sequence[float] = (),
    steps: Sequence[float] = STEPS,
    budget: int = 10_000_000,
) -> xr.Dataset:
    """Return the verdict of each value of one axis at each number of steps, under both contact laws.

    axis: a name of AXES. values: of that axis, in its units; its own if none are given, and always for `start`.
    budget: most steps to compute one by one for a run; one that needs more is undecided.
    Dimensions contact, value, steps; theory's limits have limit, contact, value.

    Raises InputError for an unknown name, a number out of range, and a spin of a cube that does not turn.
    """
    chosen = AXES[validation.choice("axis", axis, AXES)]
    validation.choice("model", model, MODELS)
    if axis == "spin" and model not in TURNING & TOUCHING:
        raise InputError(f"model = {model}: allowed for axis spin is {' or '.join(sorted(TURNING & TOUCHING))}")
    if axis == "start" and values:
        raise InputError("values: not for axis start, whose values have names")
    span = [validation.number("values", value, chosen.units) for value in values] or list(chosen.values)
    counts = [validation.count("steps", count) for count in steps]
    budget = validation.count("budget", budget)
    placed = [[chosen.placed(scene.with_ground(contact=law), value) for value in span] for law in LAWS]
    runs = [[[_run(there, model, count, budget) for count in counts] for there in row] for row in placed]
    return _dataset(scene, axis, model, span, counts, budget, placed, runs)


def _run(scene: Scene, model: str, steps: int, budget: int) -> Run:
    if scene.ground.friction > 0 and model not in TURNING:
        twin = _run(scene.with_ground(friction=0.0), model, steps, budget)
        gained = twin.measures["energy_ratio"][0] > 1 + 1e-9
        if _only_takes(scene, steps) and not gained and twin.verdict[0] != Verdict.UNDECIDED:
            return twin
    return simulate(scene, model=model, scheme=SCHEME, steps=steps, stop={"energy": BLOW_UP - 1.0}, budget=budget)


def _only_takes(scene: Scene, steps: int) -> bool:
    """Return whether friction cannot add to the energy of a flat cube launched into the air on level ground.

    A step changes the sliding speed from v to |v − k v/(v + cutoff)| <= max(v, k), k = mu h push/m. So it never
    exceeds the launch's if k does not. The push: 4 g m at most for the weight, S d and D u for the deepest and the
    fastest that the fall from the launch's top allows; all that doubled, for steps that are not short.
    """
    cube, ground, (along_x, along_y, along_z) = scene.cube, scene.ground, scene.launch.velocity
    h, omega = scene.duration / steps, linear_theory.contact_frequency(ground.stiffness, cube.mass)
    drag = 8 * ground.damping / cube.mass
    clearance = _clearance(scene)
    level = ground.normal == (0.0, 0.0, 1.0) and scene.launch.orientation == (0.0, 0.0, 0.0) and clearance > 0
    if not level or omega * h > 0.25 or drag * h > 0.99:
        return False
    fall = math.sqrt(along_z**2 + 2 * scene.gravity * clearance)
    fastest = fall + scene.gravity * (min(scene.duration, 1 / omega) if omega > 0 else scene.duration)
    push = 4 * scene.gravity + 2 * omega * fall + drag * fastest
    return 2 * ground.friction * h * push <= math.hypot(along_x, along_y)


def _limits(scene: Scene, model: str) -> list[float]:
    """Return the steps at each of LIMITS; not-a-number where it does not apply.

    contact, drag: `linear_stability.fewest_steps`. turn: half a turn in a step. stall: more steps than these move the
    launch by less than half a unit in the last place of its height.
    """
    contact, drag = fewest_steps(scene, model, SCHEME)
    turn = float(half_turn_steps(scene, np.array(scene.launch.spin))) if model in TURNING else 0.0
    normal = np.array(scene.ground.normal)
    height, speed = abs(normal @ scene.launch.position), abs(normal @ scene.launch.velocity)
    stall = 2 * speed * scene.duration / np.spacing(height)
    return [part if part > 0 else math.nan for part in (contact, drag, turn, float(stall))]


def _dataset(
    scene: Scene,
    axis: str,
    model: str,
    values: Sequence[float],
    steps: Sequence[int],
    budget: int,
    placed: Sequence[Sequence[Scene]],
    runs: Sequence[Sequence[Sequence[Run]]],
) -> xr.Dataset:
    grid = ("contact", "value", "steps")

    def of_runs(kind: type, pick: Callable[[Run], Any]) -> Array:
        return np.array([[[pick(run) for run in row] for row in part] for part in runs], kind)

    omega_h = [[linear_theory.omega_h(there, count) for count in steps] for there in placed[0]]
    limits = np.array([[_limits(there, model) for there in row] for row in placed])
    variables: dict[str, Any] = {
        "verdict": (grid, of_runs(np.int8, lambda run: run.verdict[0]), dataset.VERDICT_ATTRIBUTES),
        "steps_done": (grid, of_runs(np.int64, lambda run: run.steps_done[0]), dataset.STEPS_DONE_ATTRIBUTES),
        "steps_computed": (
            grid,
            of_runs(np.int64, lambda run: run.steps_computed[0]),
            dataset.STEPS_COMPUTED_ATTRIBUTES,
        ),
        "omega_h": (grid[1:], omega_h, dataset.CELL_ATTRIBUTES["omega_h"]),
        "limit_steps": (
            ("limit", *grid[:2]),
            np.moveaxis(limits, -1, 0),
            {
                "long_name": "steps at a limit by theory: fewest for contact, drag, turn, most for stall",
                "units": "1",
            },
        ),
    } | {
        name: (grid, of_runs(float, _measure_of(name)), dataset.MEASURE_ATTRIBUTES[name])
        for name in ("energy_ratio", "apex_ratio")
    }
    attributes = dataset.provenance_attributes(
        f"Verdicts from nothing to far beyond use: {axis}", scene, model, SCHEME, "stiffdice.experiments.failure_map"
    )
    attributes |= {
        "axis": axis,
        "kept": AXES[axis].kept,
        "budget": budget,
        "criteria": dataset.criteria_text(runs[0][0][0].tolerances),
        "scene_note": f"contact law and {axis} are the cell's, not the scene's",
    }
    return xr.Dataset(variables, _coordinates(axis, values, steps), attributes)


def _measure_of(name: str) -> Callable[[Run], float]:
    return lambda run: float(run.measures[name][0])


def _coordinates(axis: str, values: Sequence[float], steps: Sequence[int]) -> dict[str, Any]:
    chosen = AXES[axis]
    if axis == "start":
        value = np.array(values, np.int8), enum_attributes(chosen.long_name, list(STARTS))
    else:
        value = np.array(values, float), {"long_name": chosen.long_name, "units": chosen.units}
    return {
        "contact": ("contact", np.arange(len(LAWS), dtype=np.int8), dataset.CONTACT_ATTRIBUTES),
        "value": ("value", *value),
        "steps": ("steps", np.array(steps, np.int64), dataset.CELL_ATTRIBUTES["steps"]),
        "limit": ("limit", np.arange(len(LIMITS), dtype=np.int8), enum_attributes("limit by theory", LIMITS)),
    }
