from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from tests import rounds
from tests.conftest import ROOT

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.reader import open_file
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Column, Sweep
from stiffdice.sweep.shard import BLOCK, compute_shard

DEFAULTS = {"finite": 0.0, "energy": 0.05, "apex": 0.02}


def small(**changes):
    """A sweep of a few short columns."""
    planned = Sweep(
        scene=from_mapping({}),
        model="sliding",
        scheme="symplectic_euler",
        contact=("ungated", "gated"),
        stiffness={"from": 1e2, "to": 1e3, "count": 2},
        steps=None,
        omega_h={"from": 3.0, "to": 0.5, "count": 12},
        members=8,
        seed=3,
        refine=0,
        criteria=DEFAULTS,
        early_stop=False,
        horizon=10.0,
    )
    return dataclasses.replace(planned, **changes)


def computed(planned, folder, columns=None, name="x"):
    """The shard that the scans of these columns (all of them by default) make."""
    path = folder / f"{name}.h5"
    compute_shard(planned, rounds.scan(planned, columns), path)
    return open_file(path)


def collected(planned, folder, **options):
    return collect([computed(planned, folder, **options)], planned.criteria)


@pytest.mark.long
def test_cells_do_not_know_their_shard(tmp_path):
    """However the columns are dealt out, the collected sweep is the same."""
    planned = small()
    columns = planned.columns()
    whole = collected(planned, tmp_path)
    parts = [computed(planned, tmp_path, columns[k::3], f"{k}") for k in (2, 0, 1)]
    xr.testing.assert_identical(whole, collect(parts, planned.criteria))


