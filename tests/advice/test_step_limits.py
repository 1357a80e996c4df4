"""The longest steps on a ground: by theory where there is one, and no longer than what a bounce bears."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.advice import contact_design, step_limits
from stiffdice.advice.step_limits import bounces, limits
from stiffdice.dynamics import linear_theory


def contact(restitution, law="gated", speed=1.5):
    given = {"restitution": restitution, "stiffness": 2000.0}
    return contact_design.designed(given, mass=0.005, side=0.016, speed=speed, gravity=9.8, law=law)


@pytest.mark.parametrize("omega_h", [0.05, 0.3, 0.9])
def test_an_undamped_bounce_gains_what_theory_says(omega_h):
    undamped = contact(1.0)
    gain = np.nanmax(bounces(undamped, "symplectic_euler", omega_h / undamped.omega, 12).restitution) ** 2
    assert gain == pytest.approx(linear_theory.largest_gain(omega_h), rel=1e-9)


@pytest.mark.long
def test_no_step_is_longer_than_theory_allows():
    """At all phases the energy gained is (ωh)²/4 over 1 − (ωh)²/4 at the most, and nearly as much at some phase."""
    undamped = contact(1.0)
    found = limits(undamped, "symplectic_euler")
    bound = math.sqrt(4 * 0.05 / 1.05) / undamped.omega
    assert bound * 0.85 <= found.kept["energy"] <= bound * 1.2
    assert found.linear == pytest.approx(2 / (undamped.omega * math.sqrt(1.5)), rel=1e-12)  # rocking, 6 S/m


@pytest.mark.long
def test_implicit_steps_lose_half_pi_omega_h_and_never_gain():
    found, undamped = limits(contact(1.0), "implicit_euler"), contact(1.0)
    assert found.linear == found.kept["energy"] == math.inf
    assert found.kept["restitution_5"] * undamped.omega == pytest.approx(0.05 * 2 / math.pi, rel=0.2)
    assert found.kept["restitution_1"] * undamped.omega == pytest.approx(0.01 * 2 / math.pi, rel=0.2)


@pytest.mark.long
@pytest.mark.parametrize("law", ["gated", "ungated"])
@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.95])
def test_all_phases_keep_what_a_limit_promises(law, restitution):
    """At phases that were not tried, and at steps between those tried."""
    ground = contact(restitution, law)
    found = limits(ground, "symplectic_euler")
    for name in ("restitution_5", "restitution_1"):
        for part in (0.93, 0.31):
            off = np.abs(bounces(ground, "symplectic_euler", part * found.kept[name], 29).restitution / restitution - 1)
            assert off.max() <= 1.1 * step_limits.CRITERIA[name]


def test_the_path_of_an_exact_bounce_is_the_closed_form():
    """Until the cube lands again, by a scheme whose steps are exact in the contact."""
    for restitution in (0.1, 0.5, 1.0):
        ground = contact(restitution)
        found = bounces(ground, "exact", 0.1 / ground.omega, 4)
        assert found.restitution == pytest.approx(restitution, rel=1e-9)
        assert found.off.max() < 1e-9 * ground.scene.cube.radius


def test_drag_in_the_air_is_made_up_for_under_the_ungated_law():
    """A cube is thrown so much faster that it meets the ground at its speed."""
    ground = contact(0.5, "ungated")
    assert bounces(ground, "event", 0.1 / ground.omega, 3).restitution == pytest.approx(0.5, rel=1e-6)
