"""What any method makes of a stiff contact: a flat bounce, a cube at rest, a throw; and its steps a second.

`limits`: how long a step may be. Bounces are launched so that a step meets the ground at a chosen phase, and measured
by their restitution; a nudged cube at rest is measured by its largest distance from its place. `contact`: how a
method's contact maps onto the gated law, by the depth at rest, and a bounce without friction and with the scene's, over
the exact. What is off and becomes less with the step is the step's; what stays is the contact's.

`throw`: how far the scene's throw is from the reference over time. It is chaotic: at each landing the difference
between two runs grows. So it is compared while it is small, and a method's own convergence beside it. `speed`: what is
timed is stepping alone, one run at a time: each engine has built its model of the scene before. A method that takes
steps of its own is measured by its force evaluations.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.dynamics.state import STATE, Array, States, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result, scan, span
from stiffdice.experiments.placement import contact_frequency, landing_speed, level, upright
from stiffdice.experiments.timing import interleaved, machine
from stiffdice.experiments.work_precision.measure import EFFORTS
from stiffdice.experiments.work_precision.problems import PROBLEMS, SAMPLES, scene_of
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

FLAT_MODEL = "sliding"
# The paper's scheme, the one that is like what engines do to contacts, and the engines that are always there.
METHODS = ("symplectic_euler", "implicit_euler", "scipy", "numpy")

# What becomes of the cube, from mild to grave: it leaves the ground; it is still on it after so many contacts' time;
# with all nodes below it; or it left the range of doubles.
OUTCOMES = ("leaves", "stays", "sinks", "blows_up")
_PATIENCE = 5

# Magic steps, and those half way between them, are in the scan down to this number of steps in a contact.
_MAGIC = 8
# Of a cube at rest: the nudge in units of the sag, and the steps for which it is followed.
_NUDGE, _FOLLOWED = 0.01, 200
# Periods of the contact over which the depth of a cube at rest is averaged, and the ωh at which the exact contact is
# sampled.
_PERIODS, _FINE = 10, 0.002

_LIMITS = {
    "restitution": ("restitution of one flat bounce", "1", "phase"),
    "outcome": ("what becomes of the cube", "1", "phase"),
    "rest_growth": (f"growth of a nudge of a cube at rest in {_FOLLOWED} steps", "1"),
}
# By name: what `contact` stores of each method, over what is exact.
RATIOS = {
    "rest_depth": ("mean depth of a cube at rest over m g/(4S)", "1"),
    "restitution": ("restitution of a flat bounce without friction over the exact one", "1"),
    "contact_time": ("time below the surface in that bounce over the exact one", "1"),
    "rough_restitution": ("restitution of a sliding bounce with friction over the exact one, which is the same", "1"),
    "friction": ("horizontal over vertical impulse in that bounce, over mu", "1"),
}


def limits(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    omega_h: Sequence[float] = (0.02, 20.0),
    count: int = 37,
    phases: int = 12,
) -> xr.Dataset:
    """Return restitution and outcome of bounces, dimensions method, omega_h and phase; and the growth of a nudge.

    scene: gives the cube, gravity, stiffness, damping, and the speed at which its launch meets the ground, which is
    level, gated and without friction. methods: names of schemes and engines. omega_h: ends of the span. count: values
    in it, evenly in their logarithm, besides the longest magic steps and those half way between them. phases: how many,
    evenly over a step from 0 on. `restitution` is not-a-number unless the cube leaves the ground; `rest_growth` the
    largest distance from where it would rest over the nudge, infinite where it blows up.
    Raises InputError for a number out of range, an engine that is not installed, and a scene whose cube would not
    bounce flat and short.
    """
    names = engines.chosen_from(methods)
    special = [linear_theory.magic_step(n) for n in np.arange(1.5, _MAGIC + 1, 0.5)]
    values = scan(*span(omega_h), validation.count("count", count, at_least=2), special).tolist()
    phase = np.arange(validation.count("phases", phases)) / phases
    smooth = flat(scene, friction=0.0)
    speed, omega, sag = landing_speed(smooth), contact_frequency(scene), linear_theory.sag(scene)

    def fates(method: str, value: float) -> tuple[list[float], list[int], float]:
        h, nudge = value / omega, _NUDGE * sag
        bounces = [bounce(method, smooth, speed, h, part) for part in phase.tolist()]
        heights = _heights_at_rest(method, smooth, h, _FOLLOWED, nudge)
        away = float(np.abs(heights - (scene.cube.side / 2 - sag)).max()) / nudge
        outcomes = [OUTCOMES.index(part.outcome) for part in bounces]
        return [part.restitution for part in bounces], outcomes, away if math.isfinite(away) else math.inf

    found = mapped(fates, _LIMITS, method=names, omega_h=values) | coordinates(phase=phase)
    dimensions, outcome, _ = found["outcome"]
    found["outcome"] = dimensions, outcome.astype(np.int8), enum_attributes("what becomes of the cube", OUTCOMES)
    found["exact_restitution"] = quantity((), flat_bounce.restitution(smooth, speed), "exact restitution")
    told = engines.attributes(names) | {"scene_note": "ground: level, gated, without friction; an upright cube"}
    return result(found, "The longest steps", scene, FLAT_MODEL, "method", __name__, **told)


def contact(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    stiffness: Sequence[float] = (1e4, 1e6),
    damping: Sequence[float] = (0.0, 0.1, 10.0),
    omega_h: Sequence[float] = (0.1, 0.02),
    phases: int = 4,
) -> xr.Dataset:
    """Return RATIOS, dimensions method, stiffness, damping, omega_h; not-a-number where a cube does not leave.

    scene: gives the cube, gravity, friction, and the speeds of the launch; the ground is level and gated. methods:
    names of schemes and engines. stiffness [kg/s²], damping [kg/s]: of the ground. omega_h [1]: contact frequency times
    step size. phases: of the step at touch-down, over which a bounce is averaged.
    Raises InputError for a number out of range, an engine that is not installed, and a scene whose cube would not
    bounce flat and short, or stops sliding in the bounce.
    """
    names = engines.chosen_from(methods)
    axes = {
        "stiffness": numbers("stiffness", stiffness, "kg/s²", above=0),
        "damping": numbers("damping", damping, "kg/s", at_least=0),
        "omega_h": numbers("omega_h", omega_h, "1", above=0),
    }
    phases = validation.count("phases", phases)

    def ratios(method: str, stiffness: float, damping: float, omega_h: float) -> tuple[float, ...]:
        rough = flat(scene, stiffness=stiffness, damping=damping)
        h, speed, mu = omega_h / contact_frequency(rough), landing_speed(rough), rough.ground.friction
        restitution, contact_time = _exact(rough)
        smooth = rough.with_ground(friction=0.0)
        (e, time, _), (rough_e, _, slowed) = (
            np.mean([bounce(method, there, speed, h, k / phases)[1:] for k in range(phases)], axis=0)
            for there in (smooth, rough)
        )
        steps = math.ceil(_PERIODS * 2 * math.pi / (contact_frequency(rough) * h))
        depth = scene.cube.side / 2 - float(np.mean(_heights_at_rest(method, smooth, h, steps)))
        slowed = slowed / mu if mu else 1.0
        return depth / linear_theory.sag(rough), e / restitution, time / contact_time, rough_e / restitution, slowed

    found = mapped(ratios, RATIOS, method=names, **axes)
    note = "ground: level, gated, stiffness and damping as the dimensions say; an upright cube"
    told = engines.attributes(names) | {"scene_note": note}
    return result(found, "Contacts over the exact ones", scene, FLAT_MODEL, "method", __name__, **told)


@cache
def _exact(scene: Scene) -> tuple[float, float]:
    """Return the restitution and the time below the surface [s] that are exact, of a cube that slides all the while."""
    speed, smooth, along = landing_speed(scene), scene.with_ground(friction=0.0), scene.launch.velocity[0]
    # Friction takes at most 2 mu times the speed down.
    if not (scene.launch.velocity[1] == 0 and along > 4 * scene.ground.friction * speed):
        raise InputError("launch.velocity: allowed is one along x, above 4 mu times the speed at the ground [m/s]")
    followed = bounce("exact", smooth, speed, _FINE / contact_frequency(scene), 0.5)
    return flat_bounce.restitution(smooth, speed), followed.contact_time


def flat(scene: Scene, **ground: float) -> Scene:
    """Return the scene on level ground under the `gated` law, with an upright cube and these numbers of the ground."""
    return upright(level(scene, **ground), node_velocity="rigid")


def _heights_at_rest(method: str, scene: Scene, h: float, steps: int, nudge: float = 0.0) -> Array:
    """Return the centre's heights [m] in steps of h [s], of a cube put where it would rest, or a nudge [m] above."""
    height = scene.cube.side / 2 - linear_theory.sag(scene) + nudge
    launch = Launch((0.0, 0.0, height), (0.0, 0.0, 0.0), node_velocity="rigid")
    resting = dataclasses.replace(scene, launch=launch, duration=steps * h)
    states = np.zeros(steps, STATE)
    engines.adapter_of(method)(resting, FLAT_MODEL, start_of(resting, FLAT_MODEL), h).advance(states, 1)
    return np.asarray(states["position"][:, 2])


