from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of
from stiffdice.scene.pair import from_mapping
from stiffdice.simulation.pair import reference
from stiffdice.simulation.pair.energy import energies

ONE = {"position": [0, 0, 5], "orientation": [0.3, 0.2, 0.1]}
ONE |= {"velocity": [1, 0.2, 0], "angular_momentum": [0.3, -0.5, 0.4]}
TWO = {"position": [1.5, 0.3, 5.2], "orientation": [-0.2, 0.5, 0.7]}
TWO |= {"velocity": [-1, 0, 0], "angular_momentum": [-0.6, 0.3, 0.7]}


def meeting(**ground):
    cubes = [{"cube": {"side": 1, "mass": 1}, "launch": ONE}, {"cube": {"side": 1, "mass": 2}, "launch": TWO}]
    whole = {"stiffness": 1e3, "damping": 0, "friction": 0, **ground}
    return from_mapping({"cubes": cubes, "ground": whole, "gravity": 0, "duration": 0.6})


@pytest.mark.long
@pytest.mark.parametrize("ground", [{}, {"damping": 3.0}])
def test_a_meeting_keeps_both_momenta_and_without_damping_the_energy(ground):
    scene = meeting(**ground)
    launch = pair_start_of(scene)
    states = reference.states_at(scene, launch, [0.0, 0.3, 0.6])
    np.testing.assert_allclose(states["a"]["node_offset"][0], launch["a"]["node_offset"][0], atol=1e-15)
    mass = np.array([cube.mass for cube in scene.cubes])
    momentum = sum(m * states[k]["velocity"] for m, k in zip(mass, "ab", strict=True))
    turning = sum(
        states[k]["angular_momentum"] + m * np.cross(states[k]["position"], states[k]["velocity"])
        for m, k in zip(mass, "ab", strict=True)
    )
    np.testing.assert_allclose(momentum - momentum[0], 0, atol=1e-13)
    np.testing.assert_allclose(turning - turning[0], 0, atol=1e-11)
    energy = energies(pair_physics_of(scene), states, 0.0)[4]
    if ground:
        assert energy[2] < 0.9 * energy[0]
    else:
        np.testing.assert_allclose(energy / energy[0], 1, rtol=1e-10)
        assert not np.allclose(states["a"]["velocity"][2], states["a"]["velocity"][0], atol=0.1)
