"""The numbers that docs/explanation/paper.md and method.md state of the paper, measured again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.scene.cube import Cube
from stiffdice.scene.scene import from_mapping, load
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

SCENES = Path(__file__).parent.parent / "config" / "scenes"


def thrown(number, preset, steps, every=1):
    return simulate(
        load(SCENES / f"figure-{number:02d}.yaml", preset=preset), model="sliding", steps=steps, every=every
    )


@pytest.mark.long
def test_four_fifths_of_the_energy_lost_is_lost_in_mid_air():
    kept = thrown(13, "as_listed", 1_000_000).trajectory
    energy = kept.energy_paper + kept.elastic_energy
    airborne = kept.elastic_energy == 0
    in_air = -np.diff(energy)[airborne[1:] & airborne[:-1]].sum()
    assert in_air / (energy[0] - energy[-1]) == pytest.approx(0.80, abs=0.005)


@pytest.mark.parametrize(("preset", "rebound"), [("as_listed", 1.84), ("as_written", 4.23)])
def test_the_first_rebound(preset, rebound):
    kept = thrown(13, preset, 10_000).trajectory
    z = kept.state["position"][:, 2]
    tops = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
    assert tops[1] == pytest.approx(rebound, abs=0.005)


def test_ten_and_twenty_thousand_steps_are_two_special_numbers():
    stiff = load(SCENES / "figure-09.yaml")
    assert linear_theory.omega_h(stiff, 10_000) == 2
    assert linear_theory.omega_h(stiff, 20_000) == pytest.approx(2 * np.sin(np.pi / 6), rel=1e-15)
    assert thrown(9, "as_listed", 10_000).verdict[0] == Verdict.ENERGY_GREW
    assert thrown(11, "as_listed", 20_000).verdict[0] == Verdict.PASSED


@pytest.mark.parametrize("h", [1e-3, 1e-4, 1e-5])
def test_friction_at_rest_chatters_as_predicted(h):
    rest = Cube().side / 2 - 9.8 / 4e4
    still = {"position": [0, 0, rest], "velocity": [0.01, 0, 0]}
    scene = from_mapping({"ground": {"damping": 5, "contact": "gated"}, "launch": still, "duration": 2.0})
    run = simulate(scene, model="sliding", steps=round(2 / h), every=1)
    swing = np.abs(run.trajectory.state["velocity"][-500:, 0]).max()
    assert swing == pytest.approx(0.075 * 9.8 * h / 2 - 1e-6, rel=1e-4)


def test_friction_overshoots_in_a_stiff_bounce():
    speed = thrown(11, "as_written", 20_000).trajectory.state["velocity"][:, 0]
    assert speed.min() == pytest.approx(-0.264, abs=0.001)


def test_figure_six_comes_to_rest_only_as_listed():
    ends = {
        preset: thrown(6, preset, 10_000).trajectory.state["position"][-2000:, 2]
        for preset in ("as_listed", "as_written")
    }
    assert np.ptp(ends["as_listed"]) < 0.1
    assert np.ptp(ends["as_written"]) > 3


def test_figure_eight_dips_below_the_ground():
    assert thrown(8, "as_listed", 10_000).trajectory.state["position"][:, 2].min() == pytest.approx(-0.38, abs=0.01)


def test_a_tumbling_rebound_rises_by_a_factor():
    keys = {"ground": {"damping": 0.1, "friction": 0.1}, "launch": {"angular_momentum": [0.3, 0.5, 0.2]}}
    kept = simulate(from_mapping(keys), model="tumbling", steps=100_000, every=1).trajectory
    z = kept.state["position"][:, 2]
    tops = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
    assert (tops[1:] / tops[:-1]).max() == pytest.approx(1.8, abs=0.05)
