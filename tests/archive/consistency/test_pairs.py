"""A file of two cubes that cannot be so is told of, one as it was written is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.archive.consistency import check
from stiffdice.scene import pair
from stiffdice.simulation.pair import energy_budget
from stiffdice.simulation.pair.dataset import pair_dataset
from stiffdice.simulation.pair.run import simulate_pair

TWO = Path(__file__).parents[3] / "config" / "scenes" / "two-cubes.yaml"
STEPS, EVERY = 4000, 20


def run_of(*changes, scheme="symplectic_euler", steps=STEPS):
    return pair_dataset(simulate_pair(pair.load(TWO, changes), scheme=scheme, steps=steps, every=EVERY))


@pytest.fixture(scope="module")
def run():
    ledger = energy_budget.ledger(pair.load(TWO), steps=STEPS, every=EVERY)
    return run_of().assign(ledger.data_vars)


def changed(dataset, name, change):
    """The same with one value changed: at the contact's last kept state, of the last cube, x."""
    other = dataset.copy(deep=True)
    values = other[name].values
    place = np.flatnonzero(dataset.contact_energy.values)[-1:] if other[name].dims[:1] == ("time",) else ()
    index = (*(int(k) for k in place), *(-1 for _ in values.shape[1:]))
    values[index] = change(values[index])
    return other


@pytest.mark.parametrize("scheme", ["symplectic_euler", "velocity_verlet", "rk4"])
def test_what_was_written_can_be_so(scheme):
    run = run_of(scheme=scheme)
    assert check.kind_of(run) == "pair"
    assert check.problems(run) == []


def test_boxes_loaded_ones_and_runs_that_end_early_can_be_so():
    load = ["cubes.0.cube.sides=[0.3, 0.4, 0.5]", "cubes.1.cube.load={at: corner, mass: 0.2}"]
    assert check.problems(run_of(*load)) == []
    deep = run_of("cubes.0.launch.velocity=[900, 0, 0]", "cubes.0.launch.position=[0, 0, 1.4]")
    assert int(deep.steps_done) < STEPS
    assert check.problems(deep) == []


def test_a_run_with_its_ledger_can_be_so(run):
    assert check.problems(run) == []
    assert check.word_problems(run) == []


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("position", "potential_energy"),
        ("velocity", "kinetic_energy"),
        ("angular_momentum", "kinetic_energy"),
        ("node_offset", "cube 1: distances between nodes"),
        ("kinetic_energy", "kinetic_energy"),
        ("potential_energy", "potential_energy"),
        ("contact_energy", "contact_energy"),
        ("body_contact_spring_work", "sum of works on a cube"),
        ("body_kick_defect", "sum of works on a cube"),
        ("body_kinetic_energy", "sum of works on a cube"),
        ("scheme_work", "sum of works"),
        ("booked_energy", "sum of works"),
    ],
)
def test_a_number_that_is_off_by_a_billionth_is_seen(run, name, told):
    found = check.problems(changed(run, name, lambda value: value * (1 + 1e-9) + 1e-9))
    assert any(line.startswith(told) for line in found), found


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda run: run.assign(verdict=run.verdict + 2), "verdict = 2: allowed is what energy_ratio"),
        (lambda run: run.assign(energy_ratio=run.energy_ratio + 1), "verdict = 0: allowed is what energy_ratio"),
        (lambda run: run.assign(steps_done=run.steps_done - 1000), "step: 201 states; allowed are 151"),
        (lambda run: run.assign_coords(time=run.time + 1e-9), "time"),
        (lambda run: run.assign_attrs(omega_h=1.0), "omega_h = 1: allowed is"),
    ],
)
def test_a_verdict_that_numbers_do_not_give_is_seen(run, change, told):
    found = check.problems(change(run))
    assert any(line.startswith(told) for line in found), found
