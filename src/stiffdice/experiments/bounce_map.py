"""One bounce: the energy that it gains or loses, by ωh and by the phase of the step in which it meets the ground.

An undamped cube without friction comes down flat on a `gated` ground, without gravity, and leaves it again: the contact
law gives back what it took, e² = 1, and all that differs is the time step's. Its largest gain is
`linear_theory.largest_gain`, at phase 0, its largest loss takes e² to the inverse, and at the magic steps there is none
(docs/explanation/stability.md). Gravity makes a contact longer than half a period, and at a magic step e² is off by up
to 2gh/v, v being the speed at the ground: measured a second time, with the scene's gravity, at the speed with which the
scene's launch meets it.
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
from stiffdice.experiments.measuring import coordinates, mapped, quantity, result, scan, span
from stiffdice.experiments.placement import contact_frequency, landing_speed, level
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "sliding", "symplectic_euler"

# A contact is π/(ωh) steps long.
_LOWEST = 0.01
# Gravity over the acceleration that stops the cube, g/(ωv): the cube must not be back before the run ends.
_WEIGHT = 0.1

_GAINS = {
    "energy_gain": ("e^2 - 1 of one bounce without damping, friction and gravity", "1", "phase"),
    "largest_with_gravity": ("largest size of the energy gain over the phases, with the scene's gravity", "1"),
    "gravity_theory": ("2 g h/v, the size that gravity gives it at a magic step", "1"),
}


def measure(
    scene: Scene, *, omega_h: Sequence[float] = (0.02, 1.98), count: int = 600, phases: int = 200
) -> xr.Dataset:
    """Return what single bounces gain and lose, dimensions omega_h and phase.

    scene: gives the cube, the stiffness, gravity, and the speed with which its launch, in free fall, would meet level
    ground. omega_h: ends of the scan, between 0 and 2. count: values in it, evenly in their logarithm, besides all
    magic steps and those half way between them. phases: how many, evenly over a step from 0 on.
    `energy_gain` is e²−1, without gravity; `largest_with_gravity` that of the largest size with the scene's.
    Raises InputError for a number out of range, and for a scene whose cube would not bounce flat and short.
    """
    low, high = span(omega_h, _LOWEST, linear_theory.STABILITY_LIMIT)
    magic = linear_theory.magic_steps(low, high)
    between = [linear_theory.magic_step(n - 0.5) for n in (*magic, max(magic, default=1) + 1)]
    values = scan(low, high, validation.count("count", count, at_least=2), [*magic.values(), *between])
    phase = np.arange(validation.count("phases", phases)) / phases
    omega, speed = contact_frequency(scene), landing_speed(scene)
    if scene.gravity > (most := _WEIGHT * omega * speed):
        raise InputError(f"gravity = {scene.gravity:g}: allowed is at most {_WEIGHT:g} ω v = {most:.3g} [m/s²]")
    heavy = level(scene, friction=0.0, damping=0.0)
    weightless = dataclasses.replace(heavy, gravity=0.0)

    def gains(value: float) -> tuple[Array, float, float]:
        h = value / omega
        gain, weighed = (_gain(there, speed, h, phase) for there in (weightless, heavy))
        return gain, np.abs(weighed).max(), 2 * scene.gravity * h / speed

    found = mapped(gains, _GAINS, omega_h=values) | coordinates(phase=phase)
    found["speed"] = quantity((), speed, "speed at which the cube meets the ground", "m s-1")
    note = (
        "launch, damping and friction are the experiment's, not the scene's, and gravity is off but for "
        "largest_with_gravity; ground: level, gated"
    )
    return result(found, "Energy of single bounces", scene, MODEL, SCHEME, __name__, scene_note=note)


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
    return np.asarray((upward**2 + 2 * scene.gravity * left) / speed**2 - 1)
