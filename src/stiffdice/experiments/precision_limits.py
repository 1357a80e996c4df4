"""What double precision itself cannot do, whatever the scheme: predicted from a scene, and found in this code.

Each limit is one number. The measured one is the edge between two outcomes of this code's runs or sums, by bisection in
its logarithm: each of these outcomes changes just once. The growth of round-off is that of the distance between two
runs that start a few units in the last place apart.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable

import numpy as np
import xarray as xr

from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import bisected, coordinates, quantity, result
from stiffdice.experiments.placement import STARTS, contact_frequency, fall_speed, height_above, level, relaunched
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import Run, simulate

MODEL, SCHEME = "sliding", "symplectic_euler"
LARGEST = float(np.finfo(float).max)

# Units in the last place between the launches of a pair: one may be lost where the flight goes higher.
_APART = 16

Found = tuple[float, float]  # predicted, measured


def measure(
    scene: Scene, *, stiffness: float = 1.0e6, omega_h: float = 0.3, coarse: int = 10, members: int = 64
) -> xr.Dataset:
    """Return limits of a scene on level ground, gated, without damping and friction, predicted and measured.

    stiffness [kg/s²], omega_h [1]: of the bounces through which round-off is followed. coarse: in so many steps of the
    scene's duration the run begins whose first contact is to leave the range. members: pairs of runs, spread over the
    phase of the touch-down, whose growth is averaged in its logarithm. Dimension limit.
    Raises InputError for a number out of range and for a scene without gravity, or not launched up from above the
    ground.
    """
    stiffness = validation.number("stiffness", stiffness, "kg/s²", above=0)
    omega_h = validation.number("omega_h", omega_h, "1", above=0)
    coarse, members = validation.count("coarse", coarse), validation.count("members", members)
    bare = level(scene, damping=0.0, friction=0.0)
    (_, _, z), (_, _, up), gravity, mass = bare.launch.position, bare.launch.velocity, bare.gravity, bare.cube.mass
    if not (gravity > 0 and up > 0 and height_above(bare) > 0 and omega_h < 1):
        raise InputError("allowed are launches up from above the ground, under gravity, and omega_h < 1")
    stiff, still = bare.with_ground(stiffness=stiffness), relaunched(bare, velocity=(0.0, 0.0, 0.0))
    # Each has a unit of its own, which no `units` could say of all.
    found: dict[str, tuple[str, Found]] = {
        "spring_at_rest": ("kg s-2", _spring_at_rest(bare)),
        "sag_in_height": ("kg s-2", _sag_in_height(bare)),
        "spring_at_deepest": ("1", _spring_at_deepest(stiff)),
        "way_in_place": ("s", _unchanged(bare, "position", float(np.spacing(z)) / 2 / up)),
        "pull_in_speed": ("s", _unchanged(bare, "velocity", _half_unit(up) / gravity)),
        # The first step falls by g h².
        "first_fall": ("s", _unchanged(still, "position", math.sqrt(_half_unit(z) / gravity))),
        "growth": ("1", _growth(stiff, omega_h, members)),
        "square_of_frequency": ("kg s-2", _found(LARGEST / 4 * mass, lambda stiff: 4 * stiff / mass < math.inf)),
        "first_contact": ("kg s-2", _first_contact(bare, coarse)),
    }
    predicted, measured = zip(*(pair for _, pair in found.values()), strict=True)
    variables = coordinates(limit=found) | {
        "predicted": quantity("limit", list(predicted), "limit by its formula, in the unit that limit_units names"),
        "measured": quantity("limit", list(measured), "limit found in this code, in the unit that limit_units names"),
    }
    note = "ground: level, gated, without damping and friction; stiffness as the limit says"
    units = "; ".join(f"{name}: {unit}" for name, (unit, _) in found.items())
    told = {"bounce_stiffness": stiffness, "bounce_omega_h": omega_h, "coarse": coarse}
    title = "Limits of double precision"
    return result(variables, title, bare, MODEL, SCHEME, __name__, scene_note=note, limit_units=units, **told)


def _half_unit(value: float) -> float:
    """Return half a unit in the last place below a positive value: less, taken from it, is lost."""
    return float(value - np.nextafter(value, 0.0)) / 2


def _found(predicted: float, holds: Callable[[float], bool], factor: float = 1e3) -> Found:
    """Return a limit and the number up to which `holds` is true, to nine digits, within a factor of it."""
    low, high = predicted / factor, min(predicted * factor, LARGEST)
    assert holds(low)
    assert not holds(high)
    return predicted, bisected(holds, low, high, relative=1e-9, logarithmic=True)[0]


def _run(scene: Scene, h: float, steps: int, every: int | None = None) -> Run:
    there = dataclasses.replace(scene, duration=h * steps)
    return simulate(there, model=MODEL, scheme=SCHEME, steps=steps, every=every or steps)


def _spring_at_rest(scene: Scene) -> Found:
    """½ S d² of four nodes at d = m g/(4S) is (m g)²/(8S); half a unit in the last place of m g z is lost in it."""
    weight, side = scene.cube.mass * scene.gravity, scene.cube.side
    predicted = weight**2 / 8 / _half_unit(weight * side / 2)

    def shows(stiffness: float) -> bool:
        ground = scene.with_ground(stiffness=stiffness)
        _, potential, _ = energies(physics_of(ground), start_of(STARTS["touching"](ground), MODEL))
        sag = weight / 4 / stiffness
        return bool(potential[0] - 4 * (stiffness * sag * sag / 2) != potential[0])

    return _found(predicted, shows, 1e6)


def _sag_in_height(scene: Scene) -> Found:
    """A cube at rest stands m g/(4S) lower than one that just touches."""
    predicted = scene.cube.mass * scene.gravity / 4 / _half_unit(scene.cube.side / 2)

    def shows(stiffness: float) -> bool:
        ground = scene.with_ground(stiffness=stiffness)
        return STARTS["at_rest"](ground).launch.position != STARTS["touching"](ground).launch.position

    return _found(predicted, shows, 1e6)


def _spring_at_deepest(scene: Scene) -> Found:
    """There the springs hold m v²/2 and the weight's work on the way, m g d: no stiffness lets them drown."""
    mass, gravity = scene.cube.mass, scene.gravity
    omega = contact_frequency(scene)
    fall, fast = _landing(scene)
    depth = gravity / omega**2 + math.hypot(gravity / omega**2, fast / omega)
    unit = float(np.spacing(mass * gravity * abs(scene.cube.side / 2 - depth)))
    h = 0.01 / omega
    run = _run(scene, h, math.ceil((fall + 3 / omega) / h), every=1)
    assert run.trajectory is not None
    return (mass * fast**2 / 2 + mass * gravity * depth) / unit, float(run.trajectory.elastic_energy.max()) / unit


