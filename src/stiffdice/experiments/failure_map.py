"""One number of a scene from nothing to far beyond use, against steps from 1 to 10⁹: where and how runs fail.

Every run ends with a verdict, and soon: it stops when it has blown up; free flight and, for a flat cube that slides
without friction, contact are taken in closed form (`fast_forward.py`); a cube that has not the energy to
leave the ground is decided. Friction leaves a flat cube's vertical motion alone, to the last bit: where it can only
take energy, a run has the verdict of its twin without friction. A run that needs more than its budget is undecided.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import TOUCHING, TURNING
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result
from stiffdice.experiments.placement import STARTS, at_clearance, clearance, contact_frequency, fall_speed, relaunched
from stiffdice.integrators.linear_stability import fewest_steps, half_turn_steps
from stiffdice.scene import validation
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.criteria.registry import tolerances_of
from stiffdice.simulation.outcome import BLOW_UP, Verdict
from stiffdice.simulation.run import Run, simulate

SCHEME = "symplectic_euler"

# The spin of the axis `spin` is about this direction: along no edge and no diagonal of the cube.
_SPIN_ABOUT = np.array([1.0, 2.0, 3.0]) / math.sqrt(14)


def _with_cube(scene: Scene, **cube: Any) -> Scene:
    return dataclasses.replace(scene, cube=dataclasses.replace(scene.cube, **cube))


def _with_radius(scene: Scene, radius: float) -> Scene:
    """Return the scene with a true cube of this radius [m], launched as high above the ground as the scene's own."""
    return at_clearance(_with_cube(scene, radius=radius, geometry="exact"), clearance(scene))


def _with_spin(scene: Scene, rate: float) -> Scene:
    momentum = _SPIN_ABOUT * rate * scene.cube.moment_of_inertia
    return relaunched(scene, angular_momentum=tuple(momentum.tolist()))


class Axis(NamedTuple):
    """One number of a scene, its values, and how a scene gets one of them, all else as it was; none: by its ground."""

    long_name: str
    units: str
    values: Sequence[Any]
    placed: Callable[[Scene, Any], Scene] | None = None


def _decades(first: int, last: int) -> list[float]:
    return [float(f"1e{exponent}") for exponent in range(first, last + 1)]


AXES: dict[str, Axis] = {
    "stiffness": Axis("ground stiffness", "kg s-2", [0.0, *_decades(-6, 16)]),
    "damping": Axis("ground damping", "kg s-1", [0.0, *_decades(-3, 12)]),
    "friction": Axis("friction coefficient", "1", [0.0, *_decades(-3, 3)]),
    "mass": Axis("mass of the cube", "kg", _decades(-9, 9), lambda scene, mass: _with_cube(scene, mass=mass)),
    "radius": Axis("radius of the cube, exact geometry", "m", _decades(-9, 9), _with_radius),
    "spin": Axis("rate of spin at the launch", "rad s-1", [0.0, *_decades(-2, 12)], _with_spin),
    "start": Axis("start", "1", list(STARTS), lambda scene, name: STARTS[name](scene)),
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

    axis: stiffness, damping, friction, mass, radius, spin or start. values: of that axis, in its units; its own if none
    are given, and always for `start`. model: which motion. steps: numbers of time steps. budget: most steps to compute
    one by one for a run; one that needs more is undecided. Dimensions contact, value, steps; theory's limits have
    limit, contact, value.
    Raises InputError for an unknown name, a number out of range, and a spin of a cube that does not turn.
    """
    chosen = AXES[validation.choice("axis", axis, AXES)]
    if axis == "spin" and model not in TURNING & TOUCHING:
        raise InputError(f"model = {model}: allowed for axis spin is {' or '.join(sorted(TURNING & TOUCHING))}")
    if axis == "start" and values:
        raise InputError("values: not for axis start, whose values have names")
    span = numbers("values", values, chosen.units) or chosen.values
    counts = [validation.count("steps", value) for value in steps]
    budget = validation.count("budget", budget)

    def placed(law: str, value: Any) -> Scene:
        if chosen.placed is None:
            return scene.with_ground(contact=law, **{axis: value})
        return chosen.placed(scene.with_ground(contact=law), value)

    def verdict(law: str, value: Any, steps: int) -> list[np.int8]:
        return [_verdict(placed(law, value), model, steps, budget)]

    found = mapped(verdict, {"verdict": ("verdict", "1")}, contact=CONTACT_LAWS, value=span, steps=counts)
    found["verdict"][2].update(dataset.VERDICT_ATTRIBUTES)
    found["value"][2].update(long_name=chosen.long_name, units=chosen.units)
    limits = [[_limits(placed(law, value), model) for value in span] for law in CONTACT_LAWS]
    text = "steps at a limit by theory: fewest for contact, drag, turn, most for stall"
    found["limit_steps"] = quantity(("limit", "contact", "value"), np.moveaxis(np.array(limits), -1, 0), text)
    found |= coordinates(limit=LIMITS)
    told = {"axis": axis, "budget": budget, "criteria": dataset.criteria_text(tolerances_of(model))}
    told["scene_note"] = f"contact law and {axis} are the cell's, not the scene's"
    return result(found, f"Verdicts from nothing to far beyond use: {axis}", scene, model, SCHEME, __name__, **told)


def _verdict(scene: Scene, model: str, steps: int, budget: int) -> np.int8:
    if scene.ground.friction > 0 and model not in TURNING and _only_takes(scene, steps):
        twin = _run(scene.with_ground(friction=0.0), model, steps, budget)
        gained = twin.measures["energy_ratio"][0] > 1 + 1e-9
        if not gained and twin.verdict[0] != Verdict.UNDECIDED:
            return twin.verdict[0]
    return _run(scene, model, steps, budget).verdict[0]


def _run(scene: Scene, model: str, steps: int, budget: int) -> Run:
    return simulate(scene, model=model, scheme=SCHEME, steps=steps, stop={"energy": BLOW_UP - 1.0}, budget=budget)


def _only_takes(scene: Scene, steps: int) -> bool:
    """Return whether friction cannot add to the energy of a flat cube launched into the air on level ground.

    A step changes the sliding speed from v to |v − k v/(v + cutoff)| <= max(v, k), k = mu h push/m. So it never
    exceeds the launch's if k does not. The push: 4 g m at most for the weight, S d and D u for the deepest and the
    fastest that the fall from the launch's top allows; all that doubled, for steps that are not short.
    """
    ground, (along_x, along_y, _) = scene.ground, scene.launch.velocity
    h, omega = scene.duration / steps, contact_frequency(scene)
    drag, above = 8 * ground.damping / scene.cube.mass, clearance(scene)
    level = ground.normal == (0.0, 0.0, 1.0) and scene.launch.orientation == (0.0, 0.0, 0.0) and above > 0
    if not level or omega * h > 0.25 or drag * h > 0.99:
        return False
    fall = fall_speed(scene, above)
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