def test_equal_shards_are_equal_bytes(tmp_path):
    for name in "ab":
        computed(small(), tmp_path, name=name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_every_cell_says_where_it_is_and_everything_what_it_is(tmp_path):
    planned = small()
    for found in (computed(planned, tmp_path), collected(planned, tmp_path)):
        assert found.omega_h.values == pytest.approx(np.sqrt(4 * found.stiffness.values) * 10 / found.steps.values)
        for name, variable in found.variables.items():
            assert variable.attrs["units"], name
            assert variable.attrs["long_name"], name
        assert found.attrs["early_stop"] == 0
        assert found.attrs["model_reason"] == "as asked"


@pytest.mark.parametrize("early_stop", [False, True])
def test_a_shard_holds_what_the_simulator_says_of_each_member(tmp_path, early_stop):
    """More members than are computed together, so that they come in blocks."""
    members = BLOCK + 6
    planned = small(members=members, early_stop=early_stop, omega_h={"from": 3.0, "to": 0.5, "count": 4})
    column = Column("gated", 1e3)
    found = computed(planned, tmp_path, [column])
    scene = planned.scene_of(column)
    assert found.sizes["member"] == members
    for k, steps in enumerate(planned.scan(column)):
        stop = planned.criteria if early_stop else None
        ensemble = phased(scene, "sliding", steps, members)
        run = simulate(scene, model="sliding", steps=steps, members=ensemble, stop=stop)
        for name, values in run.measures.items():
            np.testing.assert_array_equal(found[name][k], values, err_msg=name)
        for name in ("touchdown_phase", "verdict", "ending", "steps_done", "steps_computed", "decided"):
            np.testing.assert_array_equal(found[name][k], getattr(run, name), err_msg=name)


def test_a_run_that_left_the_range_of_doubles_fails_every_criterion(tmp_path):
    scene = from_mapping({"cube": {"mass": 1e-9}})
    planned = small(
        scene=scene,
        contact=("gated",),
        stiffness={"from": 1e308, "to": 1e308, "count": 1},
        omega_h=None,
        steps={"from": 50, "to": 60, "count": 2},
    )
    found = collected(planned, tmp_path)
    assert (found.failing == planned.members).all()
    assert (found.verdicts[:, Verdict.LEFT_NUMERIC_RANGE] == planned.members).all()


@pytest.mark.long
def test_stopping_early_changes_no_judgement_and_saves_work(tmp_path):
    whole = collected(small(), tmp_path)
    stopped = collected(small(early_stop=True), tmp_path)
    np.testing.assert_array_equal(stopped.failing, whole.failing)
    assert (stopped.steps_computed <= whole.steps_computed).all()
    never = collected(small(early_stop=True, criteria={"energy": 0.05}), tmp_path)
    np.testing.assert_array_equal(never.failing[0], whole.failing[1])
    assert never.steps_computed.sum() < whole.steps_computed.sum()
    assert never.attrs["criteria"] == "energy: energy_ratio <= 1.05"


@pytest.mark.long
def test_each_round_adds_what_the_rounds_before_left_in_doubt(tmp_path):
    """And changes nothing else: a cell's numbers do not depend on the round in which it was asked."""
    planned = small()
    before = collected(planned, tmp_path)
    names = [name for name in before.data_vars if "cell" in before[name].dims]

    def cells(found):
        rows = zip(found.contact.values, found.stiffness.values, found.steps.values, strict=True)
        return {row: tuple(found[name].isel(cell=k).values.tobytes() for name in names) for k, row in enumerate(rows)}

    for number in (1, 2, 3):
        wanted = set()
        for column in planned.columns():
            law = planned.contact.index(column.contact)
            scan = before.isel(cell=(before.contact.values == law) & (before.stiffness.values == column.stiffness))
            passing = 1 - scan.failing.values / planned.members
            added = planned.finer(column, scan.steps.values.tolist(), passing, number)
            wanted |= {(law, column.stiffness, steps) for steps in added}
        further = small(refine=number)
        after = rounds.judged(further, rounds.compute(further, tmp_path))
        old, new = cells(before), cells(after)
        assert wanted
        assert set(new) == set(old) | wanted
        assert all(new[row] == numbers for row, numbers in old.items())
        before = after


def test_a_tumbling_sweep_turns_its_members_and_compares_each_with_its_own_reference(tmp_path):
    scene = from_mapping(
        {"launch": {"angular_momentum": [0.2, 0.1, 0.3]}, "ground": {"friction": 0.3}, "duration": 2.0}
    )
    planned = small(
        scene=scene,
        model="tumbling",
        contact=("gated",),
        stiffness={"from": 1e3, "to": 1e3, "count": 1},
        omega_h=None,
        steps={"from": 200, "to": 20_000, "count": 3},
        members=4,
        criteria={"finite": 0.0, "energy": 0.05, "trajectory": 0.05},
        horizon=1.8,
    )
    runs = computed(planned, tmp_path)
    assert runs.attrs["horizon"] == 1.8
    error = runs.trajectory_error
    assert (error.max("member").values[:-1] > 3 * error.max("member").values[1:]).all()
    assert float(error[-1].max()) < 0.02
    column = planned.columns()[0]
    launches = turned(planned.scene_of(column), "tumbling", 4)
    assert len({launch.tobytes() for launch in launches["node_offset"]}) == 4
    assert len(np.unique(runs.touchdown_phase.values[0])) == 4
    assert meanings_of(collect([runs], planned.criteria).criterion) == ["finite", "energy", "trajectory"]


def test_progress_is_told_within_a_column(tmp_path):
    planned, told = small(members=BLOCK + 1, omega_h={"from": 3.0, "to": 0.5, "count": 20}), []
    compute_shard(planned, rounds.scan(planned), tmp_path / "x.h5", told.append)
    assert len(told) == 2 * 2 * len(planned.columns())  # two blocks of members, two handfuls of cells
    assert told == sorted(told)
    assert told[-1] == 1.0


def stepped(scene, steps, late):
    """All members of a cube that slides, in plain NumPy: the largest energy and apex ratio of each, and the phase.

    Flat ground, nodes at two heights; x only through its speed. Both ratios from places and speeds at each step.
    """
    g, h, half, ground = scene.gravity, scene.duration / steps, scene.cube.side / 2, scene.ground
    (u, _, w), z = scene.launch.velocity, scene.launch.position[2]
    z, w, u = z + w * late - g * late**2 / 2, w - g * late, np.full(len(late), u)
    sag = g / (4 * ground.stiffness)
    lowest = g * max(10 * sag, 0.1 * scene.cube.radius)

    def energy():
        return u**2 / 2 + (w - g * h / 2) ** 2 / 2 + g * z

    start, scale = energy(), u**2 / 2 + w**2 / 2 + g * (z - half + sag / 2)
    ratio, apex, phase = np.ones(len(z)), np.zeros(len(z)), np.full(len(z), np.nan)
    flown, height = np.full(len(z), 2), (w - g * h / 2) ** 2 / 2 + g * (z - half)
    for _ in range(steps):
        before = z - half
        push = np.zeros(len(z))
        for node in (-half, half):
            depth = -(z + node)
            force = np.maximum(0, ground.stiffness * np.maximum(0, depth) - ground.damping * w)
            push += 4 * (np.where(depth > 0, force, 0) if ground.contact == "gated" else force)
        u = u - h * ground.friction * push * u / (np.abs(u) + 1e-6)
        w = w + h * (push - g)
        z = z + h * w
        touching = z <= half
        first = touching & np.isnan(phase)
        phase[first] = before[first] / (before - (z - half))[first]
        flown = np.where(touching, 0, flown + 1)
        ratio = np.where(touching, ratio, np.maximum(ratio, 1 + (energy() - start) / scale))
        level = ((z - half - before) / h) ** 2 / 2 + g * ((z - half + before) / 2 + g * h * h / 8)
        apex = np.where(flown == 2, np.maximum(apex, level / np.maximum(height, lowest)), apex)
        height = np.where(flown == 2, level, height)
    return ratio, apex, phase


@pytest.mark.parametrize("duration", [2.0, 10.0], ids=["first bounce", "whole run"])
@pytest.mark.long
def test_a_sweep_against_plain_numpy(tmp_path, duration):
    """The first bounce to round-off; after many, which amplify it, how many members pass."""
    members = 32
    planned = small(members=members, scene=from_mapping({"duration": duration}))
    runs = computed(planned, tmp_path)
    ours, theirs = [], []
    for k in range(runs.sizes["cell"]):
        cell = runs.isel(cell=k)
        column = Column(planned.contact[int(cell.contact)], float(cell.stiffness))
        steps = int(cell.steps)
        late = np.arange(members) / members * duration / steps
        ratio, apex, phase = stepped(planned.scene_of(column), steps, late)
        np.testing.assert_allclose(cell.touchdown_phase, phase, rtol=0, atol=1e-9)
        if duration < 3:
            np.testing.assert_allclose(cell.energy_ratio, ratio, rtol=1e-9)
            np.testing.assert_allclose(cell.apex_ratio, apex, rtol=1e-7, atol=1e-9)
        ours.append([(cell.energy_ratio <= 1.05).mean(), (cell.apex_ratio <= 1.02).mean()])
        theirs.append([(ratio <= 1.05).mean(), (apex <= 1.02).mean()])
    ours, theirs = np.array(ours), np.array(theirs)
    assert 0.1 < ours.mean() < 0.9
    # Were members that flip drawn by chance, two shares would differ by three of these in one cell of 300.
    spread = np.sqrt(2 * np.maximum(theirs * (1 - theirs), 1 / members) / members)
    assert (np.abs(ours - theirs) <= 3 * spread).all()
    assert np.abs(ours.mean() - theirs.mean()) < 0.005


def test_the_scan_is_where_theory_says_trouble_is(collected, plan):
    """Above ωh = 2 all gated members fail, far below it none does."""
    gated = collected.isel(cell=collected.contact.values == plan.contact.index("gated"))
    failing = gated.failing.values[list(plan.criteria).index("energy")]
    assert (failing[gated.omega_h.values > linear_theory.STABILITY_LIMIT] == plan.members).mean() > 0.9
    assert (failing[gated.omega_h.values < 0.25] == 0).all()


PEAK = """
import dataclasses, resource, sys
from stiffdice.study import config as study
from stiffdice.sweep.shard import compute_shard
from stiffdice.sweep.grid import Piece
plan = study.load("config/quick.yaml").sweeps["steps-needed"]
for members in (128, 1920):
    plan = dataclasses.replace(plan, members=members, contact=("gated",))
    column = plan.columns()[0]
    compute_shard(plan, [Piece(column, plan.scan(column))], f"{sys.argv[1]}/{members}.h5")
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)  # kB, so far
"""


@pytest.mark.long
def test_memory_does_not_grow_with_the_members(tmp_path):
    """Fifteen times as many runs; kept in memory, their measures alone would be 15 MB."""
    command = [sys.executable, "-c", PEAK, str(tmp_path)]
    few, many = map(int, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split())
    assert (tmp_path / "1920.h5").stat().st_size > 7 * (tmp_path / "128.h5").stat().st_size
    assert many - few < 7_000