class Bounce(NamedTuple):
    """What came of a bounce; numbers are not-a-number unless the cube leaves the ground.

    restitution [1]: speed up over speed down at the surface. contact_time [s]: for how long the lowest nodes were below
    the surface, by straight lines between the states. slowed [1]: horizontal over normal impulse, the weight's part
    being the ground's, too; friction's mu, if the cube slides throughout.
    """

    outcome: str
    restitution: float = math.nan
    contact_time: float = math.nan
    slowed: float = math.nan


def bounce(method: str, scene: Scene, speed: float, h: float, phase: float) -> Bounce:
    """Return what becomes of a flat cube that comes down at a speed [m/s], in steps of h [s].

    scene: of `flat`. phase [1]: how much of a step has passed when the lowest nodes meet the surface.
    """
    half, gravity, (x, y, _) = scene.cube.side / 2, scene.gravity, scene.launch.velocity
    height, lag = speed * h * (1 + phase), engines.adapter_of(method).LAG * h * gravity
    if 2 * gravity * height >= speed**2:
        raise InputError(f"omega_h: a step of {h:.3g} s is too long for a fall that ends at {speed:.3g} m/s")
    down = math.sqrt(speed**2 - 2 * gravity * height) - lag
    placed = Launch((0.0, 0.0, half + height), (x, y, -down), node_velocity="rigid")
    chunk = 3 + math.ceil(1.2 * (math.pi / contact_frequency(scene)) / h)
    scene = dataclasses.replace(scene, launch=placed, duration=h * (chunk * _PATIENCE))
    states, outcome = start_of(scene, FLAT_MODEL), "stays"
    engine = engines.adapter_of(method)(scene, FLAT_MODEL, states, h)
    while outcome == "stays" and len(states) <= chunk * _PATIENCE:
        more = np.zeros(chunk, STATE)
        engine.advance(more, 1)
        states = np.concatenate([states, more])
        outcome = _outcome(scene, states[-1])
    if outcome != "leaves":
        return Bounce(outcome)
    low = states["position"][:, 2] - half
    # The slope of the path, which the velocity is behind: in the air by gravity's pull.
    leaving = math.sqrt((states["velocity"][-1, 2] - lag) ** 2 + 2 * gravity * low[-1])
    contact_time = _below(low) * h
    slowed = states["velocity"][0, 0] - states["velocity"][-1, 0]
    return Bounce("leaves", leaving / speed, contact_time, float(slowed / (leaving + speed + gravity * contact_time)))


