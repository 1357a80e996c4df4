"""Steps for faces keep the distribution of faces, on dice and grounds that the rule was not made with."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from stiffdice.advice import landing
from stiffdice.cli.main import main
from stiffdice.errors import InputError
from stiffdice.experiments.dice.coarse_steps import steps_at
from stiffdice.experiments.dice.throws import many
from stiffdice.integrators import linear_stability
from stiffdice.scene import die
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.launch_distribution import LaunchDistribution

DIE = from_mapping(die.SCENE)


def unseen(number: int) -> tuple[Scene, LaunchDistribution]:
    """A die, a ground and a launch drawn at random: sides, load, restitution, friction, contact time, speed, spin."""
    random = np.random.default_rng([18, number])
    sides = 0.016 * np.exp(random.uniform(-0.25, 0.25, 3))
    cube = {
        "sides": sides.tolist(),
        "mass": 0.005,
        "load": {"at": "corner", "mass": 0.005 * random.uniform(0.01, 0.25)},
    }
    ground = {
        "restitution": random.uniform(0.1, 0.7),
        "contact_time": float(np.exp(random.uniform(np.log(0.5e-3), np.log(3e-3)))),
        "friction": random.uniform(0.05, 0.4),
    }
    launch = {"position": [0, 0, random.uniform(0.05, 0.2)], "velocity": [random.uniform(0, 1.5), 0, 0]}
    scene = {"cube": cube, "ground": ground, "launch": launch | {"node_velocity": "rigid"}, "gravity": 9.81}
    thrown = LaunchDistribution(velocity_spread=0.3, spin_spread=random.uniform(5, 40), seed=number)
    return from_mapping({**scene, "duration": 4.0}), thrown


def compared(numbers: range, error: float, throws: int) -> tuple[float, int]:
    """Return chi-square of the advised steps' faces against those of steps a third as long, and degrees of freedom."""
    total = 0.0
    for number in numbers:
        scene, launches = unseen(number)
        advised = landing.advise(scene, error)
        coarse = many(scene, launches, advised.scheme, advised.steps, throws)
        other = dataclasses.replace(launches, seed=1000 + number)
        fine = many(scene, other, advised.scheme, steps_at(scene, advised.omega_h / 3), throws)
        assert coarse.counts.sum() > 0.99 * throws  # some spin on a corner like a top
        a, b = coarse.counts / coarse.counts.sum(), fine.counts / fine.counts.sum()
        total += float((throws * (a - b) ** 2 / (a + b)).sum())
    return total, 5 * len(numbers)


@pytest.mark.parametrize(
    ("dice", "throws"),
    [pytest.param(4, 2_000, marks=pytest.mark.long), pytest.param(50, 4_000, marks=pytest.mark.broad)],
)
def test_the_promise_holds_for_dice_that_it_has_not_seen(dice, throws):
    """As far as so many throws can tell: of fifty dice an average total variation of 0.01 would be seen."""
    chi_square, freedom = compared(range(dice), 0.003, throws)
    assert chi_square < freedom + 4 * np.sqrt(2 * freedom)


def test_shorter_errors_take_more_steps_and_a_stiffer_ground_too():
    assert landing.advise(DIE, 0.001).steps > landing.advise(DIE, 0.003).steps == landing.advise(DIE, 0.1).steps
    stiff = DIE.with_ground(stiffness=4 * DIE.ground.stiffness)
    assert (
        1.5 < landing.advise(stiff, 0.003).steps / landing.advise(DIE, 0.003).steps < 2
    )  # the same damping is less of it
    limit = linear_stability.stability_limit("symplectic_euler", linear_stability.hardest(DIE, "tumbling").zeta)
    assert landing.advise(DIE, 0.003).omega_h == pytest.approx(0.3 * limit, rel=1e-3)
    dead = from_mapping({**die.SCENE, "ground": {"restitution": 0.1, "contact_time": "1 ms"}})
    assert landing.advise(dead, 0.003).omega_h < 0.5  # strong damping lowers the limit


def test_what_was_not_measured_is_not_promised():
    for scene, error, told in (
        (DIE, 1e-4, "error = 0.0001: allowed for a landing is a total variation of 0.001 or more"),
        (DIE.with_ground(stiffness=0.0), 0.01, "ground.stiffness = 0"),
        (DIE.with_ground(normal=(0.0, 0.1, 1.0)), 0.01, "level ground"),
    ):
        with pytest.raises(InputError, match=told):
            landing.advise(scene, error)


def test_the_command_tells_it(capsys):
    assert main(["advise", "config/scenes/die.yaml", "--for", "landing", "--error", "0.3%", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == landing.advise(DIE, 0.003).steps
    assert main(["advise", "--for", "landing", "--horizon", "1"]) == 2
    assert "--horizon: is of a path" in capsys.readouterr().err
