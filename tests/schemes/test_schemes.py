"""One test for all schemes of what textbooks say of them."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice import theory
from stiffdice.scene import from_mapping
from stiffdice.schemes import SCHEMES
from stiffdice.simulate import simulate

# None: the error is set by a tolerance, and tested where the scheme is.
ORDER = {"symplectic_euler": 1, "event": None}


def at_rest(stiffness=100.0, damping=0.0, lift=0.0, duration=2.0):
    """A cube on soft ground that never leaves it: a damped oscillator, of frequency ω = √(4S/m)."""
    rest = 1.0352761804100830 / 2 - 9.8 / (4 * stiffness)
    return from_mapping(
        {
            "ground": {"stiffness": stiffness, "damping": damping, "friction": 0, "contact": "gated"},
            "launch": {"position": [0, 0, rest + lift], "velocity": [0, 0, 0]},
            "duration": duration,
        }
    )


def test_every_scheme_has_its_order_stated():
    assert set(ORDER) == set(SCHEMES)


@pytest.mark.parametrize("scheme", [name for name, order in ORDER.items() if order])
def test_order_of_convergence_on_a_smooth_problem(scheme):
    lift, scene = 0.01, at_rest(damping=1.0, lift=0.01)
    beta = 4 * scene.ground.damping / 2
    omega = np.sqrt(4 * scene.ground.stiffness - beta**2)

    def error(steps):
        kept = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=steps // 50).trajectory
        t = kept.time
        exact = lift * np.exp(-beta * t) * (np.cos(omega * t) + beta / omega * np.sin(omega * t))
        moved = kept.state["position"][:, 2] - (scene.launch.position[2] - lift)
        return np.sqrt(np.mean((moved - exact) ** 2))

    errors = [error(steps) for steps in (2000, 4000, 8000)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, ORDER[scheme], atol=0.1)


def test_symplectic_euler_in_free_flight_has_a_closed_form():
    """z_n = z_0 + n h w_0 − g h² n(n + 1)/2."""
    scene = from_mapping({"ground": {"contact": "gated"}, "duration": 1.0})
    kept = simulate(scene, model="sliding", steps=1000, every=1).trajectory
    n, h = kept.step, 1.0 / 1000
    np.testing.assert_allclose(kept.state["position"][:, 2], 3 + n * h * 5 - 9.8 * h * h * n * (n + 1) / 2, atol=1e-11)
    np.testing.assert_allclose(kept.state["velocity"][:, 2], 5 - 9.8 * n * h, atol=1e-11)


@pytest.mark.parametrize(("omega_h", "stable"), [(1.9, True), (1.99, True), (2.01, False), (2.1, False)])
def test_symplectic_euler_is_linearly_stable_up_to_two(omega_h, stable):
    scene = at_rest(lift=1e-9, duration=20.0)
    steps = round(theory.steps_for(scene, omega_h))
    kept = simulate(scene, model="sliding", steps=steps, every=1).trajectory
    swing = np.abs(kept.state["position"][:, 2] - (scene.launch.position[2] - 1e-9)).max()
    assert (swing < 1e-7) == stable


@pytest.mark.parametrize("zeta", [0.05, 0.2, 0.5])
@pytest.mark.parametrize(("margin", "stable"), [(0.98, True), (1.02, False)])
def test_explicit_damping_lowers_the_limit(zeta, margin, stable):
    """ωh < 2(√(1 + ζ²) − ζ)."""
    omega = np.sqrt(4 * 100.0)
    scene = at_rest(damping=zeta * 2 * omega / 4, lift=1e-9)
    limit = 2 * (np.sqrt(1 + zeta**2) - zeta)
    steps = int(np.ceil(theory.steps_for(scene, margin * limit)))
    kept = simulate(scene, model="sliding", steps=steps, every=1).trajectory
    speed = np.abs(kept.state["velocity"][:, 2])
    assert (speed[-3:].max() < speed[:5].max()) == stable


def bounced(omega_h, phase):
    """Return e² of one undamped bounce without gravity: a cube meets the ground at this ωh and phase of the step."""
    stiffness, speed = 1e4, 3.0
    h = omega_h / np.sqrt(4 * stiffness)
    half = 1.0352761804100830 / 2
    steps = 60
    scene = from_mapping(
        {
            "ground": {"stiffness": stiffness, "damping": 0, "friction": 0, "contact": "gated"},
            "launch": {"position": [0, 0, half + speed * h * (2 + phase)], "velocity": [0, 0, -speed]},
            "gravity": 0,
            "duration": h * steps,
        }
    )
    end = simulate(scene, model="sliding", steps=steps, every=1).trajectory.state["velocity"][-1, 2]
    return (end / speed) ** 2


@pytest.mark.parametrize("n", [2, 3, 4, 7, 12])
def test_magic_steps_conserve_a_bounces_energy_at_every_phase(n):
    energies = [bounced(2 * np.sin(np.pi / (2 * n)), phase) for phase in np.linspace(0.01, 0.99, 41)]
    np.testing.assert_allclose(energies, 1, rtol=0, atol=1e-11)


@pytest.mark.parametrize("omega_h", [0.15, 0.6, 0.9, 1.2, 1.6, 1.9])
def test_off_the_magic_steps_a_bounce_gains_up_to_the_known_bound(omega_h):
    energies = np.array([bounced(omega_h, phase) for phase in np.linspace(0.002, 0.998, 400)])
    bound = 1 / (1 - omega_h**2 / 4)
    assert energies.max() <= bound * (1 + 1e-12)
    assert energies.max() > 1 + 0.1 * (bound - 1)