def _outcome(scene: Scene, last: States) -> str:
    low = last["position"][2] - scene.cube.side / 2
    if not (np.isfinite(last["position"]).all() and np.isfinite(last["velocity"]).all()):
        return "blows_up"
    if low > 0 and last["velocity"][2] > 0:
        return "leaves"
    return "sinks" if low < -scene.cube.side else "stays"


def _below(heights: Array) -> float:
    """Return for how many steps a line through these heights, one a step, is below zero."""
    before, after = heights[:-1], heights[1:]
    share = np.where(before < 0, before, after) / np.where(before == after, 1.0, np.abs(after - before))
    return float(np.where((before < 0) & (after < 0), 1.0, np.abs(share) * ((before < 0) ^ (after < 0))).sum())


THROW_MODEL, REFERENCE = "tumbling", "event"
THROWN = ("symplectic_euler", "scipy", "numpy")
# The problems that `speed` times.
TIMED = ("flat-bounce", "tumbling-throw")

# Of the reference, and of the run that says how far it can be trusted.
_FINEST, _COARSER = schemes.FINEST, 1e-10

# A method's efforts, from the least: parts of its steps, or tolerances of one that takes its own.
_PARTS = (64, 16, 4, 1)
_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-11)

_THROW = {
    "position": ("centre of mass", "m", "effort", "time", "axis"),
    "distance": ("distance of the centre from the reference", "m", "effort", "time"),
    "steps": (*EFFORTS["steps"], "effort"),
    "tolerance": (*EFFORTS["tolerance"], "effort"),
    "evaluations": ("evaluations of the force", "1", "effort"),
}


