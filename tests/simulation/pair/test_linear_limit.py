"""The fastest contact of two stacked cubes: in closed form for equal ones, and where runs stop being stable."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from stiffdice.scene import pair
from stiffdice.simulation.pair import linear_limit
from stiffdice.simulation.pair.run import simulate_pair

STACK = Path(__file__).parents[3] / "config" / "scenes" / "stacked-cubes.yaml"
SPRINGS = ["ground.damping=0", "ground.friction=0"]


def square(*changes):
    """Return ω² in S/m of a cube of 1 kg."""
    scene = pair.load(STACK, [*SPRINGS, *changes])
    return linear_limit.hardest(scene).omega ** 2 / scene.ground.stiffness


def test_equal_cubes_rock_at_the_golden_ratio():
    """A cube rocks on springs at 6 S/m (m s²/6, four at s/2); two have the matrix [[2, −1], [−1, 1]] of it."""
    golden = (1 + math.sqrt(5)) / 2
    assert square() == pytest.approx(6 * golden**2, rel=1e-12)


def test_with_the_mass_at_the_corners_they_bounce_faster_than_they_rock():
    """Rocking is then at 2 S/m, bouncing at 4 S/m."""
    golden = (1 + math.sqrt(5)) / 2
    corners = [f"cubes.{number}.cube.inertia=corners" for number in (0, 1)]
    assert square(*corners) == pytest.approx(4 * golden**2, rel=1e-12)


def test_the_order_is_no_matter_and_a_light_cube_is_between_heavy_and_ground():
    light = square("cubes.0.cube.mass=0.01")
    assert light == pytest.approx(square("cubes.1.cube.mass=0.01"), rel=1e-12)
    assert light == pytest.approx(2 * 6 / 0.01, rel=0.02)  # springs of ground and cube on it, the other stands still


def test_a_box_is_as_hard_however_it_is_named():
    sides = [[0.2, 0.3, 0.5], [0.5, 0.2, 0.3], [0.3, 0.5, 0.2]]
    found = [square(f"cubes.0.cube.sides={each}") for each in sides]
    assert found == pytest.approx([found[0]] * 3, rel=1e-12)
    cube = [square(f"cubes.{number}.cube.sides=[0.4, 0.4, 0.4]") for number in (0, 1)]
    assert cube == pytest.approx([square()] * 2, rel=1e-12)


def test_damping_ratio_and_steps_follow():
    scene = pair.load(STACK)
    omega, zeta, _ = linear_limit.hardest(scene)
    assert zeta == pytest.approx(8 / 1e4 * omega / 2)
    limit = 2 * (math.sqrt(1 + zeta**2) - zeta)
    assert linear_limit.fewest_steps(scene, "symplectic_euler") == pytest.approx(omega * 2 / limit)
    assert math.isinf(linear_limit.fewest_steps(pair.load(STACK, SPRINGS), "forward_euler"))
    assert linear_limit.hardest(pair.load(STACK, ["ground.stiffness=0"])).omega == 0


@pytest.mark.parametrize(("omega_h", "most", "least"), [(1.97, 1e-4, 0.0), (2.03, math.inf, 1e-2)])
def test_beyond_the_limit_a_stack_that_leans_a_millionth_is_thrown_about(omega_h, most, least):
    """At rest, sunk in by m g/(4S) and twice that: symplectic Euler keeps a swing up to ωh = 2.

    The upper cube is a little smaller: the nodes of flush ones leave the faces of each other as they lean.
    """
    lean = "cubes.1.launch.orientation=[1e-6, 2e-6, 0]"
    sunk = ["cubes.0.launch.position=[0, 0, 0.19951]", "cubes.1.launch.position=[0, 0, 0.594265]"]
    scene = pair.load(STACK, [*SPRINGS, *sunk, lean, "cubes.1.cube.side=0.39"])
    run = simulate_pair(scene, steps=math.ceil(linear_limit.hardest(scene).omega * 2 / omega_h), every=1)
    turned = np.abs(run.trajectory.state["b"]["angular_momentum"]).max()
    assert least <= turned <= most
