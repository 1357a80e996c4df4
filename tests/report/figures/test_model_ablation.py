from __future__ import annotations

import numpy as np
import pytest
from tests.report.figures.drawing import drawn

from stiffdice.experiments.model_ablation import measure, time
from stiffdice.scene.scene import Scene

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def dataset():
    return measure(Scene(), stiffness=(1e3, 1e4), friction=(0.0, 0.01, 0.15), horizon=3.3)


def test_errors_partings_and_spins_are_drawn_for_each_law_and_friction(dataset):
    panels = drawn("model-ablation", {"pieces": dataset}).axes
    assert len(panels) == 6
    for panel in panels:
        assert "[" in panel.get_ylabel()
    for c, (left, middle, right) in enumerate(zip(*[iter(panels)] * 3, strict=True)):
        errors = [np.asarray(line.get_ydata()) for line in left.get_lines()]
        for f in (1, 2):
            for a in (0, 1):
                assert any(np.array_equal(line, dataset.landing_error[a, c, f]) for line in errors)
        hollow = [line for line in left.get_lines() if line.get_markerfacecolor() == "white" and len(line.get_xdata())]
        unclear = (dataset.landing_error[:, c] <= 3 * dataset.numerical_error[c])[:, 1:].sum()
        assert sum(len(line.get_xdata()) for line in hollow) == unclear
        assert len(middle.get_lines()) == 5
        spins = [np.asarray(line.get_ydata()) for line in right.get_lines()]
        assert any(np.array_equal(line, dataset.spin[c, 2] / 0.15) for line in spins)


def test_times_are_drawn_as_ratios():
    timed = time(Scene().with_ground(contact="gated"), steps=300, rounds=2)
    (panel,) = drawn("model-ablation-time", {"gated": timed}).axes
    assert panel.get_xlabel().endswith("[1]")
    lengths = [bar.get_width() + 1 for bar in panel.patches]
    ratios = np.concatenate([timed[f"{kind}_ratio"] for kind in ("step", "run", "leap")])
    np.testing.assert_allclose(lengths, np.nan_to_num(ratios, nan=1.0))
    assert len(panel.texts) == np.isfinite(ratios).sum()
