from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.report.figures.drawing import check_equal_files, check_units, drawn

from stiffdice.experiments.pair import limits, orders, outcomes
from stiffdice.report.tables import pair as tables
from stiffdice.scene import scene as scenes

pytestmark = pytest.mark.long

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/equal-cubes.yaml")


@pytest.fixture(scope="module")
def edges():
    common = {"stiffness": [1e2, 1e3, 1e4], "count": 20, "members": 4}
    cases = {"meeting": ["head_on", "corner_face"], "stacked": ["stacked"]}
    return {name: limits.measure(SCENE, cases=some, **common) for name, some in cases.items()}


@pytest.fixture(scope="module")
def left():
    some = {"offset": [0.0, 0.3, 0.6, 0.9], "friction": [0.0, 0.2], "stiffness": 1e3}
    return {"outcomes": outcomes.measure(SCENE, **some)}


def test_each_case_has_a_panel_with_its_edges_and_predictions(edges, tmp_path):
    figure = drawn("pair-limits", edges)
    check_units(figure)
    shown = [panel for panel in figure.axes if panel.get_visible()]
    assert [panel.get_title(loc="left").split(":")[0] for panel in shown] == [
        "head-on, face on face",
        "corner on face",
        "stacked on the ground",
    ]
    assert "ω² = 8 S/m" in shown[0].get_title(loc="left")
    curves = [np.asarray(line.get_ydata()) for line in shown[1].get_lines()]
    for name in ("first_pass", "steps_needed", "last_fail", "limit", "gain", "bound"):
        assert any(np.array_equal(curve, edges["meeting"][name][1], equal_nan=True) for curve in curves), name
    check_equal_files("pair-limits", edges, tmp_path)


def test_spins_and_energy_are_drawn_for_each_friction(left, tmp_path):
    figure = drawn("pair-outcomes", left)
    check_units(figure)
    found = left["outcomes"]
    scale = 1.0 / SCENE.cube.side
    for row in range(2):
        for body in range(2):
            curves = [np.asarray(line.get_ydata()) for line in figure.axes[3 * row + body].get_lines()]
            for mu in range(2):
                spin = found.spin.values[row, 0, mu, :, body] / scale
                assert any(np.array_equal(curve, spin) for curve in curves)
    check_equal_files("pair-outcomes", left, tmp_path)


def test_tables_tell_edges_outcomes_and_orders(edges, left):
    told = tables.limits(edges, "A title").markdown
    assert "| head-on, face on face | 8 |" in told
    assert "| 2 | 0.466 | 0.436 |" in told
    told = tables.outcomes(left, "A title").markdown.splitlines()
    rows = [line for line in told if line.startswith("| faces parallel | 1 | 0 | 0.3 |")]
    spin = float(left["outcomes"].spin[0, 0, 0, 1, 0]) * SCENE.cube.side
    assert f"| {spin:.3f} |" in rows[0]
    measured = orders.measure(SCENE, steps=[8, 16, 32, 64], damping=[0.0])
    told = tables.orders({"orders": measured}, "A title").markdown
    assert "| within one contact | 0 | 1.0" in told or "| within one contact | 0 | 0.9" in told
    assert "64 steps in the stretch" in told
