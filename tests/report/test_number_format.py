from __future__ import annotations

import numpy as np
import pytest

from stiffdice.report import number_format
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate


def test_the_note_under_a_figure_says_what_was_run():
    scene = from_mapping({"ground": {"stiffness": 1e5, "damping": 0.3, "friction": 0.4}}, preset="as_listed")
    run = run_dataset(simulate(scene, model="sliding", steps=3000, every=10))
    assert number_format.describe(run) == (
        "sliding, symplectic euler, 3,000 steps (ωh = 2.11); S = 10⁵ kg/s², D = 0.3 kg/s, μ = 0.4"
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(1e6, "10⁶"), (2.5e4, "2.5×10⁴"), (0.075, "0.075"), (0, "0"), (1e-6, "10⁻⁶"), (9999, "9999"), (1e-3, "0.001")],
)
def test_numbers_are_written_as_people_do(value, text):
    assert number_format.readable(value) == text


def test_a_number_is_rounded_before_its_form_is_chosen():
    assert number_format.readable(9999, digits=2) == "10⁴"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(12.34, "12.3 s"), (0.5, "500 ms"), (2.5e-5, "25 µs"), (3e-9, "3 ns"), (1e8, "3.17 years"), (np.nan, "nan ns")],
)
def test_a_time_is_written_in_its_unit(seconds, text):
    assert number_format.duration(seconds) == text
