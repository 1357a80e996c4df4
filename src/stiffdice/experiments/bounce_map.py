"""One bounce: the energy that it gains or loses, by ωh and by the phase of the step in which it meets the ground.

An undamped cube without friction comes down flat on a `gated` ground, without gravity, and leaves it again: the contact
law gives back what it took, e² = 1, and all that differs is the time step's. What is found, at all ωh < 2:

- 1 − ¼(ωh)² <= e² <= 1/(1 − ¼(ωh)²). So no bounce loses more than ¼(ωh)²; one gains up to ¼(ωh)²/(1 − ¼(ωh)²), which is
  ¼(ωh)² where ωh is small.
- Both bounds are attained, and only half way between two magic steps, ωh = 2 sin(π/(2k + 1)) = √3, 1.176, 0.868, ...:
  the gain by a node that touches the ground at a step (phase 0), the loss half a step later. Between these steps the
  largest gain is `linear_theory.largest_gain`, always at phase 0, and the largest loss takes e² to its inverse. For
  small ωh that is |e²−1| = (ωh)² f(1 − f), f being the fraction that half a period has beyond whole steps. Above √3 the
  bound is out of reach: it grows without end towards ωh = 2, the largest e² to 9.
- At the magic steps ωh = 2 sin(π/2n) every phase conserves energy to round-off.
- The mean of 1/e² over the phases is 1, because a step conserves areas of place and velocity; so the mean of e² is not
  below 1. Off the magic steps bounces of random phase heat a cube on average, though only by O((ωh)⁴).

Gravity makes a contact longer than half a period, and at a magic step e² is off by up to 2gh/v, v being the speed at
the ground: measured a second time, with the scene's gravity, at the speed with which the scene's launch meets it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array, Ensemble, start_of
from stiffdice.errors import InputError
from stiffdice.experiments import options
from stiffdice.experiments.layout import Variable, of_cells, quantity
from stiffdice.experiments.placement import contact_frequency, landing_speed, level
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "sliding", "symplectic_euler"

# A contact is π/(ωh) steps long.
_LOWEST = 0.01
# Gravity over the acceleration that stops the cube, g/(ωv): the cube must not be back before the run ends.
_WEIGHT = 0.1


def measure(
    scene: Scene, *, omega_h: Sequence[float] = (0.02, 1.98), count: int = 600, phases: int = 200
) -> xr.Dataset:
    """Return what single bounces gain and lose, dimensions omega_h and phase.

    scene: gives the cube, the stiffness, gravity, and the speed with which its launch, in free fall, would meet level
    ground; the experiment sets all else. omega_h: ends of the span, between 0 and 2. count: values in it, evenly in
    their logarithm, to which all magic steps of the span and those half way between them are added. phases: how many,
    evenly over a step from 0 on; the phase is how much of the step has passed when the node meets the ground.
    `energy_gain` is e²−1, without gravity; `largest_with_gravity` that of the largest size with the scene's.

    Raises InputError for a number out of range, and for a scene whose cube would not bounce flat and short.
    """
    low, high = options.span(omega_h, _LOWEST, linear_theory.STABILITY_LIMIT)
    magic = linear_theory.magic_steps(low, high)
    between = [linear_theory.magic_step(n - 0.5) for n in (*magic, max(magic, default=1) + 1)]
    count = validation.count("count", count, at_least=2)
    scan = options.scan(low, high, count, [*magic.values(), *between])
    phase = np.arange(validation.count("phases", phases)) / phases
    omega, speed = contact_frequency(scene), landing_speed(scene)
    if scene.gravity > _WEIGHT * omega * speed:
        most = _WEIGHT * omega * speed
        raise InputError(f"gravity = {scene.gravity:g}: allowed is at most {_WEIGHT:g} ω v = {most:.3g} [m/s²]")
    heavy = level(scene, friction=0.0, damping=0.0)
    weightless = dataclasses.replace(heavy, gravity=0.0)
    gain, weighed = (
        np.array([_gain(there, speed, value / omega, phase) for value in scan]) for there in (weightless, heavy)
    )
    attributes = dataset.provenance_attributes("Energy of single bounces", scene, MODEL, SCHEME, __name__)
    attributes["scene_note"] = (
        "launch, damping and friction are the experiment's, not the scene's, and gravity is off but for "
        "largest_with_gravity; ground: level, gated"
    )
    return xr.Dataset(
        _by_omega_h(gain, weighed, scan, 2 * scene.gravity * (scan / omega) / speed)
        | {
            "energy_gain": quantity(
                ("omega_h", "phase"), gain, "e^2 - 1 of one bounce without damping, friction and gravity"
            ),
            "speed": quantity((), speed, "speed at which the cube meets the ground", "m s-1"),
        },
        {
            "omega_h": of_cells("omega_h", scan),
            "phase": quantity("phase", phase, "fraction of the step before the node meets the ground"),
        },
        attributes,
    )


def _by_omega_h(gain: Array, weighed: Array, scan: Array, gravity_theory: Array) -> dict[str, Variable]:
    described = {
        "largest_gain": (gain.max(axis=1), "largest energy gain over the phases"),
        "smallest_gain": (gain.min(axis=1), "smallest energy gain over the phases"),
        "mean_gain": (gain.mean(axis=1), "mean energy gain over the phases"),
        "largest_gain_theory": (
            [linear_theory.largest_gain(value) - 1 for value in scan],
            "largest energy gain by theory",
        ),
        "gain_bound": ([linear_theory.gain_bound(value) - 1 for value in scan], "1/(1 - (omega h)^2/4) - 1"),
        "loss_bound": (scan**2 / 4, "(omega h)^2/4, the bound of a loss, and of a gain where omega h is small"),
        "largest_with_gravity": (
            np.abs(weighed).max(axis=1),
            "largest size of the energy gain over the phases, with the scene's gravity",
        ),
        "gravity_theory": (gravity_theory, "2 g h/v, the size that gravity gives it at a magic step"),
    }
    return {name: quantity("omega_h", *pair) for name, pair in described.items()}


def _gain(scene: Scene, speed: float, h: float, phase: Array) -> Array:
    """Return e²−1 of one bounce at each phase, from the kinetic energy at zero height, before and after."""
    omega = contact_frequency(scene)
    # Weight lengthens the contact from half a period by twice the angle it takes up to the sag.
    contact = (math.pi + 2 * math.atan(scene.gravity / (omega * speed))) / (2 * math.asin(omega * h / 2))
    steps = 4 + math.ceil(contact)
    height = speed * h * (1 + phase)
    downward = np.sqrt(speed**2 - 2 * scene.gravity * height)
    lag = schemes.LAGS[SCHEME] * h * scene.gravity
    launches = np.repeat(start_of(dataclasses.replace(scene, launch=Launch(velocity=(0, 0, 0))), MODEL), len(phase))
    launches["position"][:, 2] = scene.cube.side / 2 + height
    launches["velocity"][:, 2] = lag - downward
    shorter = dataclasses.replace(scene, duration=h * steps)
    members = Ensemble(launches, np.zeros(len(phase)))
    end = simulate(shorter, model=MODEL, scheme=SCHEME, steps=steps, members=members).end
    left = end["position"][:, 2] - scene.cube.side / 2
    assert left.min() > 0, "in the air again"
    upward = end["velocity"][:, 2] - lag
    gain: Array = (upward**2 + 2 * scene.gravity * left) / speed**2 - 1
    return gain
