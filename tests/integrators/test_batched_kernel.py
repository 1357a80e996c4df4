from __future__ import annotations

import re

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Ensemble, physics_of
from stiffdice.errors import InputError
from stiffdice.integrators import batched_kernel
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import batch_loop, fixed_step
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

SPIN = [0.3, 0.5, 0.2]
PARTS = STATE.names


def scene_of(contact="ungated", duration=10.0, spin=SPIN, stiffness=1e4, **keys):
    launch = {"angular_momentum": spin} | keys.pop("launch", {})
    ground = {"contact": contact, "stiffness": stiffness} | keys.pop("ground", {})
    return from_mapping({"ground": ground, "launch": launch, "duration": duration} | keys)


def listed(scene, model, launches, steps, samples=1):
    """Members stepped one by one in the listing's order: states, shape (member, samples + 1)."""
    states = np.empty((len(launches), samples + 1), STATE)
    states[:, 0] = launches
    tags = SCHEMES["symplectic_euler"], MODELS[model], LAWS[scene.ground.contact]
    for member in states:
        fixed_step.advance(*tags, physics_of(scene), member, steps // samples, scene.duration / steps, 1e-9)
    return states


def assert_close(states, expected, atol):
    for part in PARTS:
        np.testing.assert_allclose(states[part], expected[part], rtol=0, atol=atol, err_msg=part)


def apart(states, others):
    return np.linalg.norm(states["position"] - others["position"], axis=-1)


@pytest.mark.parametrize(
    ("model", "scene"),
    [
        ("vertical", scene_of("gated", 1.2)),
        ("vertical", scene_of("gated", 1.2, launch={"orientation": [0.3, 0.2, 0.1]})),
        ("sliding", scene_of("ungated", 1.2)),
        ("sliding", scene_of("ungated", 1.2, launch={"orientation": [0.0, np.pi / 2, 0.0]})),
        ("tumbling", scene_of("ungated", 1.2)),
        ("tumbling", scene_of("ungated", 0.8, ground={"normal": [0.2, -0.3, 1]}, launch={"node_velocity": "rigid"})),
        ("tumbling", scene_of("ungated", 0.8, cube={"inertia": "corners", "mass": 3, "radius": 0.7}, gravity=3.7)),
    ],
)
def test_before_the_first_bounce_it_is_the_listings_order_to_round_off(model, scene):
    launches = turned(scene, model, 5)
    states = batched_kernel.prepare(scene, model, launches, 2000)()
    assert_close(states, listed(scene, model, launches, 2000)[:, -1], 1e-12)


def test_a_bounce_is_the_same_bounce():
    """Through it and up again: at S = 1e4, 100 steps long."""
    scene = scene_of("gated", 1.6)
    launches = turned(scene, "vertical", 70)
    launches["position"][:, 2] += np.linspace(0, 1e-2, 70)
    states = batched_kernel.prepare(scene, "vertical", launches, 10_000)()
    assert (states["velocity"][:, 2] > 1).all()
    assert_close(states, listed(scene, "vertical", launches, 10_000)[:, -1], 1e-11)


@pytest.mark.parametrize("stiffness", [1e4, 1e6])
def test_after_it_the_paths_part_as_those_of_two_launches_do_that_round_off_tells_apart(stiffness):
    """The listing's kernel itself says how round-off grows: from launches off by half an ulp for each step's root.

    Stepping adds errors of half an ulp, N^(1/2)/2 of them in N steps to the first bounce; a launch off by that much
    parts from the other at the same rate, bounce by bounce, until both are anywhere (a cube is chaotic).
    """
    scene, steps, members = scene_of(duration=5.0, stiffness=stiffness), 10_000, 64
    launches = turned(scene, "tumbling", members)
    path = listed(scene, "tumbling", launches, steps, 10)
    nudged = launches.copy()
    for part, seed in (("position", 1), ("velocity", 2), ("angular_momentum", 3)):
        sign = np.random.default_rng(seed).choice([-1, 1], (members, 3))
        nudged[part] += sign * np.sqrt(0.3 * steps) / 2 * np.spacing(np.abs(nudged[part]).max())
    parted = listed(scene, "tumbling", nudged, steps, 10)
    for sample in range(4, 11):
        until = scene_of(duration=0.5 * sample, stiffness=stiffness)
        states = batched_kernel.prepare(until, "tumbling", launches, 1000 * sample)()
        ours = np.log10(apart(states, path[:, sample]))
        theirs = np.log10(apart(parted[:, sample], path[:, sample]))
        # Of 64 distances spread over decades the median is known to 0.2 decades, the outer quantiles to 0.3.
        for quantile, within in ((0.1, 1.0), (0.5, 0.6), (0.9, 1.0)):
            assert abs(np.quantile(ours, quantile) - np.quantile(theirs, quantile)) < within


def test_a_member_is_the_same_whoever_is_beside_it():
    scene, steps = scene_of(stiffness=1e6), 3000
    launches = turned(scene, "tumbling", 37)
    states = batched_kernel.prepare(scene, "tumbling", launches, steps)()
    assert batched_kernel.prepare(scene, "tumbling", launches, steps, threads=2)().tobytes() == states.tobytes()
    assert batched_kernel.prepare(scene, "tumbling", launches, steps, threads=50)().tobytes() == states.tobytes()
    assert batched_kernel.prepare(scene, "tumbling", launches[::-1], steps)()[::-1].tobytes() == states.tobytes()
    assert batched_kernel.prepare(scene, "tumbling", launches[20:21], steps)().tobytes() == states[20:21].tobytes()


def test_a_kernel_can_be_called_again():
    scene = scene_of(duration=0.1)
    launches = turned(scene, "tumbling", 3)
    before = launches.copy()
    run = batched_kernel.prepare(scene, "tumbling", launches, 10)
    assert run().tobytes() == run().tobytes()
    assert launches.tobytes() == before.tobytes()


def test_a_member_that_turns_by_more_than_a_radian_in_a_step_is_turned_by_itself():
    scene = scene_of(duration=1.0)
    launches = turned(scene, "tumbling", 20)
    inertia = scene.cube.moment_of_inertia
    launches["angular_momentum"][:10] *= (np.geomspace(0.5, 20, 10) * 100 * inertia / np.linalg.norm(SPIN))[:, None]
    assert_close(
        batched_kernel.prepare(scene, "tumbling", launches, 100)(),
        listed(scene, "tumbling", launches, 100)[:, -1],
        1e-11,
    )


def out_of_range(states):
    return ~np.all([np.isfinite(states[part]).reshape(len(states), -1).all(axis=1) for part in PARTS], axis=0)


FAR_TOO_STIFF = {
    "stiffness": 2e301,
    "ground": {"damping": 0},
    "cube": {"mass": 1e-6},
    "launch": {"position": [0, 0, 1e4]},
    "spin": [0, 0, 0],
    "duration": 1000.0,
}


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_runs_that_blow_up_do_and_no_others(model):
    scene = scene_of(**FAR_TOO_STIFF)
    launches = turned(scene, model, 5)
    launches["position"][2, 2] = 1e12
    states, expected = batched_kernel.prepare(scene, model, launches, 100)(), listed(scene, model, launches, 100)[:, -1]
    np.testing.assert_array_equal(out_of_range(states), [True, True, False, True, True])
    np.testing.assert_array_equal(out_of_range(expected), out_of_range(states))
    np.testing.assert_allclose(states["position"][2], expected["position"][2], rtol=1e-12)


COST = {"vadd": 1, "vsub": 1, "vmul": 1, "vmax": 1, "vmin": 1, "vdiv": 1, "vsqrt": 1}
COST |= {"vfmadd": 2, "vfmsub": 2, "vfnmadd": 2, "vfnmsub": 2}


def operations(assembly):
    """Floating-point operations of eight members in a time loop: the shortest loop that has most of them."""

    def cost(line):
        found = re.match(r"\s+(v[a-z]+?)(?:132|213|231)?pd\s.*%zmm", line)
        return COST.get(found[1], 0) if found else 0

    lines = assembly.splitlines()
    place = {found[1]: k for k, line in enumerate(lines) if (found := re.match(r"(\.L\w+):", line))}
    jumps = [
        (place.get(found[1], k), k) for k, line in enumerate(lines) if (found := re.match(r"\s+j\w+\s+(\.L\w+)", line))
    ]
    loops = {(start, end): sum(map(cost, lines[start:end])) for start, end in jumps if start < end}
    start, end = min(
        (loop for loop in loops if loops[loop] > 0.5 * max(loops.values())), key=lambda loop: loop[1] - loop[0]
    )
    return loops[start, end]


@pytest.mark.long
@pytest.mark.parametrize(("model", "contact"), [("vertical", "gated"), ("tumbling", "ungated")])
def test_operations_are_those_of_the_compiled_loop(model, contact):
    scene = scene_of(contact, spin=[0, 0, 0])
    launches, width = turned(scene, model, 1), batched_kernel.WIDTHS[model]
    kernel = njit(batched_kernel._advance.py_func)  # what comes from the cache has no assembly
    tags = MODELS[model], batched_kernel.posture_of(scene, model, launches), LAWS[contact]
    kernel(*tags, batched_kernel.numbers_of(scene, 1e-3), batched_kernel.axes_of(scene), launches, width, 1)
    (assembly,) = kernel.inspect_asm().values()
    if "zmm" not in assembly:
        pytest.skip("this processor has other vectors")
    assert operations(assembly) == batched_kernel.FLOPS[model, contact] * width / 8


@pytest.mark.parametrize(
    ("model", "steps", "threads", "told"),
    [
        ("flying", 1, 1, "model = flying: allowed is sliding or tumbling or vertical"),
        ("tumbling", 0, 1, "steps = 0"),
        ("tumbling", 1, 0, "threads = 0"),
    ],
)
def test_what_cannot_be_stepped_is_said(model, steps, threads, told):
    scene = scene_of()
    with pytest.raises(InputError, match=told):
        batched_kernel.prepare(scene, model, turned(scene, "tumbling", 1), steps, threads)


def by_themselves(scene, model, members, **keys):
    """Runs of few members at a time, which `simulate` advances one after another."""
    few = batch_loop.FEWEST - 1
    parts = range(0, len(members.launches), few)
    return [
        simulate(scene, model=model, members=Ensemble(*(part[k : k + few] for part in members)), **keys) for k in parts
    ]


def joined(runs, name):
    return np.concatenate([run.measures[name] if name in run.measures else getattr(run, name) for run in runs])


# Falling, with a drag that turns the cube around in one step: more energy than ever, while it touches nothing.
DRAGGED_UP = {"ground": {"damping": 500}, "launch": {"velocity": [5, 0, -5]}}
# The same of single nodes: energy comes and goes while the cube touches nothing.
DRAGGED_ABOUT = {"ground": {"damping": 60}, "launch": {"velocity": [5, 0, -1]}}
# At rest, but for its sliding, after two thirds of the run.
AT_REST = {"ground": {"damping": 3}, "launch": {"velocity": [30, 0, 0]}}

STOP = {name: part.TOLERANCE for name, part in CRITERIA.items() if name in ("energy", "apex", "restitution")}


@pytest.mark.parametrize(
    ("model", "scene", "steps", "stop", "verdict"),
    [
        ("sliding", scene_of(spin=[0, 0, 0], duration=5.0), 5_000, None, Verdict.PASSED),
        ("sliding", scene_of(spin=[0, 0, 0], **AT_REST), 30_000, STOP, Verdict.PASSED),
        ("sliding", scene_of(spin=[0, 0, 0], duration=2.0, stiffness=1e6), 1_000, STOP, Verdict.ENERGY_GREW),
        ("sliding", scene_of(spin=[0, 0, 0], duration=2.0, **DRAGGED_UP), 1_000, STOP, Verdict.ENERGY_GREW),
        ("sliding", scene_of(**FAR_TOO_STIFF), 100, None, Verdict.LEFT_NUMERIC_RANGE),
        ("tumbling", scene_of(duration=3.0), 10_000, None, Verdict.PASSED),
        ("tumbling", scene_of(duration=3.0, stiffness=1e6, ground={"damping": 0}), 2_000, STOP, Verdict.ENERGY_GREW),
        ("tumbling", scene_of(duration=1.0, **DRAGGED_ABOUT), 66, None, Verdict.ENERGY_GREW),
        ("tumbling", scene_of(duration=2.0, stiffness=1e10), 60, None, Verdict.BLEW_UP),
        ("tumbling", scene_of(duration=3.0, ground={"normal": [0.1, 0.2, 1]}), 10_000, None, Verdict.PASSED),
    ],
)
def test_members_side_by_side_are_told_what_each_is_told_alone(model, scene, steps, stop, verdict):
    """To round-off, which has grown through the bounces."""
    members = phased(scene, model, steps, 19, turned(scene, model, 19))
    assert batch_loop.pays(scene, model, "symplectic_euler", members.launches)
    together = simulate(scene, model=model, steps=steps, members=members, stop=stop)
    alone = by_themselves(scene, model, members, steps=steps, stop=stop)
    assert verdict in together.verdict
    for name in ("verdict", "decided", "steps_done"):
        np.testing.assert_array_equal(getattr(together, name), joined(alone, name), err_msg=name)
    for name, values in together.measures.items():
        np.testing.assert_allclose(values, joined(alone, name), rtol=1e-4, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(together.touchdown_phase, joined(alone, "touchdown_phase"), atol=1e-9)
    assert (together.steps_computed >= joined(alone, "steps_computed")).all()
    assert (together.steps_computed <= together.steps_done + 1).all()


def test_as_many_members_fail_where_round_off_decides_which():
    """At S = 1e6 in 10,000 steps round-off grows a hundredfold in a bounce: after some, which members gain is chance.

    Two samples of one distribution differ by more than 1.95 (2/n)^(1/2) once in a thousand times (Kolmogorov, Smirnov).
    """
    scene, steps, count = scene_of(spin=[0, 0, 0], stiffness=1e6), 10_000, 300
    members = phased(scene, "sliding", steps, count)
    together = simulate(scene, model="sliding", steps=steps, members=members)
    alone = by_themselves(scene, "sliding", members, steps=steps)
    assert (together.verdict != joined(alone, "verdict")).any()
    for name in ("energy_ratio", "apex_ratio", "restitution_error"):
        ours, theirs = np.sort(together.measures[name]), np.sort(joined(alone, name))
        both = np.concatenate([ours, theirs])
        shares = [np.searchsorted(sample, both, side="right") / count for sample in (ours, theirs)]
        assert np.abs(shares[0] - shares[1]).max() < 1.95 * np.sqrt(2 / count)
    failing = [(verdict == Verdict.ENERGY_GREW).mean() for verdict in (together.verdict, joined(alone, "verdict"))]
    assert 0.05 < failing[0] < 0.95
    assert abs(failing[0] - failing[1]) < 3 * np.sqrt(2 * failing[1] * (1 - failing[1]) / count)


def test_members_are_watched_alike_whoever_is_beside_them():
    scene, steps = scene_of(stiffness=1e6), 2000
    members = phased(scene, "tumbling", steps, 37, turned(scene, "tumbling", 37))
    whole = simulate(scene, model="tumbling", steps=steps, members=members)
    for part in (slice(None, None, -1), slice(11, 16)):
        run = simulate(scene, model="tumbling", steps=steps, members=Ensemble(*(array[part] for array in members)))
        assert run.end.tobytes() == whole.end[part].tobytes()
        for name, values in run.measures.items():
            np.testing.assert_array_equal(values, whole.measures[name][part], err_msg=name)
        np.testing.assert_array_equal(run.decided, whole.decided[part])
