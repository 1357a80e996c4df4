"""The scheme `event`: right to its tolerance, at a cost that does not grow with the stiffness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stiffdice.dynamics import flat_bounce
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.run import simulate

STIFFNESSES = (1e2, 1e4, 1e8, 1e12)


def throw(stiffness=1e4, contact="gated", spin=(0.3, 0.5, 0.2), duration=3.0, launch=None, gravity=9.8, **ground):
    ground = {"stiffness": stiffness, "damping": 0.1, "friction": 0.1, "contact": contact, **ground}
    return from_mapping(
        {
            "ground": ground,
            "launch": {"angular_momentum": list(spin), "node_velocity": "rigid", **(launch or {})},
            "duration": duration,
            "gravity": gravity,
        }
    )


def places(scene, tolerance, model="tumbling", samples=30):
    run = simulate(scene, model=model, scheme="event", steps=samples, every=1, tolerance=tolerance)
    return run.trajectory.state["position"], int(run.evaluations[0])


def apart(one, other):
    return math.sqrt(((one - other) ** 2).sum(axis=1).mean())


def equations(scene):
    """Equations 2 to 10 in plain NumPy: rotation matrix, node forces, nothing shared with the library's kernels."""
    cube, ground = scene.cube, scene.ground
    offsets = SIGNS * cube.side / 2
    normal = np.array(ground.normal)

    def rate(time, y):
        place, velocity, spin, turn = y[:3], y[3:6], y[6:9] / cube.moment_of_inertia, y[9:].reshape(3, 3)
        arms = offsets @ turn.T
        speeds = velocity + np.cross(spin, arms)
        depth, out = -(place + arms) @ normal, speeds @ normal
        push = np.where(depth > 0, np.maximum(0, ground.stiffness * depth - ground.damping * out), 0)
        slip = speeds - np.outer(out, normal)
        size = np.linalg.norm(slip, axis=1) + 1e-6 * cube.radius
        force = np.outer(push, normal) - (ground.friction * push / size)[:, None] * slip
        total = force.sum(axis=0) / cube.mass - [0, 0, scene.gravity]
        turning = np.cross(spin, turn.T).T  # of each column of the matrix
        return np.concatenate([velocity, total, np.cross(arms, force).sum(axis=0), turning.ravel()])

    return rate


def solved(scene, method, rtol, samples=30):
    """SciPy's solution of the same throw."""
    start = np.concatenate([scene.launch.position, scene.launch.velocity, scene.launch.spin, np.eye(3).ravel()])
    length = math.sqrt(scene.cube.mass / 4 / scene.ground.stiffness)
    atol = rtol * np.concatenate([np.full(3, length), np.ones(6), np.full(9, length)])
    times = np.linspace(0, scene.duration, samples + 1)
    with np.errstate(all="ignore"):  # in steps that are tried and refused
        solution = solve_ivp(equations(scene), (0, scene.duration), start, method, times, rtol=rtol, atol=atol)
    assert solution.success
    return solution.y[:3].T


@pytest.mark.parametrize(("stiffness", "agreement"), [(1e2, 3e-9), (1e4, 3e-8), (1e8, 1e-8)])
@pytest.mark.long
def test_a_tumbling_throw_agrees_with_other_integrators(stiffness, agreement):
    scene = throw(stiffness)
    own, _ = places(scene, 1e-12)
    assert apart(own, solved(scene, "DOP853", 1e-12)) < agreement
    assert apart(own, solved(scene, "LSODA", 1e-12)) < agreement


# A throw in which a corner comes to be held by friction, and slips again.
HELD = (0.11094238, 0.61472022, 0.5124655)


@pytest.mark.long
def test_a_corner_held_by_friction_agrees_with_a_stiff_integrator():
    scene = throw(1e8, spin=HELD)
    own, _ = places(scene, 1e-11)
    assert apart(own, solved(scene, "LSODA", 1e-12)) < 2e-9


def rough_throw(stiffness):
    """Each landing holds a corner for most of its time."""
    ground = {"stiffness": stiffness, "damping": 6.0, "friction": 0.86, "contact": "gated"}
    launch = {"position": [0, 0, 2.124], "velocity": [2.61, -1.72, 1.43], "angular_momentum": [-0.04, 0.34, 1.3]}
    launch |= {"orientation": [0.53, -0.35, 1.28], "node_velocity": "rigid"}
    return from_mapping({"ground": ground, "launch": launch, "duration": 3.0})


@pytest.mark.parametrize("stiffness", [2e4, 1e8, 7e8])
def test_the_error_goes_with_the_tolerance_where_friction_holds_a_corner(stiffness):
    """Against LSODA, which is itself right to 1e-9: from its own at a tenth of the tolerance it differs by so much."""
    scene = rough_throw(stiffness)
    best = engines.ready("scipy_lsoda", scene, "tumbling", 30, 30, 1e-13)()().states["position"]
    for tolerance in (1e-6, 1e-8, 1e-9, 1e-11, 1e-13):
        own, evaluations = places(scene, tolerance)
        assert apart(own, best) < 3 * tolerance + 1e-9
        assert evaluations < 30_000


