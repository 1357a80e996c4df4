"""What is predicted of a cell is about what it costs, told in counts: steps that runs compute, not seconds."""

from __future__ import annotations

import ast
import builtins
import dataclasses
import inspect
import math
import subprocess
import sys
import textwrap
import types

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import TURNING
from stiffdice.integrators import batched_kernel
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene import cube, ground
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import backend, batch_loop, fast_forward, reference, reference_run
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import tolerances_of
from stiffdice.simulation.engines import driver
from stiffdice.simulation.engines.registry import ENGINES
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate
from stiffdice.sweep import cost_model, sweep

SPIN = {"angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}


def scene_of(model="sliding", contact="gated", stiffness=1e4, duration=10.0, **values):
    launch = {"velocity": [0, 0, 5] if model == "vertical" else [5, 0, 5]} | (SPIN if model in TURNING else {})
    on = {"contact": contact, "stiffness": stiffness} | values
    return from_mapping({"ground": on, "launch": launch, "duration": duration})


def plan(model="sliding", members=4, criteria=None, **values):
    asked = {"scheme": "symplectic_euler", "simulator": "stiffdice", "early_stop": True, "horizon": 3.0} | values
    return {"model": model, "members": members, "criteria": tolerances_of(model, criteria)} | asked


def steps_at(scene, omega_h):
    return [round(linear_theory.steps_for(scene, target)) for target in omega_h]


def computed(scene, asked, steps):
    """Return the steps that runs compute, on average over the members, shape (scan,)."""
    model, members = asked["model"], asked["members"]
    launches = turned(scene, model, members)
    compared = None
    if "trajectory" in asked["criteria"]:
        distinct = launches if model in TURNING else launches[:1]
        compared, _ = reference_run.references(scene, model, distinct, asked["horizon"])
    runs = (
        simulate(
            scene,
            model=model,
            scheme=asked["scheme"],
            steps=count,
            members=phased(scene, model, count, members, launches),
            criteria=asked["criteria"],
            stop=asked["criteria"] if asked["early_stop"] else None,
            references=compared,
        )
        for count in steps
    )
    return np.array([run.steps_computed.mean() for run in runs])


OMEGA_H = np.geomspace(3, 0.05, 40)
ALL = {"finite": 0, "energy": 0.05, "apex": 0.02, "restitution": 0.05, "trajectory": 0.05}


@pytest.mark.parametrize(
    ("model", "contact", "asked"),
    [
        ("sliding", "gated", {}),
        ("sliding", "ungated", {}),
        ("sliding", "gated", {"criteria": ALL}),
        ("sliding", "ungated", {"criteria": ALL, "early_stop": False}),
        ("vertical", "gated", {}),
        ("vertical", "ungated", {}),
        ("tumbling", "gated", {}),
        ("tumbling", "ungated", {}),
        ("tumbling", "gated", {"criteria": ALL}),
    ],
)
def test_jobs_of_equal_predicted_steps_compute_equally_many(model, contact, asked):
    predicted, counted = [], []
    for stiffness in (1e2, 1e4, 1e6 if contact == "gated" else 1e5):
        scene = scene_of(model, contact, stiffness)
        steps = steps_at(scene, OMEGA_H)
        predicted.append(cost_model.prediction(scene, steps=steps, **plan(model, **asked)).steps)
        counted.append(computed(scene, plan(model, **asked), steps))
    predicted, counted = np.concatenate(predicted), np.concatenate(counted)
    before = np.cumsum(predicted) - predicted / 2
    job = np.minimum(8 * before / predicted.sum(), 7).astype(int)
    # What a job computes over what it was to: a single cell may be as much as a whole job here.
    share = np.bincount(job, counted, 8)[np.unique(job)] / np.bincount(job, predicted, 8)[np.unique(job)]
    assert share.max() < 2 * np.median(share)
    assert share.min() > 0.5 * np.median(share)
    assert predicted.sum() == pytest.approx(counted.sum(), rel=0.2)


@pytest.mark.parametrize(
    ("values", "asked", "omega_h"),
    [
        ({"damping": 0}, {}, 0.1),
        ({"damping": 0, "friction": 0}, {"members": 1}, 0.1),
        ({"damping": 0, "friction": 0}, {"members": 1}, 0.01),  # contacts by phases
        ({"contact": "ungated"}, {"members": 1}, 0.1),  # rises are skipped
        ({"contact": "ungated"}, {"members": 8}, 0.1),  # side by side they are not
        ({"damping": 50.0}, {}, 0.1),  # rests, and that decides all
        ({"damping": 50.0}, {"early_stop": False}, 0.1),  # rests, and goes on
        ({"damping": 50.0}, {"criteria": ALL}, 0.1),  # as `finite` is never decided
        ({"stiffness": 1e3}, {"criteria": {"trajectory": 0.05}}, 0.1),  # to its horizon only, every step
        ({"stiffness": 1e6}, {"criteria": {"trajectory": 0.05}}, 0.05),  # so short that flights are skipped
        ({}, {"scheme": "rk4"}, 0.1),
        ({"contact": "ungated"}, {"scheme": "velocity_verlet"}, 0.1),
    ],
)
def test_what_is_skipped_is_not_counted(values, asked, omega_h):
    scene = scene_of(**values)
    steps = steps_at(scene, [omega_h, 0.9 * omega_h])
    predicted = cost_model.prediction(scene, steps=steps, **plan(**asked)).steps
    assert predicted == pytest.approx(computed(scene, plan(**asked), steps), rel=0.4)


@pytest.mark.parametrize("contact", LAWS)
@pytest.mark.parametrize("model", MODELS)
def test_every_model_scheme_and_simulator_has_a_cost(model, contact):
    scene = scene_of(model, contact)
    for simulator, scheme in [(OURS, scheme) for scheme in SCHEMES] + [(name, "own") for name in ENGINES]:
        for criteria in (None, ALL):
            seconds = cost_model.of_scan(
                scene, steps=[1, 100, 10_000], **plan(model, criteria=criteria, scheme=scheme, simulator=simulator)
            )
            assert seconds.shape == (3,)
            assert (seconds > 0).all() and np.isfinite(seconds).all()


def test_no_name_is_left_over():
    assert set(cost_model.STEP) == set(SCHEMES)
    assert set(cost_model.ENGINES) == set(ENGINES)
    assert set(cost_model.GAIN) < set(SCHEMES)


@pytest.mark.parametrize("stiffness", [1e6, 1e8])
@pytest.mark.parametrize("scheme", ["symplectic_euler", "rk4"])
def test_steps_around_short_contacts_are_counted(scheme, stiffness):
    """All else is flight, which is skipped: how many steps are not, before and after a contact, decides the count."""
    scene, asked = scene_of(stiffness=stiffness, damping=0), plan(members=1, scheme=scheme, early_stop=False)
    steps = steps_at(scene, [0.3, 0.285])
    predicted = cost_model.prediction(scene, steps=steps, **asked).steps
    assert predicted == pytest.approx(computed(scene, asked, steps), rel=0.08)


def test_numbers_that_cannot_be_imported_without_compiling_are_those_of_the_simulation():
    assert (cost_model.OURS, cost_model.PAPERS) == (OURS, backend.DEFAULT_SCHEME)
    assert cost_model.BLOCK == sweep.BLOCK
    assert cost_model.FIRST_STATES == driver._FIRST
    assert cost_model.SAMPLES == reference.SAMPLES
    assert cost_model.FEWEST_BETWEEN == fast_forward.WORTHWHILE
    assert cost_model.FEWEST == batch_loop.FEWEST and batch_loop.SCHEME == cost_model.PAPERS
    assert all(
        batched_kernel.WIDTHS[type(batched_kernel.ABREAST[model])] == many.width
        for model, many in cost_model.LANES.items()
    )


@pytest.mark.parametrize(
    ("less", "more"),
    [
        ({"members": 1}, {"members": 3}),
        ({"members": 4}, {"members": 8}),
        ({"members": 64}, {"members": 65}),
        ({"early_stop": True}, {"early_stop": False}),
        ({"criteria": {"energy": 0.05}}, {"criteria": {"energy": 0.05, "trajectory": 0.05}}),
        ({"criteria": {"energy": 0.05}}, {"criteria": {"energy": 0.5}}),
    ],
)
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_who_asks_for_more_pays_more(model, less, more):
    scene = scene_of(model, "ungated")
    steps = steps_at(scene, OMEGA_H)
    cheap, dear = (cost_model.of_scan(scene, steps=steps, **plan(model, **asked)) for asked in (less, more))
    assert (cheap <= dear).all()
    assert cheap.sum() < dear.sum()


@pytest.mark.parametrize("model", ["sliding", "tumbling", "vertical"])
@pytest.mark.parametrize("damping", [0, 0.2, 50])
def test_where_all_that_falls_is_stepped_more_steps_cost_more(model, damping):
    scene = scene_of(model, "ungated", damping=damping, friction=0.1)
    seconds = cost_model.of_scan(scene, steps=range(100, 20_000, 100), **plan(model, scheme="rk4", early_stop=False))
    assert (np.diff(seconds) > 0).all()


def test_a_run_of_a_long_step_fails_early_and_is_cheap():
    scene = scene_of(stiffness=1e4, damping=0)
    long, short = steps_at(scene, [2.5, 0.3])
    predicted = cost_model.prediction(scene, steps=[long, short], **plan(scheme="velocity_verlet")).steps
    entire = cost_model.prediction(scene, steps=[long, short], **plan(scheme="velocity_verlet", early_stop=False)).steps
    assert predicted[0] < 0.5 * entire[0]
    assert predicted[1] == entire[1]


def test_references_are_spread_over_the_cells_of_a_scan():
    scene, asked = scene_of("tumbling"), plan("tumbling", members=32, criteria={"trajectory": 0.05})
    alone, among = (cost_model.of_scan(scene, steps=[5000] * count, **asked) for count in (1, 100))
    assert 33 * cost_model.REFERENCE < alone[0] - among[0] < 0.5


EXTREMES = [
    {"ground": {"stiffness": 0}},
    {"ground": {"stiffness": 1e300}},
    {"ground": {"stiffness": 5e-324}, "cube": {"mass": 1e300}},
    {"ground": {"damping": 1e300}},
    {"ground": {"damping": 1e300, "contact": "gated"}},
    {"ground": {"friction": 1e300}},
    {"ground": {"normal": [0, 0, -1]}},
    {"ground": {"normal": [1, 0, 0]}},
    {"ground": {"normal": [1, 2, 3]}},
    {"gravity": 0},
    {"gravity": 1e300},
    {"gravity": 5e-324},
    {"duration": 1e-300},
    {"duration": 1e300},
    {"cube": {"mass": 1e-200}},
    {"cube": {"radius": 1e150, "mass": 1e-10}},
    {"launch": {"position": [0, 0, -5]}},
    {"launch": {"position": [1e300, 0, 1e300]}},
    {"launch": {"velocity": [1e300, 0, -1e300]}},
    {"launch": {"orientation": [0.1, 0.2, 0.3]}},
]


@pytest.mark.parametrize("extreme", EXTREMES, ids=str)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("criteria", [None, ALL])
def test_no_scene_is_without_a_cost(extreme, model, criteria):
    scene = from_mapping(extreme)
    for scheme, simulator in (("symplectic_euler", OURS), ("implicit_euler", OURS), ("own", "scipy")):
        asked = plan(model, scheme=scheme, simulator=simulator, criteria=criteria, members=65)
        predicted = cost_model.prediction(scene, steps=[1, 1000, 2**53], **asked)
        assert np.isfinite(predicted.seconds).all() and (predicted.seconds >= cost_model.CELL).all()
        assert (predicted.steps > 0).all() and (predicted.steps <= [1, 1000, 2**53]).all()


def operations(steps, **values):
    """Return how many calls of Python functions, and of compiled ones by name, a prediction takes."""
    calls = 0

    def count(frame, event, argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    scene, asked = scene_of(**values), plan(criteria=ALL)
    sys.setprofile(count)
    try:
        cost_model.of_scan(scene, steps=steps, **asked)
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.parametrize("contact", LAWS)
def test_a_long_scan_takes_no_more_operations_than_a_short_one(contact):
    few, many = np.arange(1, 11), np.arange(1, 10_001)
    assert operations(few, contact=contact) == operations(many, contact=contact)
    # At a microsecond each, or less, a hundred columns take a fraction of a second.
    assert operations(many, contact=contact) < 3000


@pytest.mark.parametrize("values", [{"duration": 1e5}, {"damping": 1e-3, "duration": 1e5}, {"stiffness": 1e8}])
def test_a_run_of_many_landings_is_followed_in_few_parts(values):
    assert operations([1000], contact="ungated", **values) < 20_000


def test_the_simulator_is_not_loaded():
    code = "import sys, stiffdice.sweep.cost_model; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numba", "xarray", "scipy", "h5py", "pandas"} & set(done.stdout.split())


# What IEEE 754 rounds in one way, what compares, and what makes arrays or counts.
ROUNDED = {math.sqrt, np.sqrt, np.fmin, np.fmax, math.frexp, math.ldexp}
PLAIN = {
    np.asarray,
    np.full,
    np.zeros,
    np.where,
    np.errstate,
    abs,
    any,
    bool,
    float,
    int,
    len,
    list,
    max,
    min,
    property,
}
PLAIN |= {range, set, sorted, str, tuple, zip, np.bool_, np.float64}
METHODS = {"append", "get", "items", "_make", "_replace"}
OWN = {linear_theory.contact_frequency, cube.Cube.side.fget, ground._unit}


def named(node, scope):
    """Return what a name or a dotted name stands for in a module; None if that is known only as it runs."""
    if isinstance(node, ast.Attribute):
        return getattr(named(node.value, scope), node.attr, None)
    return scope.get(node.id, getattr(builtins, node.id, None)) if isinstance(node, ast.Name) else None


def rounded_as_it_happens(source, scope):
    """Return what a source calls or names that another processor may round otherwise: whatever is not known to be."""
    tree = ast.parse(textwrap.dedent(source))
    found = {type(node).__name__ for node in ast.walk(tree) if isinstance(node, ast.Pow | ast.MatMult)}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            found |= {"import" for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)}
    local = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in ast.walk(tree):
        it = named(node, scope)
        module = getattr(it, "__module__", None)
        elsewhere = module in ("math", "builtins") or str(module).startswith("numpy") or isinstance(it, np.ufunc)
        if callable(it) and not isinstance(it, types.GenericAlias) and elsewhere and it not in ROUNDED | PLAIN:
            found.add(ast.unparse(node))
        if isinstance(node, ast.Call):
            called, name = named(node.func, scope), ast.unparse(node.func).rpartition(".")[2]
            if not (called in ROUNDED | PLAIN | OWN or name in METHODS | local):
                found.add(ast.unparse(node.func))
    return found


