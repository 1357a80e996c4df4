from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.integrators.linear_stability import STEPS, fewest_steps, half_turn_steps, hardest, stability_limit
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate


def scene(**ground):
    return from_mapping({"ground": {"stiffness": 1e6, "contact": "gated"} | ground})


def test_the_papers_ten_thousand_steps_are_the_limit_of_an_undamped_bounce():
    contact, drag = fewest_steps(scene(damping=0), "sliding", "symplectic_euler")
    assert contact == pytest.approx(10_000, rel=1e-12)
    assert drag == 0
    rocking, _ = fewest_steps(scene(damping=0), "tumbling", "symplectic_euler")
    assert rocking == pytest.approx(10_000 * math.sqrt(6 / 4), rel=1e-9)


@pytest.mark.parametrize("nodes", [4, 8], ids=["in contact", "in mid-air, ungated"])
@pytest.mark.parametrize(("scheme", "longest"), [("symplectic_euler", 2), ("forward_euler", 2), ("rk4", 2.7853)])
def test_far_over_damped_a_step_is_limited_by_its_damping_alone(nodes, scheme, longest):
    found = fewest_steps(scene(damping=1e5, stiffness=1.0, contact="ungated"), "sliding", scheme)
    assert found[0 if nodes == 4 else 1] == pytest.approx(nodes * 1e5 * 10 / longest, rel=1e-4)


def test_a_scheme_without_a_limit_needs_no_steps_and_one_that_is_never_stable_needs_all():
    for scheme in ("implicit_euler", "event", "exact"):
        assert fewest_steps(scene(), "sliding", scheme) == (0, 0)
    assert fewest_steps(scene(damping=0), "sliding", "forward_euler")[0] == math.inf
    assert fewest_steps(scene(), "flying", "symplectic_euler") == (0, 0)


@pytest.mark.parametrize("stiffness", [0.0, 1e-300, 1e-6, 1.0, 1e300])
@pytest.mark.parametrize("damping", [0.0, 1.0, 1e300])
def test_whatever_the_ground_the_answer_is_a_number(stiffness, damping):
    for model in ("sliding", "tumbling"):
        for found in fewest_steps(scene(stiffness=stiffness, damping=damping), model, "symplectic_euler"):
            assert found >= 0


def test_rocking_is_the_fastest_mode_of_a_solid_cube_and_bouncing_that_of_eight_masses():
    assert hardest(scene(), "tumbling").omega == pytest.approx(linear_theory.contact_frequency(1e6, 1.0, 6))
    heavy = from_mapping({"cube": {"mass": 4.0}, "ground": {"stiffness": 1e6, "contact": "gated"}})
    assert hardest(heavy, "tumbling").omega == pytest.approx(linear_theory.contact_frequency(1e6, 4.0, 6))
    corners = from_mapping({"cube": {"inertia": "corners"}, "ground": {"stiffness": 1e6}})
    assert hardest(corners, "tumbling").omega == linear_theory.contact_frequency(1e6, 1.0)


def test_half_a_turn_is_counted_for_each_momentum():
    momenta = np.array([[0, 0, 0], [3, 4, 0]]) * Scene().cube.moment_of_inertia
    np.testing.assert_allclose(half_turn_steps(Scene(), momenta), [0, 10 * 5 / math.pi])


@pytest.mark.parametrize(
    ("keys", "model", "steps", "verdict"),
    [
        ({"ground": {"damping": 0}}, "sliding", 9_999, Verdict.UNRESOLVED),
        ({"ground": {"damping": 0}}, "sliding", 10_001, Verdict.PASSED),
        ({"ground": {"damping": 0}, "launch": {"position": [0, 0, 4000]}}, "sliding", 9_999, Verdict.PASSED),
        ({"launch": {"position": [0, 0, 4000], "angular_momentum": [1e3, 0, 0]}}, "tumbling", 20_000, Verdict.PASSED),
        (
            {"launch": {"position": [0, 0, 4000], "angular_momentum": [1e5, 0, 0]}},
            "tumbling",
            20_000,
            Verdict.UNRESOLVED,
        ),
    ],
    ids=["too few", "enough", "no contact", "not quite half a turn", "three turns"],
)
def test_a_run_that_met_more_than_its_steps_resolve_does_not_pass(keys, model, steps, verdict):
    keys = {**keys, "ground": {"stiffness": 1e6, "contact": "gated"} | keys.get("ground", {})}
    for every in (None, steps):
        run = simulate(from_mapping(keys), model=model, steps=steps, every=every, criteria={"energy": 1e6})
        assert Verdict(run.ending[0]) == verdict
        assert Verdict(run.verdict[0]) == verdict


def flow(h, zeta):
    """The matrix that takes (x, v) of x'' = −x − 2ζx' from 0 to h: its exponential series."""
    motion = h * np.array([[0.0, 1.0], [-1.0, -2 * zeta]])
    term = found = np.eye(2)
    for k in range(1, 20):
        term = term @ motion / k
        found = found + term
    return found


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.5])
@pytest.mark.parametrize(("scheme", "order"), [("velocity_verlet", 2), ("rk4", 4)])
def test_the_linear_map_of_a_scheme_has_its_order(scheme, order, zeta):
    """Halving a step divides its error by 2^(order + 1)."""

    def error(h):
        step = STEPS[scheme](h * np.array([[0.0, 1.0], [-1.0, -2 * zeta]]))
        return np.abs(step - flow(h, zeta)).max()

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(order + 1, abs=0.1)


@pytest.mark.parametrize("zeta", [0.05, 0.3, 1.0, 4.0])
def test_forward_euler_is_stable_up_to_its_limit_and_no_further(zeta):
    def radius(h):
        return np.abs(np.linalg.eigvals(np.array([[1.0, h], [-h, 1 - 2 * zeta * h]]))).max()

    limit = stability_limit("forward_euler", zeta)
    assert radius(0.999 * limit) < 1 < radius(1.001 * limit)


@pytest.mark.parametrize(("scheme", "limit"), [("velocity_verlet", 2), ("rk4", 2 * math.sqrt(2))])
def test_undamped_limits_are_those_of_the_textbook(scheme, limit):
    assert stability_limit(scheme, 0.0) == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize("zeta", [0.0, 0.1, 0.7, 3.0])
def test_limits_are_those_of_theory(zeta):
    """Those of two schemes by a formula, of two by their polynomials: −1 is a root there (Verlet), or |R| = 1."""
    assert stability_limit("symplectic_euler", zeta) == linear_theory.stability_limit(zeta)
    forward = 2 * zeta if zeta <= 1 else 2 / (zeta + (zeta**2 - 1) ** 0.5)
    assert stability_limit("forward_euler", zeta) == pytest.approx(forward)
    q = stability_limit("rk4", zeta)
    root = q * (-zeta + 1j * np.emath.sqrt(1 - zeta**2))
    other = q * (-zeta - 1j * np.emath.sqrt(1 - zeta**2))
    sizes = [abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) for z in (root, other)]
    assert max(sizes) == pytest.approx(1, abs=1e-9)
    assert stability_limit("implicit_euler", zeta) == np.inf
    if zeta == 0:
        assert stability_limit("velocity_verlet", 0) == pytest.approx(2)
        assert q == pytest.approx(8**0.5)
