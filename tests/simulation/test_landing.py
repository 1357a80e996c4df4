"""Faces are decided by energy: no throw ever ends on another, and fair dice come out fair."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.scene import die
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.landing import Rest, faces_of, land
from stiffdice.simulation.launch_distribution import LaunchDistribution

THROWN = LaunchDistribution(velocity_spread=0.3, spin_spread=30.0)
BODIES = {
    "cube": {},
    "box": {"side": None, "sides": "[16, 16, 20] mm"},
    "loaded": {"load": {"at": "corner", "mass": "1 g"}},
}
GROUNDS = {
    "hard": {},
    "bouncing": {"restitution": 0.8, "friction": 0.05},
    "soft": {"contact_time": "10 ms"},
    "ungated": {"restitution": None, "contact_time": None, "stiffness": 6e4, "damping": 0.05, "contact": "ungated"},
}


def scene_of(body="cube", ground="hard", duration=2.0, **launch):
    cube = {"side": "16 mm", "mass": "5 g"} | BODIES[body]
    contact = {"restitution": 0.5, "contact_time": "1 ms", "friction": 0.2} | GROUNDS[ground]
    return from_mapping(
        {
            "cube": {key: value for key, value in cube.items() if value is not None},
            "ground": {key: value for key, value in contact.items() if value is not None},
            "launch": {"position": [0, 0, 0.1], "velocity": [1, 0, 0], "node_velocity": "rigid", **launch},
            "gravity": 9.81,
            "duration": duration,
        }
    )


def face_up(ends):
    """The face that points up most, from the nodes alone."""
    edges = np.einsum("ke,mkx->mex", SIGNS, ends["node_offset"])
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    return (edges[:, :, 2] @ die.NORMALS.T).argmax(axis=1) + 1


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("body", BODIES)
def test_the_face_that_energy_decides_is_the_one_at_rest(body, ground):
    scene = scene_of(body, ground, duration=6.0 if ground == "bouncing" else 2.0)
    launches = THROWN.draw(scene, 200)
    early = land(scene, launches, steps=40_000)
    full = land(scene, launches, steps=40_000, early_stop=False)
    assert (early.rest == Rest.SETTLED).mean() > 0.99
    decided = early.rest == Rest.SETTLED
    np.testing.assert_array_equal(early.face[decided], full.face[decided])
    np.testing.assert_array_equal(full.face, face_up(full.ends))
    assert (early.steps[decided] < full.steps[decided]).all()


@pytest.mark.broad
@pytest.mark.parametrize("ground", ["hard", "ungated"])
def test_no_face_differs_from_full_rest_in_a_hundred_thousand_throws(ground):
    scene = scene_of("cube", ground)
    launches = THROWN.draw(scene, 100_000)
    early = land(scene, launches, steps=16_000, threads=2)
    full = land(scene, launches, steps=16_000, early_stop=False, threads=2)
    decided = early.rest == Rest.SETTLED
    assert decided.mean() > 0.999
    assert not (early.face != full.face)[decided].any()


@pytest.mark.parametrize(
    "count", [pytest.param(20_000, marks=pytest.mark.long), pytest.param(200_000, marks=pytest.mark.broad)]
)
def test_a_fair_cube_from_uniform_orientations_comes_out_fair(count):
    scene = scene_of()
    result = land(scene, THROWN.draw(scene, count), steps=16_000, threads=2)
    seen = np.bincount(result.face, minlength=7)[1:]
    chi_square = ((seen - count / 6) ** 2 / (count / 6)).sum()
    assert chi_square < 20.5  # one in a thousand with five degrees of freedom


def test_no_throw_depends_on_its_neighbours_or_on_threads():
    scene = scene_of("loaded")
    launches = THROWN.draw(scene, 60)
    whole = land(scene, launches, steps=8000)
    for part in (land(scene, launches[17:41], steps=8000), land(scene, launches, steps=8000, threads=3)):
        chosen = slice(17, 41) if len(part.face) == 24 else slice(None)
        np.testing.assert_array_equal(part.face, whole.face[chosen])
        np.testing.assert_array_equal(part.steps, whole.steps[chosen])
        assert part.ends.tobytes() == whole.ends[chosen].tobytes()


@pytest.mark.parametrize(
    "schemes",
    [
        pytest.param(["velocity_verlet"], marks=pytest.mark.long),
        pytest.param(["symplectic_euler", "rk4", "implicit_euler"], marks=pytest.mark.broad),
    ],
    ids=["one", "others"],
)
def test_every_scheme_throws_the_same_die(schemes):
    """Dropped so low that chaos has no time: at short steps throws end on the same face, whatever the scheme."""
    scene = scene_of(duration=0.8, position=[0, 0, 0.03], velocity=[0.2, 0, 0])
    launches = LaunchDistribution(velocity_spread=0.1, spin_spread=10.0).draw(scene, 100)
    best = land(scene, launches, scheme="event", steps=2000)
    for scheme in schemes:
        found = land(scene, launches, scheme=scheme, steps=100_000)
        assert (found.face == best.face).mean() > 0.9, scheme


def test_a_die_that_stands_on_an_edge_is_cocked():
    scene = scene_of(position=[0, 0, 0.016 / 2**0.5], velocity=[0, 0, 0], orientation=[np.pi / 4, 0, 0], duration=0.2)
    balanced = LaunchDistribution(orientation="as_launched", velocity_spread=0.0, spin_spread=0.0)
    launches = balanced.draw(scene_of(position=[0, 0, 0.02], velocity=[0, 0, 0], orientation=[np.pi / 4, 0, 0]), 1)
    launches["position"][:, 2] = 0.016 / 2**0.5
    result = land(scene, launches, steps=8000)
    assert result.rest[0] == Rest.COCKED
    assert Rest(int(result.rest[0])).sentence.startswith("cocked")


def test_a_throw_that_is_cut_off_is_unsettled_and_one_that_explodes_is_told():
    scene = scene_of(duration=0.2)
    launches = THROWN.draw(scene, 50)
    assert (land(scene, launches, steps=4000).rest == Rest.UNSETTLED).mean() > 0.8
    assert (land(scene_of(), launches, steps=1200).rest == Rest.BLEW_UP).mean() > 0.5


@pytest.mark.parametrize("body", BODIES)
def test_barriers_are_the_weight_over_the_edges(body):
    scene = scene_of(body)
    faces, weight = faces_of(scene), scene.cube.mass * scene.gravity
    sunk = weight**2 / (2 * scene.ground.stiffness)
    half, centre = np.array(scene.cube.half_sides), scene.cube.distribution.centre
    np.testing.assert_allclose(faces.barrier + sunk, weight * die.tipping_heights(half, centre))
    assert (faces.barrier > weight * faces.height).all()


def test_a_slope_and_no_gravity_settle_nothing():
    launches = THROWN.draw(scene_of(), 1)
    for change in ({"ground": {"normal": [0, 0.1, 1]}}, {"gravity": 0}):
        with pytest.raises(InputError, match="level ground under gravity"):
            land(from_mapping(change), launches)
