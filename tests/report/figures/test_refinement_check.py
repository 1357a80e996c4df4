from __future__ import annotations

import numpy as np
import pytest
from matplotlib.patches import StepPatch
from tests.report.figures import drawing

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.sweep import refinement_check, stability_limits


@pytest.fixture(scope="module")
def given(collected):
    """A sweep, and the same without every other cell."""
    return {
        "dense": stability_limits.find(collected),
        "thin": stability_limits.find(collected.isel(cell=np.arange(collected.sizes["cell"]) % 2 == 0)),
    }


@pytest.fixture(scope="module")
def drawn(given):
    return drawing.drawn("refinement-check", given)


def test_axes_have_units(drawn):
    drawing.check_units(drawn)
    assert all("[" in axes.get_xlabel() for axes in drawn.axes)


@pytest.mark.broad
def test_equal_data_give_equal_files(given, tmp_path):
    drawing.check_equal_files("refinement-check", given, tmp_path)


@pytest.mark.parametrize(("row", "edge"), [(0, "last_fail"), (1, "first_pass")])
def test_every_sweep_has_its_edges_of_every_criterion_that_fails(given, drawn, row, edge):
    dense = given["dense"]
    product = dense.limit.values * linear_theory.STABILITY_LIMIT
    for k, law in enumerate(dense.contact.values):
        lines = [line for line in drawn.axes[2 * row + k].get_lines() if len(line.get_xdata()) > 2]
        shown = {(line.get_marker(), line.get_color()): line.get_ydata() for line in lines}
        broken = [c for c, name in enumerate(meanings_of(dense.criterion)) if dense.last_fail[law, c].notnull().any()]
        assert len(shown) == 2 * len(broken) > 2
        for c in broken:
            color = style.CRITERION_LOOKS[meanings_of(dense.criterion)[c]]["color"]
            for mark, found in zip("_x", given.values(), strict=True):
                np.testing.assert_allclose(shown[mark, color], product / found[edge].values[k, c])


def test_the_densest_panel_holds_every_cell(given, drawn):
    """The area below is the number of cells at a stiffness, but for those outside of the span that both have."""
    for k, law in enumerate(given["dense"].contact.values):
        panel = drawn.axes[6 + k]
        low, high = panel.get_xlim()
        steps = [patch for patch in panel.patches if isinstance(patch, StepPatch)]
        for patch, found in zip(steps, given.values(), strict=True):
            values, edges, _ = patch.get_data()
            inside = (found.cell_contact == law) & (found.cell_omega_h >= low) & (found.cell_omega_h <= high)
            area = (values * np.diff(np.log(edges))).sum()
            assert area == pytest.approx(int(inside.sum()) / found.sizes["stiffness"], rel=1e-9)


def test_the_share_panel_shows_the_means_of_both(given, drawn):
    panel = drawn.axes[4]
    stiffest = float(given["dense"].stiffness.max())
    criterion = panel.get_title(loc="left").split(",")[0]
    parts = [
        refinement_check.scans(found)[refinement_check.Column("ungated", criterion, stiffest)]
        for found in given.values()
    ]
    ends = refinement_check.bins(*parts)
    _, mean = (patch.get_data()[0] for patch in panel.patches)
    np.testing.assert_allclose(mean, refinement_check.binned(parts[0], ends)[0])
    (bars,) = panel.containers
    np.testing.assert_allclose(bars[0].get_ydata(), refinement_check.binned(parts[1], ends)[0])


def test_the_legend_tells_the_runs(given, drawn):
    (legend,) = drawn.legends
    texts = [text.get_text() for text in legend.get_texts()]
    runs = given["dense"].sizes["cell"] * given["dense"].attrs["members"]
    assert f"dense: {runs:,} runs" in texts
    assert any(text.startswith(f"thin: {given['thin'].sizes['cell'] * 8:,} runs (50%)") for text in texts)
