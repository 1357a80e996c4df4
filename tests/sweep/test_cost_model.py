"""What is predicted of cells divides a sweep into jobs that compute about equally much, told in counts, not seconds."""

from __future__ import annotations

import dataclasses
import math
import sys

import numpy as np
import pytest

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import TURNING
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria.registry import tolerances_of
from stiffdice.simulation.engines.registry import ENGINES
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate
from stiffdice.sweep import cost_model
from stiffdice.sweep.grid import Column, Piece, Sweep
from stiffdice.sweep.shard import BLOCK

SPIN = {"angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}
ALL = {"finite": 0, "energy": 0.05, "apex": 0.02, "restitution": 0.05, "trajectory": 0.05}
OMEGA_H = {"from": 3.0, "to": 0.05, "count": 40}


def sweep_of(model="sliding", contact="gated", stiffness=1e4, criteria=None, scene=None, **values):
    launch = {"velocity": [0, 0, 5] if model == "vertical" else [5, 0, 5]} | (SPIN if model in TURNING else {})
    on = {key: values.pop(key) for key in ("damping", "friction") if key in values}
    asked = {"scheme": "symplectic_euler", "members": 4, "early_stop": True, "horizon": 3.0, "omega_h": OMEGA_H}
    return Sweep(
        scene=from_mapping({"ground": on, "launch": launch, "duration": 10.0} if scene is None else scene),
        model=model,
        contact=(contact,),
        stiffness={"from": stiffness, "to": stiffness, "count": 1},
        criteria=tolerances_of(model, criteria),
        **({"steps": None, "seed": 1, "refine": 0} | asked | values),
    )


def pieces_of(plan):
    return [Piece(column, tuple(plan.scan(column))) for column in plan.columns()]


def costs(plan, steps=None):
    pieces = pieces_of(plan) if steps is None else [Piece(column, tuple(steps)) for column in plan.columns()]
    return cost_model.of(plan, pieces)


def computed(plan):
    """Return the steps that runs of a column compute, on average over the members, shape (scan,)."""
    (column,) = plan.columns()
    scene, launches, compared = plan.scene_of(column), turned(plan.scene, plan.model, plan.members), None
    if "trajectory" in plan.criteria:
        compared, _ = references(scene, plan.model, launches if plan.model in TURNING else launches[:1], plan.horizon)
    counts = []
    for steps in plan.scan(column):
        members = phased(scene, plan.model, steps, plan.members, launches)
        stop = plan.criteria if plan.early_stop else None
        asked = {"scheme": plan.scheme, "criteria": plan.criteria, "stop": stop, "references": compared}
        run = simulate(scene, model=plan.model, steps=steps, members=members, **asked)
        counts.append(run.steps_computed.mean())
    return np.array(counts)


@pytest.mark.parametrize(
    ("model", "contact", "asked"),
    [
        ("sliding", "gated", {}),
        ("sliding", "ungated", {}),
        ("sliding", "gated", {"criteria": ALL}),
        ("vertical", "gated", {}),
        ("tumbling", "gated", {}),
        ("tumbling", "ungated", {}),
        ("tumbling", "gated", {"criteria": ALL}),
    ],
)
@pytest.mark.long
def test_jobs_of_equal_cost_compute_about_equally_many_steps(model, contact, asked):
    """Eight jobs on three grounds: the longest is less than twice the median."""
    predicted, counted = [], []
    for stiffness in (1e2, 1e4, 1e6 if contact == "gated" else 1e5):
        plan = sweep_of(model, contact, stiffness, **asked)
        predicted.append(costs(plan) - costs(plan, [1] * OMEGA_H["count"]))  # but what is around a run
        counted.append(computed(plan))
    predicted, counted = np.concatenate(predicted), np.concatenate(counted)
    before = np.cumsum(predicted) - predicted / 2
    job = np.minimum(8 * before / predicted.sum(), 7).astype(int)
    share = np.bincount(job, counted, 8)[np.unique(job)] / np.bincount(job, predicted, 8)[np.unique(job)]
    assert share.max() < 2 * np.median(share)


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
def test_more_work_costs_more(model, less, more):
    cheap, dear = (costs(sweep_of(model, "ungated", **asked)) for asked in (less, more))
    assert (cheap <= dear).all()
    assert cheap.sum() < dear.sum()


@pytest.mark.parametrize("model", ["sliding", "tumbling", "vertical"])
@pytest.mark.parametrize("damping", [0, 0.2, 50])
def test_more_steps_cost_more_where_no_run_ends_early(model, damping):
    plan = sweep_of(model, "ungated", damping=damping, scheme="rk4", early_stop=False)
    assert (np.diff(costs(plan, range(100, 20_000, 100))) > 0).all()


def test_a_stiffer_ground_and_a_longer_run_cost_more():
    soft, hard = sweep_of(contact="ungated", stiffness=1e3), sweep_of(contact="ungated", stiffness=1e5)
    short = dataclasses.replace(hard, scene=dataclasses.replace(hard.scene, duration=5.0))
    at = [costs(plan).sum() for plan in (soft, short, hard)]
    assert at == sorted(at)


def test_references_are_shared_by_the_cells_of_a_piece():
    plan = sweep_of("tumbling", members=32, criteria={"trajectory": 0.05})
    alone, among = (costs(plan, [5000] * count)[0] for count in (1, 100))
    assert 32 * cost_model.REFERENCE * 0.99 < alone - among < 0.5


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("model", MODELS)
def test_every_model_scheme_and_engine_has_a_cost(model, contact):
    ours = [{"scheme": scheme} for scheme in (*SCHEMES, "unknown")]
    for asked in [*ours, *({"simulator": name, "scheme": "own"} for name in (*ENGINES, "unknown"))]:
        for criteria in (None, ALL):
            seconds = costs(sweep_of(model, contact, criteria=criteria, **asked), [1, 100, 10_000])
            assert (seconds > 0).all() and np.isfinite(seconds).all()


EXTREMES = [
    {"ground": {"damping": 1e300}},
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
    {"cube": {"mass": 1e300}},
    {"cube": {"radius": 1e150, "mass": 1e-10}},
    {"launch": {"position": [0, 0, -5]}},
    {"launch": {"position": [1e300, 0, 1e300]}},
    {"launch": {"velocity": [1e300, 0, -1e300]}},
    {"launch": {"orientation": [0.1, 0.2, 0.3]}},
]


@pytest.mark.parametrize("extreme", EXTREMES, ids=str)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("stiffness", [5e-324, 1e4, 1e300])
def test_no_scene_is_without_a_cost(extreme, model, stiffness):
    for contact in CONTACT_LAWS:
        for asked in ({}, {"criteria": ALL}, {"simulator": "scipy", "scheme": "own"}):
            plan = sweep_of(model, contact, stiffness, scene=extreme, members=65, **asked)
            seconds = costs(plan, [1, 1000, 2**53])
            assert np.isfinite(seconds).all() and (seconds >= cost_model.CELL).all()
            assert seconds[0] < 10  # of one step


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("model", ["sliding", "tumbling", "vertical"])
def test_a_cell_costs_the_same_wherever_it_is(model, contact):
    """Vector units take several numbers at a time, and the last of them one by one: all have to round alike."""
    plan = sweep_of(model, contact)
    (column,) = plan.columns()
    steps = plan.scan(column)[:37]
    alone = [float(cost_model.of(plan, [Piece(column, (count,))])[0]) for count in steps]
    assert alone == costs(plan, steps).tolist()
    assert alone[::-1] == costs(plan, steps[::-1]).tolist()


def test_a_large_grid_takes_no_more_operations_than_a_small_one():
    """What is Python in it is a handful of calls for all cells; of each column there are a few."""
    plan, calls = sweep_of(criteria=ALL), []

    def count(frame, event, argument):
        calls[-1] += event in ("call", "c_call")

    for columns, cells in ((1, 10), (1, 10_000), (1000, 10)):
        pieces = [Piece(Column("gated", 1e3 + k), tuple(range(1, cells + 1))) for k in range(columns)]
        calls.append(0)
        sys.setprofile(count)
        cost_model.of(plan, pieces)
        sys.setprofile(None)
    assert calls[1] < calls[0] + 100  # what collects garbage meanwhile calls, too
    assert calls[2] < calls[0] + 5 * 1000 + 100


# Names of functions that processors round otherwise.
ROUNDED_OTHERWISE = (
    "exp",
    "log",
    "sin",
    "cos",
    "tan",
    "arctan",
    "power",
    "hypot",
    "cbrt",
    "sum",
    "mean",
    "dot",
    "prod",
)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_only_what_every_processor_rounds_alike_is_computed(model, monkeypatch):
    """Sums of arrays and functions but the square root may differ in the last digit from processor to processor."""

    def refuse(*arguments, **options):
        raise AssertionError("rounded otherwise elsewhere")

    expected = costs(sweep_of(model, "ungated", criteria=ALL))
    plan = sweep_of(model, "ungated", criteria=ALL)
    pieces = pieces_of(plan)
    for name in ROUNDED_OTHERWISE:
        monkeypatch.setattr(np, name, refuse)
        if hasattr(math, name):
            monkeypatch.setattr(math, name, refuse)
    assert cost_model.of(plan, pieces).tolist() == expected.tolist()


@pytest.mark.parametrize("drag", [1e-9, 0.1, 1.0, 10.0, 100.0])
def test_a_fall_in_drag_is_known(drag):
    pull, limit = 9.8, 9.8 / drag
    for t in (0.01, 0.1, 0.5, 1.0, 2.0):
        gone = -np.expm1(-drag * t)
        height = limit * (t - gone / drag) if drag * t > 1e-3 else pull * t * t / 2
        time, speed = cost_model._fall(pull, drag, height)
        assert time == pytest.approx(t, rel=0.04)
        assert speed == pytest.approx(limit * gone, rel=0.08)


def test_a_block_is_that_of_a_sweep():
    assert cost_model.MEMBERS == BLOCK
