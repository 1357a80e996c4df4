from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex
from tests import rounds
from tests.report.figures.drawing import check_equal_files, check_units, drawn

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.scene.scene import from_mapping
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Sweep
from stiffdice.sweep.shard import compute_shard

TOLERANCES = {"energy": 0.05, "apex": 0.02}


def swept(folder, damping, contact, stiffness, steps, omega_h, criteria):
    """What `stability_limits.find` makes of a small sweep."""
    plan = Sweep(
        scene=from_mapping({"ground": {"damping": damping}}),
        model="sliding",
        scheme="symplectic_euler",
        contact=contact,
        stiffness=stiffness,
        steps=steps,
        omega_h=omega_h,
        members=4,
        seed=1,
        refine=0,
        criteria=criteria,
        early_stop=True,
        horizon=10.0,
    )
    path = folder / f"{damping}-{'-'.join(contact)}.h5"
    compute_shard(plan, rounds.scan(plan), path)
    with xr.open_dataset(path, engine="h5netcdf") as shard:
        return stability_limits.find(collect([shard], plan.criteria))


@pytest.fixture(scope="module")
def combs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("combs")
    stiff, steps = {"from": 1e6, "to": 1e6, "count": 1}, {"from": 8e3, "to": 3e4, "count": 25}
    return {
        "undamped": swept(folder, 0.0, ("gated",), stiff, steps, None, TOLERANCES),
        "paper": swept(folder, 0.2, ("ungated", "gated"), stiff, steps, None, TOLERANCES),
    }


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    soft, span = {"from": 1e2, "to": 1e4, "count": 3}, {"from": 2.5, "to": 0.2, "count": 20}
    return {
        "paper": swept(folder, 0.2, ("ungated", "gated"), soft, None, span, TOLERANCES),
        "undamped": swept(folder, 0.0, ("gated",), soft, None, span, TOLERANCES | {"restitution": 0.05}),
    }


@pytest.fixture(scope="module")
def passing(tmp_path_factory):
    """Runs below the linear limit, all of which stay finite."""
    folder, asked = tmp_path_factory.mktemp("passing"), {"finite": 0.0, **TOLERANCES}
    stiff, steps = {"from": 1e6, "to": 1e6, "count": 1}, {"from": 1.05e4, "to": 3e4, "count": 10}
    return swept(folder, 0.0, ("gated",), stiff, steps, None, asked)


@pytest.fixture(scope="module")
def given(combs, maps):
    return {"pass-fraction": combs, "stability-map": maps}


@pytest.mark.parametrize("name", ["pass-fraction", "stability-map"])
@pytest.mark.long
def test_axes_have_units(given, name):
    check_units(drawn(name, given[name]))


@pytest.mark.parametrize("name", ["pass-fraction", pytest.param("stability-map", marks=pytest.mark.broad)])
@pytest.mark.long
def test_equal_data_give_equal_files(given, tmp_path, name):
    check_equal_files(name, given[name], tmp_path)


