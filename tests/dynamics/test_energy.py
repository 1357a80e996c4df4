from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

LOSSLESS = {"damping": 0, "friction": 0, "contact": "gated", "stiffness": 1e3}


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_without_losses_kinetic_potential_and_elastic_energy_add_up_to_a_constant(model):
    """Half the energy is in the springs at times; the sum keeps to the O(h) of the scheme."""
    scene = from_mapping({"ground": LOSSLESS, "launch": {"angular_momentum": [0.2, 0.4, 0.1]}, "duration": 4})
    kept = simulate(scene, model=model, steps=400_000, every=100).trajectory
    total = kept.energy_paper + kept.elastic_energy
    assert np.ptp(kept.energy_paper) > 0.3 * total[0]
    assert np.ptp(total) < 1e-3 * total[0]


def test_each_part_by_hand():
    """Four nodes are 0.1 m deep."""
    low = 1 / np.sqrt(3) - 0.1
    scene = from_mapping(
        {
            "cube": {"mass": 2, "radius": 1, "geometry": "exact"},
            "ground": {"stiffness": 50},
            "launch": {
                "position": [0, 0, low],
                "velocity": [3, 0, 4],
                "angular_momentum": [0, 0, 0.6],
            },
        }
    )
    kinetic, potential, elastic = energies(physics_of(scene), start_of(scene, "tumbling"))
    inertia = 2 * (4 / 3) / 6
    assert kinetic[0] == pytest.approx(0.5 * 2 * 25 + 0.5 * 0.36 / inertia, rel=1e-14)
    assert potential[0] == pytest.approx(2 * 9.8 * low, rel=1e-14)
    assert elastic[0] == pytest.approx(4 * 0.5 * 50 * 0.01, rel=1e-12)


def test_springs_press_along_the_normal():
    tilted = {"normal": [1, 0, 1], "stiffness": 50}
    scene = from_mapping({"ground": tilted, "launch": {"position": [0, 0, -10]}})
    _, _, elastic = energies(physics_of(scene), start_of(scene, "sliding"))
    depths = -(np.array([0, 0, -10]) + scene.cube.node_offsets()) @ scene.ground.normal
    assert elastic[0] == pytest.approx(0.5 * 50 * np.sum(depths**2), rel=1e-13)
