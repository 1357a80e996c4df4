"""Head-on, two flush cubes are a mass on a spring and a dashpot: the reduced mass m₁m₂/(m₁ + m₂), 4S and 4D."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stiffdice.dynamics.box_contact.pair_state import pair_start_of
from stiffdice.scene import flat_landing
from stiffdice.scene.pair import from_mapping
from stiffdice.simulation.pair import reference

SPEED, DEEP = 1.0, 4e-16  # at the first instant a damped contact must have begun


def flush(masses, stiffness, zeta):
    reduced = masses[0] * masses[1] / sum(masses)
    damping = zeta * math.sqrt(stiffness * reduced)
    places = ([-0.5 + DEEP, 0, 0], [0.5, 0, 0])
    speeds = ([SPEED * masses[1] / sum(masses), 0, 0], [-SPEED * masses[0] / sum(masses), 0, 0])
    cubes = [
        {"cube": {"side": 1, "mass": m}, "launch": {"position": [x, y, z + 50], "velocity": v}}
        for m, (x, y, z), v in zip(masses, places, speeds, strict=True)
    ]
    ground = {"stiffness": stiffness, "damping": damping, "friction": 0.3}
    return from_mapping({"cubes": cubes, "ground": ground, "gravity": 0})


def closing(y):
    return y[3] - y[16]


def parted(scene):
    """Speed apart when the force ends, and how long that took."""
    launch, ground = pair_start_of(scene), scene.ground

    def force(_time, y):
        return ground.stiffness * (y[0] - y[13] + 1) + ground.damping * closing(y)

    force.terminal, force.direction = True, -1
    omega = 2 * math.sqrt(ground.stiffness * sum(1 / cube.mass for cube in scene.cubes))
    limits = {"rtol": 1e-13, "atol": 1e-16, "max_step": 0.02 / omega}
    slope = reference.slope_of(scene, launch)
    found = solve_ivp(slope, (0, 8 / omega), reference.start_of(launch), method="DOP853", events=force, **limits)
    (time,), (end,) = found.t_events[0], found.y_events[0]
    return -closing(end), time * omega


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.4, 1.0, 1.8])
@pytest.mark.parametrize(("masses", "stiffness"), [((1.0, 1.0), 1e4), ((1.0, 7.0), 1e4), ((0.02, 3.0), 1e2)])
def test_restitution_is_the_exact_one_of_the_reduced_mass(masses, stiffness, zeta):
    speed, duration = parted(flush(masses, stiffness, zeta))
    np.testing.assert_allclose(speed / SPEED, math.exp(-flat_landing.loss("gated", zeta)), rtol=1e-12)
    np.testing.assert_allclose(duration, flat_landing.duration("gated", zeta), rtol=1e-9)