@pytest.mark.parametrize("spin", [(0.3, 0.5, 0.2), HELD])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_the_error_goes_with_the_tolerance(stiffness, spin):
    scene = throw(stiffness, spin=spin)
    best, _ = places(scene, 1e-12)
    for tolerance in (1e-10, 1e-8, 1e-6):
        assert apart(places(scene, tolerance)[0], best) < 100 * tolerance + 1e-8


def test_the_cost_does_not_grow_with_the_stiffness():
    """Evaluations of the force at a tolerance of 1e-6, the median of some throws; soft ground has fewer landings."""
    spins = np.random.default_rng(1).uniform(0, 0.75, (20, 3))
    soft, firm, hard = (
        np.median([places(throw(stiffness, spin=spin), 1e-6)[1] for spin in spins]) for stiffness in (1e2, 1e6, 1e12)
    )
    assert hard < 1.1 * firm
    assert hard < 2 * soft
    assert hard < 800


@pytest.mark.parametrize("contact", ["gated", pytest.param("ungated", marks=pytest.mark.long)])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("damping", [0.0, 0.3, 5.0])
def test_a_flat_bounce_has_the_exact_restitution(stiffness, damping, contact):
    """Dropped without friction from just above the ground; the speed out is read in the air, under the gated law."""
    fast = 7.0
    scene = throw(
        stiffness,
        contact,
        spin=(0, 0, 0),
        damping=damping,
        friction=0.0,
        duration=4 * math.pi / math.sqrt(4 * stiffness),
        launch={"position": [0, 0, 1.0352761804100830 / 2], "velocity": [0, 0, -fast]},
    )
    run = simulate(scene, model="sliding", scheme="event", steps=400, every=1, tolerance=1e-11)
    state = run.trajectory.state
    height = state["position"][:, 2] - scene.cube.side / 2
    speed = state["velocity"][:, 2]
    out = (height > 0) & (speed > 0)
    expected = flat_bounce.restitution(scene, fast)
    if not out.any():
        assert expected == 0 or stiffness < damping**2
        return
    first = np.flatnonzero(out)[0]
    squared = speed[first] ** 2 + 2 * scene.gravity * height[first]
    assert math.sqrt(squared) / fast == pytest.approx(expected, abs=3e-9)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("contact", ["gated", pytest.param("ungated", marks=pytest.mark.long)])
def test_where_a_run_is_cut_into_steps_does_not_matter(model, contact):
    spin = (0.3, 0.5, 0.2) if model == "tumbling" else (0, 0, 0)
    scene = throw(contact=contact, spin=spin, duration=2.0)
    ends = [
        simulate(scene, model=model, scheme="event", steps=steps, tolerance=1e-11).end["position"][0]
        for steps in (1, 7, 1000)
    ]
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, rtol=0, atol=3e-9)


EXTREMES = {
    "no springs": ({"stiffness": 0.0}, {}),
    "hardly a spring": ({"stiffness": 1.0}, {}),
    "no damping": ({"damping": 0.0}, {}),
    "overdamped": ({"damping": 5e3}, {}),
    "friction of one": ({"friction": 1.0}, {}),
    "tilted": ({"normal": [0.3, 0, 1]}, {}),
    "begins in the ground": ({}, {"launch": {"position": [0, 0, -0.3]}}),
    "no gravity": ({}, {"gravity": 0.0, "launch": {"velocity": [1, 0, -1]}}),
    "at rest": ({}, {"spin": (0, 0, 0), "launch": {"position": [0, 0, 0.517], "velocity": [0, 0, 0]}}),
    "slides": ({}, {"spin": (0, 0, 0), "launch": {"position": [0, 0, 0.517], "velocity": [1, 0, 0]}}),
    "tiny": ({}, {"duration": 1e-9}),
}


@pytest.mark.parametrize("name", EXTREMES)
@pytest.mark.parametrize("contact", ["gated", pytest.param("ungated", marks=pytest.mark.long)])
def test_energy_never_rises_beyond_the_tolerance(name, contact):
    ground, rest = EXTREMES[name]
    scene = throw(contact=contact, **{"duration": 4.0, **rest}, **ground)
    kept = simulate(scene, model="tumbling", scheme="event", steps=100, every=1, tolerance=1e-9).trajectory
    energy = kept.kinetic_energy + kept.potential_energy + kept.elastic_energy
    assert len(energy) == 101
    assert np.isfinite(energy).all()
    assert np.diff(energy).max() < 1e-6 * max(1.0, np.abs(energy).max())


def test_sticking_friction_brings_a_sliding_cube_to_rest():
    """μ g t = u: a second later it creeps no faster than the friction's cutoff lets it."""
    scene = throw(spin=(0, 0, 0), duration=3.0, launch={"position": [0, 0, 0.5174], "velocity": [1, 0, 0]}, damping=5.0)
    end = simulate(scene, model="sliding", scheme="event", steps=3, tolerance=1e-9).end
    assert end["position"][0, 0] == pytest.approx(1 / (2 * 0.1 * 9.8), rel=1e-3)
    assert 0 <= end["velocity"][0, 0] < 1e-6