def test_only_what_every_processor_rounds_alike_is_used():
    assert rounded_as_it_happens(inspect.getsource(cost_model), vars(cost_model)) == set()
    for used in OWN:
        assert rounded_as_it_happens(inspect.getsource(used), used.__globals__) == set()


@pytest.mark.parametrize(
    "line",
    [
        "from math import tanh; y = tanh(x)",
        "from math import tanh as sqrt; y = sqrt(x)",
        "import numpy as n; y = n.exp(x)",
        "from numpy import sum as max; y = max(x)",
        "def f(x):\n    from math import tanh as abs\n    return abs(x)",
        "f = math.log\ny = f(x)",
        "y = math.fsum([x])",
        "y = x.sum()",
        "y = x**0.5",
        "y = row @ row",
        "y = getattr(math, 'tanh')(x)",
        "y = sum([x])",
    ],
)
def test_what_processors_round_otherwise_is_found(line):
    scope = {"math": math, "np": np, "x": np.ones(()), "row": np.ones(1)}
    exec(line, scope)
    assert rounded_as_it_happens(line, scope)


@pytest.mark.parametrize("contact", LAWS)
@pytest.mark.parametrize("model", ["sliding", "tumbling", "vertical"])
def test_a_cell_costs_the_same_wherever_it_is_in_a_scan(model, contact):
    # Vector units take several numbers at a time, and the last of them one by one: all have to round alike.
    scene = scene_of(model, contact)
    steps = steps_at(scene, OMEGA_H)[:37]
    whole = cost_model.of_scan(scene, steps=steps, **plan(model))
    assert [float(cost_model.of_scan(scene, steps=[count], **plan(model))[0]) for count in steps] == whole.tolist()
    assert cost_model.of_scan(scene, steps=steps[::-1], **plan(model)).tolist() == whole[::-1].tolist()


@pytest.mark.parametrize("drag", [1e-9, 0.1, 1.0, 10.0, 100.0])
def test_a_fall_in_drag_is_known(drag):
    pull, limit = 9.8, 9.8 / drag
    for t in (0.01, 0.1, 0.5, 1.0, 2.0):
        gone = -np.expm1(-drag * t)
        height = limit * (t - gone / drag) if drag * t > 1e-3 else pull * t * t / 2
        time, speed = cost_model._fall(pull, drag, height)
        assert time == pytest.approx(t, rel=0.04)
        assert speed == pytest.approx(limit * gone, rel=0.08)


def test_a_stiffer_ground_and_a_longer_run_cost_more():
    soft = scene_of(contact="ungated", stiffness=1e3)
    hard = soft.with_ground(stiffness=1e5)
    scenes = soft, dataclasses.replace(hard, duration=5.0), hard
    at = [cost_model.of_scan(scene, steps=steps_at(scene, OMEGA_H), **plan(members=1)).sum() for scene in scenes]
    assert at == sorted(at)
