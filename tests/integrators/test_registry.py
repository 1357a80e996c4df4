"""One test for all schemes of what textbooks say of them."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Ensemble, start_of
from stiffdice.integrators.registry import LAGS, SCHEMES, unfit
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.outcome import BLOW_UP, Verdict
from stiffdice.simulation.run import simulate

# On a smooth motion; None for a scheme that has no order in the step because it controls its own error, or is exact,
# and is tested otherwise.
ORDER = {"symplectic_euler": 1, "forward_euler": 1, "velocity_verlet": 2, "rk4": 4, "implicit_euler": 1}
ORDER |= {"exact": None, "event": None}

# Of a flat bounce, on the average over the phase of the step at touch-down: with damping, and without. The gated law's
# damping sets in with a jump somewhere within a step, which costs O(h) in any scheme; without damping the force has a
# kink there, which costs O(h²). Symplectic Euler gains an order without either damping or gravity: its places are then
# those of velocity Verlet.
CONTACT_ORDER = {
    "symplectic_euler": (1, 2),
    "forward_euler": (1, 1),
    "velocity_verlet": (1, 2),
    "rk4": (1, 2),
    "implicit_euler": (1, 1),
}

HALF = 1.0352761804100830 / 2  # of the side

ordered = pytest.mark.parametrize("scheme", [scheme for scheme in SCHEMES if ORDER.get(scheme) is not None])


def at_rest(stiffness=100.0, damping=0.0, lift=0.0, duration=2.0):
    """A cube on soft ground that never leaves it: a damped oscillator, of frequency ω = √(4S/m)."""
    rest = HALF - 9.8 / (4 * stiffness)
    return from_mapping(
        {
            "ground": {"stiffness": stiffness, "damping": damping, "friction": 0, "contact": "gated"},
            "launch": {"position": [0, 0, rest + lift], "velocity": [0, 0, 0]},
            "duration": duration,
        }
    )


def test_every_scheme_has_its_order_stated():
    assert set(ORDER) == set(SCHEMES)
    assert set(CONTACT_ORDER) == {scheme for scheme, order in ORDER.items() if order is not None}


def orders(errors):
    """How often an error halves from each to the next, the steps being halved."""
    return np.log2(np.array(errors[:-1]) / errors[1:])


@ordered
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

    found = orders([error(steps) for steps in (2000, 4000, 8000)])
    np.testing.assert_allclose(found, ORDER[scheme], atol=0.1)


def rocking_and_twirling():
    """A cube that slides, rocks and spins on its face and never lifts a corner: friction and damping, all smooth."""
    launch = {
        "position": [0, 0, HALF - 9.8 / 400],
        "velocity": [5, 1, 0],
        "orientation": [0.01, -0.015, 0.3],
        "angular_momentum": [0.02, 0.01, 0.6],
        "node_velocity": "rigid",
    }
    ground = {"stiffness": 100, "damping": 1.0, "friction": 0.05, "contact": "gated"}
    return from_mapping({"ground": ground, "launch": launch, "duration": 0.5})


@ordered
@pytest.mark.long
def test_order_of_convergence_of_a_turning_cube(scheme):
    """Against rk4 at steps so fine that its own error, by its order, is round-off."""

    def states(steps, scheme):
        kept = simulate(rocking_and_twirling(), scheme=scheme, steps=steps, every=steps // 10).trajectory
        assert (np.sort(kept.state["node_offset"][:, :, 2] + kept.state["position"][:, 2:], axis=1)[:, 3] < 0).all()
        return kept.state

    fine = states(6400, "rk4")
    errors = {name: [] for name in ("position", "velocity", "angular_momentum", "node_offset")}
    for steps in (100, 200, 400) if ORDER[scheme] > 2 else (800, 1600, 3200):
        found = states(steps, scheme)
        for name, error in errors.items():
            error.append(np.abs(found[name] - fine[name]).max())
    for name, error in errors.items():
        np.testing.assert_allclose(orders(error), ORDER[scheme], atol=0.1, err_msg=name)


def missed(scheme, damping, steps, members=64):
    """Return how far from its exact place a cube is after a flat bounce, RMS over phases of the step [m]."""
    stiffness, speed, duration = 100.0, 3.0, 1.0
    ground = {"stiffness": stiffness, "damping": damping, "friction": 0, "contact": "gated"}
    launch = {"position": [0, 0, HALF + 0.3], "velocity": [0, 0, -speed]}
    scene = from_mapping({"ground": ground, "launch": launch, "gravity": 0, "duration": duration})
    higher = speed * duration / steps * (np.arange(members) + 0.5) / members
    launches = np.repeat(start_of(scene, "sliding"), members)
    launches["position"][:, 2] += higher
    ensemble = Ensemble(launches, np.zeros(members))
    end = simulate(scene, model="sliding", scheme=scheme, steps=steps, members=ensemble).end

    # The contact ends where the force does, at S d = D u.
    beta = 2 * damping
    omega = np.sqrt(4 * stiffness - beta**2)
    lasts = (np.pi - np.arctan2(2 * beta * omega, omega**2 - beta**2)) / omega
    sine, cosine, left = np.sin(omega * lasts), np.cos(omega * lasts), np.exp(-beta * lasts)
    place, up = -speed / omega * left * sine, -speed * left * (cosine - beta / omega * sine)
    exact = HALF + place + up * (duration - (0.3 + higher) / speed - lasts)
    return np.sqrt(np.mean((end["position"][:, 2] - exact) ** 2))


@ordered
@pytest.mark.long
def test_order_under_contact(scheme):
    for damping, order in zip((1.0, 0.0), CONTACT_ORDER[scheme], strict=True):
        errors = [missed(scheme, damping, steps) for steps in (250, 16_000)]
        found = np.log2(errors[0] / errors[1]) / np.log2(16_000 / 250)
        assert found == pytest.approx(order, abs=0.05), damping


@pytest.mark.parametrize("scheme", SCHEMES)
def test_free_flight_is_exact_at_any_step(scheme):
    """The spin by hand; the place on a parabola, of which the velocity is the slope LAG steps before."""
    launch = {"position": [0, 0, 30], "velocity": [5, -1, 5], "angular_momentum": [0.9, -0.5, 2.0]}
    scene = from_mapping({"ground": {"contact": "gated"}, "launch": launch, "duration": 2.0})
    for model in ("sliding", "tumbling"):
        if unfit(scheme, scene, model):
            continue
        end = simulate(scene, model=model, scheme=scheme, steps=7, every=7).trajectory.state[-1]
        slope = np.array([5, -1, 5 - 9.8 * LAGS[scheme] * 2 / 7])
        path = [0, 0, 30] + 2 * slope - [0, 0, 9.8 * 2.0**2 / 2]
        np.testing.assert_allclose(end["position"], path, rtol=0, atol=1e-13 * 30)
        np.testing.assert_allclose(end["velocity"], [5, -1, 5 - 9.8 * 2], rtol=1e-14)
        spin = np.array(launch["angular_momentum"]) / scene.cube.moment_of_inertia * (model == "tumbling")
        turned = rotated(scene.cube.node_offsets(), 2.0 * spin)
        np.testing.assert_allclose(end["node_offset"], turned, rtol=0, atol=1e-13)
        np.testing.assert_array_equal(end["angular_velocity"], spin)


CONTACTS = [
    ("sliding", "gated", 0),
    ("sliding", "gated", 0.3),
    pytest.param("tumbling", "gated", 0.3, marks=pytest.mark.long),
    pytest.param("sliding", "ungated", 0.3, marks=pytest.mark.long),
]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("model", "contact", "friction"), CONTACTS)
def test_what_is_known_at_once_is_what_stepping_finds(scheme, model, contact, friction):
    ground = {"stiffness": 1e3, "damping": 0.5, "friction": friction, "contact": contact}
    launch = {"velocity": [3, 1, 4], "angular_momentum": [0.3, 0.5, -0.2]}
    scene = from_mapping({"ground": ground, "launch": launch, "duration": 2.5})
    if unfit(scheme, scene, model):
        pytest.skip(f"{scheme} is not for {model}")
    once, stepped = (simulate(scene, model=model, scheme=scheme, steps=5000, every=every) for every in (None, 5000))
    assert stepped.steps_computed[0] == 5000
    assert once.steps_computed[0] < (4000 if contact == "ungated" else 1000)
    close = 1e-6 if model == "tumbling" else 1e-9  # round-off grows where friction and corners meet
    for name in ("position", "velocity", "angular_momentum", "node_offset"):
        np.testing.assert_allclose(once.end[name], stepped.end[name], rtol=0, atol=close, err_msg=name)
    for name, measure in stepped.measures.items():
        np.testing.assert_allclose(once.measures[name], measure, rtol=close, atol=1e-12, err_msg=name)
    each = {"symplectic_euler": 1, "forward_euler": 1, "velocity_verlet": 2, "rk4": 4, "implicit_euler": 1}
    if ORDER[scheme] is not None:
        assert once.evaluations[0] == each[scheme] * once.steps_computed[0]


@ordered
def test_no_scheme_is_held_at_rest_by_anothers_proof(scheme):
    """Swinging by half its sag, undamped: symplectic Euler never lets the cube leave, forward Euler does."""
    sag = 9.8 / 400
    scene = at_rest(lift=-0.5 * sag, duration=4.0)  # ωh = 0.027, by which forward Euler swings 2.9 times as far
    stop = {"energy": BLOW_UP - 1}
    once, stepped = (
        simulate(scene, model="sliding", scheme=scheme, steps=3000, every=every, stop=stop) for every in (None, 3000)
    )
    assert once.verdict[0] == stepped.verdict[0]
    assert (once.steps_done[0] == 1) == (scheme == "symplectic_euler")
    assert (stepped.measures["apex_ratio"][0] > 0) == (scheme == "forward_euler")
    assert (once.verdict[0] == Verdict.PASSED) == (scheme != "forward_euler")


@pytest.mark.parametrize(
    ("scheme", "limit"), [("symplectic_euler", 2.0), ("velocity_verlet", 2.0), ("rk4", 2 * np.sqrt(2))]
)
@pytest.mark.parametrize(("margin", "stable"), [(0.995, True), (1.005, False)])
def test_an_undamped_contact_is_stable_up_to_the_limit(scheme, limit, margin, stable):
    scene = at_rest(lift=1e-9, duration=60.0)
    steps = round(linear_theory.steps_for(scene, margin * limit))
    kept = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=1).trajectory
    swing = np.abs(kept.state["position"][:, 2] - (scene.launch.position[2] - 1e-9)).max()
    assert (swing < 1e-7) == stable


@pytest.mark.parametrize(
    ("scheme", "growth"),
    [
        ("forward_euler", lambda q: 1 + q**2),
        ("rk4", lambda q: 1 - q**6 / 72 + q**8 / 576),
        ("implicit_euler", lambda q: 1 / (1 + q**2)),
    ],
)
@pytest.mark.parametrize("omega_h", [0.02, 0.3, 1.0])
def test_an_undamped_swing_grows_or_shrinks_as_theory_says(scheme, growth, omega_h):
    """By |R(iωh)|² a step, R being the scheme's stability function: 1 + z, 1 + z + ... + z⁴/24, 1/(1 − z)."""
    steps, lift = 6, 1e-3
    omega = linear_theory.contact_frequency(100.0, 1.0)
    scene = at_rest(lift=lift, duration=steps * omega_h / omega)
    state = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=1).trajectory.state
    place = state["position"][:, 2] - (scene.launch.position[2] - lift)
    energy = state["velocity"][:, 2] ** 2 + (omega * place) ** 2
    np.testing.assert_allclose(energy[1:] / energy[:-1], growth(omega_h), rtol=1e-9)