def lines_of(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def steps_of(found, law):
    return found.isel(cell=found.cell_contact.values == law)


@pytest.mark.long
def test_the_comb_has_a_panel_for_each_sweep_and_law_and_the_shares_in_it(combs):
    figure = drawn("pass-fraction", combs)
    wanted = [steps_of(combs["undamped"], 1), steps_of(combs["paper"], 0), steps_of(combs["paper"], 1)]
    for axes, scan in zip(figure.axes, wanted, strict=True):
        lines = lines_of(axes)
        for c, criterion in enumerate(meanings_of(scan.criterion)):
            points = np.stack([scan.cell_steps, scan.pass_fraction[c]], axis=1)
            np.testing.assert_array_equal(lines[criterion].get_xydata(), points)
            assert lines[criterion].get_color() == style.CRITERION_LOOKS[criterion]["color"]
        assert axes.get_xscale() == "linear"
        assert axes.get_xlim()[0] < scan.cell_steps.values.min() < scan.cell_steps.values.max() < axes.get_xlim()[1]
        assert axes.get_ylim()[0] < 0
        assert axes.get_ylim()[1] > 1
    assert [axes.get_title(loc="left").split(",")[0] for axes in figure.axes] == [
        "as written (gated)",
        "as listed (ungated)",
        "as written (gated)",
    ]
    assert ["D = 0 " in axes.get_title(loc="left") for axes in figure.axes] == [True, False, False]


def test_the_combs_confidence_is_wilsons(combs):
    axes = drawn("pass-fraction", combs).axes[0]
    scan = steps_of(combs["undamped"], 1)
    for c, criterion in enumerate(meanings_of(scan.criterion)):
        color = style.CRITERION_LOOKS[criterion]["color"]
        bands = [band for band in axes.collections if to_hex(band.get_facecolor()[0]) == color.lower()]
        assert len(bands) == 1
        for band in bands:
            (path,) = band.get_paths()
            corners = {tuple(point) for point in path.vertices}
            for edge in (scan.pass_fraction_low, scan.pass_fraction_high):
                assert set(zip(scan.cell_steps.values, edge.values[c], strict=True)) <= corners


def test_a_criterion_that_all_pass_is_told_not_drawn(combs, passing):
    figure = drawn("pass-fraction", {"passing": passing, **combs})
    assert (passing.pass_fraction[0] == 1).all()
    assert ["all pass: finite" in axes.get_title(loc="left") for axes in figure.axes] == [True, False, False, False]
    assert "finite" not in lines_of(figure.axes[0])
    (legend,) = figure.legends
    assert not any("finite" in text.get_text() for text in legend.get_texts())


def test_lines_of_the_comb_that_lie_on_each_other_show(combs):
    """Each is thinner than those below it."""
    for axes in drawn("pass-fraction", combs).axes:
        shown = [line for line in axes.get_lines() if line.get_label() in style.CRITERION_LOOKS]
        widths = [line.get_linewidth() for line in shown]
        assert len(widths) == 2
        assert widths[1] < 0.9 * widths[0]


def test_the_comb_marks_magic_steps_the_limit_and_the_papers_steps(combs):
    for axes in drawn("pass-fraction", combs).axes:
        upright = {
            (line.get_linestyle(), round(line.get_xdata()[0], 6))
            for line in axes.get_lines()
            if len(line.get_xdata()) == 2 and line.get_xdata()[0] == line.get_xdata()[1]
        }
        magic = {(":", round(2e4 / (2 * np.sin(np.pi / (2 * n))), 6)) for n in (2, 3, 4)}
        assert upright == magic | {("--", 1e4)}
        texts = {text.get_text(): text.xy[0] for text in axes.texts}
        assert texts == pytest.approx(
            {"ωh = 2": 1e4} | {f"n = {n}": 2e4 / (2 * np.sin(np.pi / (2 * n))) for n in (2, 3, 4)}
        )
        (paper,) = (line for line in axes.get_lines() if line.get_marker() == "^")
        assert list(paper.get_xdata()) == [10_000, 20_000]
        (top,) = axes.child_axes
        shown = {
            float(label.get_text()): place for label, place in zip(top.get_xticklabels(), top.get_xticks(), strict=True)
        }
        assert shown == pytest.approx({value: 2e4 / value for value in (2, 1.5, 1.2, 1, 0.8, 0.7)})


def test_the_papers_steps_are_those_of_its_stiffness_only(combs):
    """A scan on other ground has none of them, though it has such numbers of steps."""
    found = combs["undamped"]
    other = found.assign_coords(cell_stiffness=found.cell_stiffness / 4, cell_omega_h=found.cell_omega_h / 2)
    figure = drawn("pass-fraction", {"undamped": other})
    assert not any(len(line.get_xdata()) for line in figure.axes[0].get_lines() if line.get_marker() == "^")
    (legend,) = figure.legends
    assert not any("paper" in text.get_text() for text in legend.get_texts())


@pytest.mark.long
def test_the_comb_has_a_panel_for_each_stiffness(maps):
    figure = drawn("pass-fraction", {"undamped": maps["undamped"]})
    assert [
        next(part for part in ("S = 100 ", "S = 1000 ", "S = 10⁴ ") if part in axes.get_title(loc="left"))
        for axes in figure.axes
    ] == ["S = 100 ", "S = 1000 ", "S = 10⁴ "]


def cells_of(axes):
    (collection,) = axes.collections
    corners = np.array([path.vertices[:4] for path in collection.get_paths()])
    return corners, collection.get_array()


@pytest.mark.long
def test_the_map_has_a_row_for_each_criterion_and_a_column_for_each_sweep_and_law(maps):
    figure = drawn("stability-map", maps)
    panels = np.reshape(figure.axes[:9], (3, 3))
    for row, criterion in zip(panels, ("energy", "apex", "restitution"), strict=True):
        assert style.criterion_words(criterion, 0.02 if criterion == "apex" else 0.05) in row[0].get_ylabel()
        columns = (steps_of(maps["paper"], 0), steps_of(maps["paper"], 1), steps_of(maps["undamped"], 1))
        for axes, found in zip(row, columns, strict=True):
            _, shares = cells_of(axes)
            names = meanings_of(found.criterion)
            if criterion in names:
                np.testing.assert_array_equal(shares, found.pass_fraction[names.index(criterion)])
            else:
                assert np.ma.masked_invalid(shares).mask.all()
                assert [text.get_text() for text in axes.texts] == ["not asked of this sweep"]
    assert [axes.get_title(loc="left").split("\n") for axes in panels[0]] == [
        ["sliding, as listed (ungated)", "D = 0.2 kg/s, μ = 0.075"],
        ["sliding, as written (gated)", "D = 0.2 kg/s, μ = 0.075"],
        ["sliding, as written (gated)", "D = 0 kg/s, μ = 0.075"],
    ]


def test_a_cell_of_the_map_reaches_half_way_to_its_neighbours(maps):
    axes = drawn("stability-map", maps).axes[2]
    found = steps_of(maps["undamped"], 1)
    corners, _ = cells_of(axes)
    assert len(corners) == found.sizes["cell"]
    left, right = corners[..., 0].min(axis=1), corners[..., 0].max(axis=1)
    low, high = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
    np.testing.assert_allclose(left * right, found.cell_stiffness.values**2)
    np.testing.assert_allclose(right / left, 10)
    for stiffness in (1e2, 1e3, 1e4):
        column = np.flatnonzero(found.cell_stiffness.values == stiffness)
        assert len(column) > 10
        column = column[np.argsort(found.cell_omega_h.values[column])]
        omega_h = found.cell_omega_h.values[column]
        np.testing.assert_allclose(high[column][:-1] ** 2, omega_h[1:] * omega_h[:-1])
        np.testing.assert_array_equal(low[column][1:], high[column][:-1])
        assert (low[column] < omega_h).all()
        assert (high[column] > omega_h).all()


def test_the_map_shows_all_cells_in_one_scale_with_the_limit_and_magic_steps(maps):
    figure = drawn("stability-map", maps)
    omega_h = np.concatenate([found.cell_omega_h.values for found in maps.values()])
    for axes in figure.axes[:9]:
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert axes.get_ylim() == pytest.approx((omega_h.min(), omega_h.max()))
        (line,) = axes.get_lines()
        assert set(line.get_ydata()) == {2.0}
        (right,) = axes.child_axes
        np.testing.assert_allclose(right.get_yticks()[:4], [2 * np.sin(np.pi / (2 * n)) for n in (2, 3, 4, 5)])
        numbers = [label.get_text() for label in right.get_yticklabels()]
        assert numbers[:6] == (["2", "3", "4", "5", "6", ""] if axes in figure.axes[2:9:3] else [""] * 6)
        assert (axes.collections[0].norm.vmin, axes.collections[0].norm.vmax) == (0, 1)
    assert len(figure.axes) == 10  # one colour bar for all


def test_maps_of_different_stiffness_hide_no_cell_of_each_other(maps, combs):
    for pair in ((combs["undamped"], maps["undamped"]), (maps["undamped"], combs["undamped"])):
        for axes in drawn("stability-map", dict(zip("ab", pair, strict=True))).axes[:2]:
            corners, _ = cells_of(axes)
            assert axes.get_xlim()[0] <= corners[..., 0].min() < corners[..., 0].max() <= axes.get_xlim()[1]
            assert axes.get_ylim() == pytest.approx((0.2, 2.5), rel=0.2)


def test_a_criterion_at_two_tolerances_has_two_rows(maps):
    strict = maps["undamped"]
    loose = strict.assign(tolerance=strict.tolerance.copy(data=[0.05, 0.5, 0.05]))
    figure = drawn("stability-map", {"strict": strict, "loose": loose})
    labels = [axes.get_ylabel().split("\n")[0] for axes in figure.axes[:8:2]]
    wanted = (("energy", 0.05), ("apex", 0.02), ("apex", 0.5), ("restitution", 0.05))
    assert labels == [style.criterion_words(*pair) for pair in wanted]
    asked = [not np.ma.masked_invalid(cells_of(axes)[1]).mask.all() for axes in figure.axes[:8]]
    assert asked == [True, True, True, False, False, True, True, True]
    (legend,) = drawn("pass-fraction", {"strict": strict, "loose": loose}).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert [style.criterion_words(*pair) in texts for pair in wanted] == [True] * 4


def test_a_criterion_that_all_pass_who_were_asked_is_not_drawn(passing):
    without = passing.isel(criterion=slice(1, None))
    without.criterion.attrs = without.criterion.attrs | {"flag_meanings": "energy apex"}
    figure = drawn("stability-map", {"asked": passing, "not": without})
    assert len(figure.axes) == 2 * 2 + 1
    assert "as all members pass: finite" in figure.get_supxlabel().replace("\n", " ")


def test_a_map_of_one_stiffness_has_cells_with_a_width(combs):
    corners, _ = cells_of(drawn("stability-map", {"undamped": combs["undamped"]}).axes[0])
    np.testing.assert_allclose(corners[..., 0].max(axis=1) / corners[..., 0].min(axis=1), np.e)


def test_a_map_of_what_all_pass_is_not_empty(passing):
    passed = passing.isel(criterion=[0])
    passed.criterion.attrs = passed.criterion.attrs | {"flag_meanings": "finite"}
    _, shares = cells_of(drawn("stability-map", {"passing": passed}).axes[0])
    np.testing.assert_array_equal(shares, 1)


def test_borders_lie_half_way_and_hold_every_cell():
    np.testing.assert_allclose(style.borders(np.array([1.0, 2.0, 4.0])), [0.5, 1.5, 3.0, 5.0])
    np.testing.assert_allclose(style.borders(np.array([1.0, 100.0]), logarithmic=True), [0.1, 10, 1000])
    np.testing.assert_allclose(style.borders(np.array([3.0])), [2.5, 3.5])
