from __future__ import annotations

import pytest

from stiffdice.dynamics.model_selection import least_model
from stiffdice.experiments.model_ablation.pieces import pieces_of
from stiffdice.scene.scene import Scene


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_each_scene_needs_all_but_its_piece(contact):
    found = pieces_of(Scene().with_ground(contact=contact))
    for name, piece in found.items():
        assert least_model(piece.scene)[0] == piece.least, name
    assert (found["tensor"].full, found["all"].full) == ("tensor", "tumbling")