def throw(scene: Scene, *, methods: Sequence[str] = THROWN, steps: float = 4e7, samples: int = 400) -> xr.Dataset:
    """Return where the cube is, dimensions method, effort, time, axis, and its distance from the reference.

    methods: names of schemes and engines; one that cannot represent the scene is left out, and `unfit` says why.
    steps: of the simplest scheme at the most; of another so many less as its steps take longer (`Peer.dearness`).
    samples: equal parts of the duration, after which states are compared.
    `reference_error` is how far the reference is from the same at a thousand times its tolerance.
    Raises InputError for a number out of range, an engine that is not installed, and a scene that none can represent.
    """
    samples = validation.count("samples", samples)
    most = validation.number("steps", steps, "1", at_least=samples)
    reasons = {name: engines.adapter_of(name).unfit(scene, THROW_MODEL) for name in engines.chosen_from(methods)}
    names = [name for name, why in reasons.items() if why is None]
    if not names:
        raise InputError(f"methods: none of them can represent the scene: {'; '.join(map(str, reasons.values()))}")

    def path(method: str, steps: int, tolerance: float) -> tuple[Array, int]:
        found = engines.ready(method, scene, THROW_MODEL, steps, samples, tolerance)()()
        return found.states["position"], found.evaluations

    (reference, _), (coarser, _) = (path(REFERENCE, samples, size) for size in (_FINEST, _COARSER))

    def efforts(method: str) -> tuple[Any, ...]:
        own, finest = engines.METHODS[method].own_steps, most / engines.METHODS[method].dearness
        counts = [samples * max(1, round(finest / part / samples)) for part in _PARTS]
        tried = [(samples, size) for size in _TOLERANCES] if own else [(count, np.nan) for count in counts]
        places, evaluations = zip(*(path(method, *effort) for effort in tried), strict=True)
        with np.errstate(all="ignore"):  # a run that blew up
            distance = np.linalg.norm(np.array(places) - reference, axis=-1)
        steps, tolerances = zip(*tried, strict=True)
        return places, distance, np.zeros_like(steps) if own else steps, tolerances, evaluations

    time = np.arange(samples + 1) / samples * scene.duration
    found = mapped(efforts, _THROW, method=names) | coordinates(time=time, axis=dataset.AXES)
    apart = np.linalg.norm(coarser - reference, axis=-1)
    found["reference_position"] = quantity(("time", "axis"), reference, "centre of mass by the reference", "m")
    found["reference_error"] = quantity("time", apart, "distance of the reference from a coarser one", "m")
    unfit = "; ".join(f"{name}: {why}" for name, why in reasons.items() if why is not None)
    told = engines.attributes(names) | {"reference": REFERENCE, "unfit": unfit}
    return result(found, "The throw in every engine", scene, THROW_MODEL, "method", __name__, **told)


def speed(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    steps: int = 6_000,
    affordable: float = 0.5,
    rounds: int = 9,
) -> xr.Dataset:
    """Return median times of runs [s] and what they took, dimensions problem, method; not-a-number where one is unfit.

    scene: the problems of TIMED are made of it, at its own stiffness. methods: names of schemes and engines. steps:
    of each run of the scene's duration. affordable [s]: a longer run is timed once. rounds: in each every run is timed.
    Raises InputError for a number out of range, and an engine that is not installed.
    """
    names = engines.chosen_from(methods)
    steps = SAMPLES * max(1, validation.count("steps", steps) // SAMPLES)
    affordable, rounds = validation.number("affordable", affordable, "s", above=0), validation.count("rounds", rounds)
    seconds, spread, taken = np.full((3, len(TIMED), len(names)), np.nan)
    for p, problem in enumerate(PROBLEMS[name] for name in TIMED):
        there = scene_of(problem, scene, scene.ground.stiffness)
        fit = [k for k, name in enumerate(names) if engines.adapter_of(name).unfit(there, problem.model) is None]
        starts = [engines.ready(names[k], there, problem.model, steps, SAMPLES) for k in fit]
        counted = [start()().evaluations for start in starts]  # what is not compiled yet is now
        taken[p, fit] = np.where([engines.METHODS[names[k]].own_steps for k in fit], counted, steps)
        seconds[p, fit], spread[p, fit] = interleaved(starts, rounds, affordable)
    grid = ("problem", "method")
    variables = coordinates(problem=TIMED, method=names) | {
        "seconds": quantity(grid, seconds, "median wall time of a run, started before", "s"),
        "spread": quantity(grid, spread, "half the range between the quartiles of the times over their median"),
        "taken": quantity(grid, taken, "steps of the run; force evaluations of one that takes its own steps"),
    }
    told = engines.attributes(names) | machine() | {"steps": steps, "samples": SAMPLES, "rounds": rounds}
    return result(variables, "Steps a second", scene, "problem", "method", __name__, **told)
