"""The page's die shows the face that the simulator decides, and counts them as a fair die has them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi2

from stiffdice.dynamics.state import Ensemble, edges_of
from stiffdice.experiments.dice.throws import default_steps
from stiffdice.report.explorer import page
from stiffdice.scene import die
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.landing import Rest, faces_of, land
from stiffdice.simulation.launch_distribution import LaunchDistribution
from stiffdice.simulation.run import simulate

SCENE = from_mapping(die.SCENE, "as_written")
STEPS = default_steps(SCENE)
LOOK = 64  # steps between two looks, as `land` takes them
THROWN = LaunchDistribution(velocity_spread=0.3, spin_spread=30.0)


def plain(state):
    return {name: state[name].ravel().tolist() for name in state.dtype.names}


def path_of(launch):
    return simulate(SCENE, steps=STEPS, every=LOOK, members=Ensemble(launch[None], np.zeros(1))).trajectory


def faces_below(states):
    return die.face_below(-edges_of(SCENE.cube, states["node_offset"])[:, :, 2], faces_of(SCENE).height)


@pytest.mark.long
def test_the_same_states_have_the_same_faces(opened):
    launches = THROWN.draw(SCENE, 8)
    states = np.concatenate([(path := path_of(launch)).state[path.time < 0.9][::10] for launch in launches])
    decided = land(SCENE, states, steps=STEPS)
    tab = opened()
    told = tab.evaluate(
        """(states) => {
          const die = pageData().die, lag = 0.5 * die.scene.duration / die.steps;
          return states.map((state) => {
            const scene = { ...die.scene, ...state };
            return decideFace({ ...die, scene }, launchOf(scene), lag, Infinity);
          });
        }""",
        [plain(state) for state in states],
    )
    at_once = (decided.steps == 0) & (decided.rest == Rest.SETTLED)
    assert 0.1 < at_once.mean() < 0.9, "decided ones and others are among them"
    assert [one["rest"] == "settled" for one in told] == at_once.tolist()
    assert [one["face"] for one in told] == [die.opposite(face) for face in faces_below(states)]
    margins = np.array([one["margin"] for one in told])
    assert np.array_equal(margins[at_once], decided.margin[at_once])


@pytest.mark.long
def test_the_same_launches_end_on_the_same_faces(opened):
    tab, barrier, same = opened(), faces_of(SCENE).barrier, 0
    for launch in THROWN.draw(SCENE, 20):
        path = path_of(launch)
        below = faces_below(path.state)
        first = np.flatnonzero(path.mechanical_energy < barrier[below - 1])[0]
        told = tab.evaluate("(launch) => landDie(pageData().die, launch)", plain(launch))
        assert told["rest"] == "settled"
        if told["steps"] == path.step[first]:
            assert told["face"] == die.opposite(below[first])
            same += 1
    print(f"{same} of 20 throws were decided in the same step")
    assert same >= 15, "sine and cosine differ in the last digit only, and a throw is short"


@pytest.mark.long
def test_six_hundred_throws_are_those_of_a_fair_die(opened):
    counts = opened().evaluate(
        """() => {
          const die = pageData().die, random = randomNumbers(5), counts = [0, 0, 0, 0, 0, 0];
          for (let k = 0; k < 600; k++) {
            const landed = landDie(die, randomLaunch(die, random));
            if (landed.rest === "settled") counts[landed.face - 1] += 1;
          }
          return counts;
        }"""
    )
    assert sum(counts) == 600, "all settle"
    assert chi2.sf(((np.array(counts) - 100) ** 2 / 100).sum(), 5) > 0.01


@pytest.mark.long
def test_launches_are_drawn_as_stiffdice_throw_draws_them(opened):
    told = opened().evaluate(
        """() => {
          const die = pageData().die, random = randomNumbers(2);
          return JSON.stringify(Array.from({ length: 4000 }, () => randomLaunch(die, random)));
        }"""
    )
    drawn = json.loads(told)  # as numbers one by one they take seconds
    velocity = np.array([launch["velocity"] for launch in drawn])
    spin = np.array([launch["angular_velocity"] for launch in drawn])
    nodes = np.array([launch["node_offset"] for launch in drawn]).reshape(-1, 8, 3)
    spread = page._SPREAD
    assert np.abs(velocity.mean(axis=0) - SCENE.launch.velocity).max() < 4 * spread["velocity_spread"] / 4000**0.5
    assert np.allclose(velocity.std(axis=0), spread["velocity_spread"], rtol=0.05)
    assert np.allclose(spin.std(axis=0), spread["spin_spread"], rtol=0.05)
    first = nodes[:, 0] / np.linalg.norm(nodes[0, 0])
    assert np.allclose((first**2).mean(axis=0), 1 / 3, atol=0.03), "a corner points anywhere alike"
    assert np.allclose(np.linalg.norm(nodes, axis=2), np.sqrt(3) * 0.008, rtol=1e-12)


@pytest.mark.long
def test_the_tail_of_chi_square_is_right(opened):
    values = [0.0, 0.1, 1.0, 4.35, 11.07, 20.5]
    told = opened().evaluate("(values) => values.map(chiSquareTail)", values)
    assert told == pytest.approx(chi2.sf(values, 5), abs=1e-7)


@pytest.mark.long
def test_a_throw_shows_its_face_and_counts_it(opened):
    tab = opened()
    tab.click("#die-throw")
    verdict = tab.locator("#die-verdict")
    face = int(verdict.get_attribute("data-face"))
    assert verdict.inner_text().startswith(f"{face} is up. It was decided after 0.")
    tab.get_by_text("Counts as a table").click()
    assert [row.split("\t")[1] for row in rows_of(tab)] == ["1" if k == face else "0" for k in range(1, 7)]


def rows_of(tab):
    return tab.locator("#die-table tbody tr").all_inner_texts()


@pytest.mark.long
def test_a_hundred_throws_are_counted_in_bars_and_a_table(opened):
    tab = opened()
    tab.get_by_text("Counts as a table").click()
    tab.click("#die-many")
    tab.locator("#die-summary", has_text="100 throws: chi-square").wait_for()
    counts = [int(row.split("\t")[1]) for row in rows_of(tab)]
    assert sum(counts) == 100
    expected = sum((count - 100 / 6) ** 2 for count in counts) * 6 / 100
    assert f"chi-square {expected:.1f} with" in tab.locator("#die-summary").inner_text()
    assert "from 10 to 23" in tab.locator("#die-table caption").inner_text(), "16.7 ± 1.96 √(100·5/36)"
    heights = [float(bar.get_attribute("height")) for bar in tab.locator("#die-bars .bar").all()]
    assert np.allclose(np.array(heights) / heights[0], np.array(counts) / counts[0])
    tab.click("#die-reset")
    assert "Nothing counted" in tab.locator("#die-summary").inner_text()
    tab.click("#die-many")
    tab.locator("#die-summary", has_text="100 throws: chi-square").wait_for()
    assert [int(row.split("\t")[1]) for row in rows_of(tab)] == counts, "one seed, the same throws"
