"""Where `apex` begins to hold, by the height from which rebounds count and by the duration of the run.

Under the `ungated` law a falling cube is braked in the air. A rebound from a height H returns, solved exactly, to
R(H) H: the lower H is, the shorter is the fall and the less it costs. Symplectic Euler multiplies the energy of a
bounce by up to `linear_theory.largest_gain`, so that a rebound goes higher than the one before as soon as R(H) · gain
exceeds 1 + tolerance: the lowest rebounds that count decide. Under the `gated` law R hardly depends on H.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.experiments.measuring import bisected, mapped, numbers, result, span
from stiffdice.scene import validation
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.criteria import apex
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "sliding", "symplectic_euler"

_CRITERIA = {"apex": apex.TOLERANCE}
_LARGEST_RATIO = apex.BASE + apex.TOLERANCE

# Values of ωh at which the gain is computed, evenly in the logarithm: the gain's own teeth are 1/n apart.
_FINE = 4000

_MEASURED = {"last_fail": ("smallest omega h of the scan at which the apex of a member rises", "1")}
_PREDICTED = {"predicted": ("smallest omega h at which a rebound from the hop height may rise", "1")}


def measure(
    scene: Scene,
    *,
    hop_height: Sequence[float] = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3),
    duration: Sequence[float] = (5.0, 10.0, 20.0, 40.0),
    omega_h: Sequence[float] = (0.25, 1.95),
    count: int = 160,
    members: int = 16,
) -> xr.Dataset:
    """Return the edge of `apex` in ωh, dimensions contact, duration and hop_height, and the predicted one.

    hop_height [m]: lower rebounds are not judged. duration [s]: of the runs. omega_h: ends of the scan; count: values
    in it, evenly in their logarithm. members: launches at each. `last_fail` is the smallest ωh at which a member fails;
    not-a-number where none does. Raises InputError for a number out of range.
    """
    heights = numbers("hop_height", hop_height, "m", at_least=0)
    durations = numbers("duration", duration, "s", above=0)
    low, high = span(omega_h, below=linear_theory.STABILITY_LIMIT)
    scan = np.geomspace(low, high, validation.count("count", count, at_least=2))
    members = validation.count("members", members)

    def last_fail(law: str, seconds: float, height: float) -> list[float]:
        there = dataclasses.replace(scene.with_ground(contact=law), duration=seconds)
        launches = turned(there, MODEL, members)
        judged: dict[str, Any] = {"criteria": _CRITERIA, "stop": _CRITERIA, "hop_height": height}
        for value in scan.tolist():
            steps = round(linear_theory.steps_for(there, value))
            started = phased(there, MODEL, steps, members, launches)
            run = simulate(there, model=MODEL, scheme=SCHEME, steps=steps, members=started, **judged)
            if (run.measures[apex.MEASURE] > _LARGEST_RATIO).any():
                return [linear_theory.omega_h(there, steps)]
        return [math.nan]

    fine = np.geomspace(0.01, linear_theory.STABILITY_LIMIT * (1 - 1e-9), _FINE).tolist()
    gains = [(value, linear_theory.largest_gain(value)) for value in fine]

    def predicted(law: str, height: float) -> list[float]:
        ratio = returned(scene.with_ground(contact=law), height)
        return [next((value for value, gain in gains if ratio * gain > _LARGEST_RATIO), math.nan)]

    found = mapped(last_fail, _MEASURED, contact=CONTACT_LAWS, duration=durations, hop_height=heights)
    found |= mapped(predicted, _PREDICTED, contact=CONTACT_LAWS, hop_height=heights)
    told = {"members": members, "criteria": dataset.criteria_text(_CRITERIA)}
    told["scene_note"] = "contact law and duration are the table's, not the scene's"
    return result(found, "Edge of apex by hop height and duration", scene, MODEL, SCHEME, __name__, **told)


def returned(scene: Scene, height: float) -> float:
    """Return R [1]: the part of a height [m] above touch-down that a flat cube, let go there, rises to again.

    Schemes aside: a fall in the drag of the contact law, and the exact restitution of the bounce. It rises freely.
    """
    if height == 0:
        return 1.0
    gravity, speed = scene.gravity, math.sqrt(2 * scene.gravity * height)
    drag = 8 * scene.ground.damping / scene.cube.mass if scene.ground.contact == "ungated" else 0.0

    def fallen(speed: float) -> float:
        """Return the height [m] −v/drag − g/drag² ln(1 − drag·v/g) of a fall from rest in v' = g − drag·v."""
        part = drag * speed / gravity
        if part < 1e-4:  # where the logarithm loses its digits, the first two terms of its series
            return speed**2 / (2 * gravity) * (1 + 2 * part / 3)
        return -gravity / drag**2 * (part + math.log1p(-part))

    if drag:
        speed = bisected(lambda speed: fallen(speed) < height, 0.0, min(speed, gravity / drag))[0]
    return (flat_bounce.restitution(scene, speed) * speed) ** 2 / (2 * gravity * height)