@pytest.mark.parametrize("zeta", [0.05, 0.2, 0.5])
@pytest.mark.parametrize(("margin", "stable"), [(0.98, True), (1.02, False)])
@pytest.mark.parametrize(
    ("scheme", "limit"),
    [
        ("symplectic_euler", lambda zeta: 2 * (np.sqrt(1 + zeta**2) - zeta)),
        ("forward_euler", lambda zeta: 2 * zeta),
    ],
)
def test_explicit_damping_sets_the_limit(scheme, limit, zeta, margin, stable):
    omega = np.sqrt(4 * 100.0)
    scene = at_rest(damping=zeta * 2 * omega / 4, lift=1e-9, duration=40.0)
    steps = int(np.ceil(linear_theory.steps_for(scene, margin * limit(zeta))))
    kept = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=1).trajectory
    speed = np.abs(kept.state["velocity"][:, 2])
    period = int(np.ceil(2 * np.pi / omega / 40.0 * steps))
    assert (speed[-period:].max() < speed[: 2 * period].max()) == stable


def bounced(omega_h, phase, scheme="symplectic_euler"):
    """Return e² of one undamped bounce without gravity: a cube meets the ground at this ωh and phase of the step."""
    stiffness, speed = 1e4, 3.0
    h = omega_h / np.sqrt(4 * stiffness)
    steps = 60 + int(8 / omega_h)
    scene = from_mapping(
        {
            "ground": {"stiffness": stiffness, "damping": 0, "friction": 0, "contact": "gated"},
            "launch": {"position": [0, 0, HALF + speed * h * (2 + phase)], "velocity": [0, 0, -speed]},
            "gravity": 0,
            "duration": h * steps,
        }
    )
    end = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=1).trajectory.state["velocity"][-1, 2]
    return (end / speed) ** 2


@pytest.mark.parametrize("n", [2, 3, 4, 7, 12])
def test_magic_steps_conserve_a_bounces_energy_at_every_phase(n):
    energies = [bounced(2 * np.sin(np.pi / (2 * n)), phase) for phase in np.linspace(0.01, 0.99, 41)]
    np.testing.assert_allclose(energies, 1, rtol=0, atol=1e-11)


@pytest.mark.parametrize("omega_h", [0.15, 0.6, 0.9, 1.2, 1.6, 1.9])
@pytest.mark.long
def test_off_the_magic_steps_a_bounce_gains_up_to_the_known_bound(omega_h):
    energies = np.array([bounced(omega_h, phase) for phase in np.linspace(0.002, 0.998, 400)])
    bound = 1 / (1 - omega_h**2 / 4)
    assert energies.max() <= bound * (1 + 1e-12)
    assert energies.max() > 1 + 0.1 * (bound - 1)