def _landing(scene: Scene) -> Found:
    """Return when [s] and how fast [m/s] the launch lands."""
    fast = fall_speed(scene, height_above(scene))
    return (scene.launch.velocity[2] + fast) / scene.gravity, fast


def _unchanged(scene: Scene, part: str, predicted: float) -> Found:
    """Return up to which step size [s] a step leaves the vertical part of the launch as it is."""
    value = getattr(scene.launch, part)[2]
    return _found(predicted, lambda h: _run(scene, h, 1).end[part][0, 2] == value)


def _growth(scene: Scene, omega_h: float, members: int) -> Found:
    """Round-off in the place at touch-down is one of phase α = d/(hv), hence of e², of the speed out, of the flight.

    With θ the angle of a step, 2 sin(θ/2) = ωh, and κ the fraction of a step in π/θ, the place after lift-off is
    β = κ − α steps, or one more, and e² − 1 = (ωh)²(β(1 − β) − α(1 − α)): its slope in α is 2(ωh)²κ, or −2(ωh)²(1 − κ)
    for the part κ of all phases. A speed v e at lift-off changes the flight by 2 v δe/g, and the next place by v times
    that. So a bounce multiplies by v ω² h/g times 2κ or 2(1 − κ): their mean is taken in the logarithm.
    """
    omega = contact_frequency(scene)
    h = omega_h / omega
    fall, fast = _landing(scene)
    kappa = math.modf(math.pi / (2 * math.asin(omega_h / 2)))[0]
    predicted = fast * omega * omega_h / scene.gravity * (2 * (1 - kappa)) ** kappa * (2 * kappa) ** (1 - kappa)
    flight = 2 * fast / scene.gravity
    x, y, z = scene.launch.position
    logs = []
    for member in range(members):
        height = z + member / members * fast * h
        pair = [relaunched(scene, position=(x, y, at)) for at in (height, height + _APART * float(np.spacing(height)))]
        counts = (math.ceil((fall + (bounce - 0.5) * flight) / h) for bounce in (1, 3))
        speeds = [[_run(there, h, steps).end["velocity"][0, 2] for there in pair] for steps in counts]
        first, third = np.abs(np.diff(speeds)).ravel().tolist()
        if first > 0 and third > 0:  # or they have fallen together
            logs.append(math.log(third / first) / 2)
    return predicted, math.exp(float(np.mean(logs)))


def _first_contact(scene: Scene, coarse: int) -> Found:
    """The sum of all S d must be in range, and place and speed after the step of h/m times that, added."""
    h, up, low = scene.duration / coarse, scene.launch.velocity[2], height_above(scene)

    def height(steps: int) -> float:
        return low + steps * h * up - scene.gravity * h * h * steps * (steps + 1) / 2

    steps = next(k for k in itertools.count(1) if height(k) < 0)
    depth = -height(steps)
    depths = 4 * (depth + max(0.0, depth - scene.cube.side))
    predicted = LARGEST / depths / max(1.0, h / scene.cube.mass * (1 + h))

    def inside(stiffness: float) -> bool:
        run = _run(scene.with_ground(stiffness=stiffness), h, steps + 1)
        return bool(run.verdict[0] != Verdict.LEFT_NUMERIC_RANGE)

    return _found(predicted, inside)
