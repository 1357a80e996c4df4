"""The stability map in a browser: what it shows is what is stored, and what it runs is what the package runs."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from tests.report.explorer import stored_sweeps

from stiffdice.io.reader import open_results
from stiffdice.report.explorer import page as explorer
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria import judge
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.reference_run import references
from stiffdice.simulation.run import simulate

pytestmark = pytest.mark.long

_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")

# In the page: its sweeps and exact paths as the map has them.
_OPENED = """async () => {
  const data = pageData().map, block = await unpackedBlock(data.block);
  window.opened = { data, block, sweeps: data.maps.map((about) => new Sweep(about, block)) };
}"""
_RERUN = """([number, cell, member]) => {
  const { data, block, sweeps } = opened, path = sweeps[number].path(cell, member);
  const exact = path === undefined ? null : new ExactPath(data.paths[path], block);
  const { passes, measures, ended } = rerun(data, sweeps[number], cell, member, exact);
  return { passes, measures, ended };
}"""
# Where the middle of a cell is on the screen.
_PLACE = """([column, cell]) => {
  const map = document.querySelector("[data-part=map]"), { xaxis, yaxis } = map._fullLayout;
  map.scrollIntoView({ block: "center" });
  map._mouseDownTime = 0; // else two clicks at once would be a double click, which zooms out
  const box = map.getBoundingClientRect(), { x, y } = map.data[column];
  const at = (axis, low, high) => axis._offset + axis.l2p((Math.log10(low) + Math.log10(high)) / 2);
  return [box.left + at(xaxis, x[0], x[1]), box.top + at(yaxis, y[cell], y[cell + 1])];
}"""


class Shown(NamedTuple):
    page: Any
    sweeps: dict[str, xr.Dataset]
    trouble: list[str]  # errors on the console, exceptions, and requests that are no file


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    results = stored_sweeps.write(tmp_path_factory.mktemp("results"), "sliding", "tumbling")
    target = results / "explorer.html"
    explorer.write(results, target)
    return target


def show(chromium: Any, target: Path, width: int = 1280) -> Shown:
    page, trouble = chromium.new_page(viewport={"width": width, "height": 900}), []
    page.on("console", lambda message: trouble.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(("file:", "blob:")) else trouble.append(asked.url))
    page.goto(target.as_uri())
    page.wait_for_selector("[data-part=height] .main-svg", timeout=60_000)
    folder = target.parent / stored_sweeps.PLACE
    return Shown(page, {name: open_results(folder / name / "sweep.h5") for name in ("sliding", "tumbling")}, trouble)


@pytest.fixture(scope="module")
def opened(chromium, published):
    found = show(chromium, published)
    found.page.evaluate(_OPENED)
    yield found
    found.page.close()


@pytest.fixture
def shown(opened):
    """The page with the choices that it opens with, whatever was tried on it before."""
    opened.page.select_option("[name=sweep]", "0")
    for name, value in (("law", "gated"), ("axis", "omega_h"), ("criterion", "energy")):
        opened.page.check(f"[name={name}][value={value}]")
    yield opened
    assert opened.trouble == []


def numbers(text: str) -> list[float]:
    """Return the numbers in a text as the page writes them: 10⁶, 2.51×10⁻⁴, 10,123."""
    plain = re.sub(r"(?<=\d),(?=\d{3})", "", text)
    powers = re.sub(r"(\d+(?:\.\d+)?×)?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda m: _as_float(m[1], m[2]), plain)
    return [float(found) for found in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", powers)]


def _as_float(mantissa: str | None, power: str) -> str:
    return f"{(mantissa or '1').rstrip('×')}e{power.translate(_POWERS)}"


def cells_of(sweep: xr.Dataset, law: str) -> list[int]:
    return np.flatnonzero(sweep.contact.values == law).tolist()


def choose(page: Any, sweep: xr.Dataset, cell: int) -> None:
    """Choose a cell of the law that is shown by the form."""
    stiffnesses = np.unique(sweep.stiffness.values).tolist()
    page.select_option("[name=stiffness]", str(stiffnesses.index(float(sweep.stiffness[cell]))))
    page.fill("[name=steps]", str(int(sweep.steps[cell])))
    page.click("text=Nearest cell")


@pytest.mark.parametrize("law, axis", [("ungated", "omega_h"), ("gated", "steps")])
def test_hover_and_click_show_what_is_stored(shown, law, axis):
    page, sweep = shown.page, shown.sweeps["sliding"]
    page.check(f"[name=law][value={law}]")
    page.check(f"[name=axis][value={axis}]")
    cells = cells_of(sweep, law)
    columns = np.unique(sweep.stiffness.values).tolist()
    for number, criterion in enumerate(sweep.criterion.values):
        page.check(f"[name=criterion][value={criterion}]")
        for cell in cells[1 + 3 * number :: len(cells) // 2]:
            column = columns.index(float(sweep.stiffness[cell]))
            of_column = [other for other in cells if sweep.stiffness[other] == sweep.stiffness[cell]]
            if axis == "omega_h":
                of_column.reverse()
            x, y = page.evaluate(_PLACE, [column, of_column.index(cell)])
            page.mouse.move(x, y)
            stored = values_of(sweep, criterion, cell)
            told = f"{stored['steps']:,} steps"
            page.locator("[data-part=map] .hoverlayer", has_text=told).wait_for(state="attached")
            hovered = "\n".join(page.locator("[data-part=map] .hoverlayer tspan.line").all_text_contents())
            assert_numbers(hovered, list(stored.values()))
            page.mouse.click(x, y)
            page.locator("[data-part=summary]", has_text=told).wait_for()
            assert_numbers(page.text_content("[data-part=summary]"), list(stored.values()))
            assert int(page.input_value("[name=steps]")) == stored["steps"]


def values_of(sweep: xr.Dataset, criterion: str, cell: int) -> dict[str, float]:
    members = int(sweep.attrs["members"])
    here = sweep.isel(cell=cell)
    return {
        "stiffness": float(here.stiffness),
        "steps": int(here.steps),
        "omega_h": float(here.omega_h),
        "passing": members - int(here.failing.sel(criterion=criterion)),
        "members": members,
        "worst": float(here[f"largest_{CRITERIA[criterion].MEASURE}"]),
    }


def assert_numbers(text: str, expected: list[float]) -> None:
    found = numbers(text)
    for value in expected:
        if np.isnan(value):
            assert "–" in text
        else:
            assert any(other == pytest.approx(value, rel=5.1e-4) for other in found), (value, text)


def test_the_form_takes_the_nearest_cell_and_shows_a_member_that_fails(shown):
    page, sweep = shown.page, shown.sweeps["sliding"]
    page.check("[name=law][value=gated]")
    page.check("[name=criterion][value=apex]")
    failing = sweep.failing.sel(criterion="apex").values
    some = [cell for cell in cells_of(sweep, "gated") if 0 < failing[cell] < 4]
    choose(page, sweep, some[0])
    member = page.input_value("[name=member]")
    assert page.text_content(f"[name=member] option[value='{member}']").endswith("fails apex")
    assert f"first of the {failing[some[0]]} that fail apex" in page.text_content("[data-part=member]")
    before = page.text_content("[data-part=verdict]"), page.evaluate(drawn_heights())
    other = next(k for k in range(4) if str(k) != member)
    page.select_option("[name=member]", str(other))
    after = page.text_content("[data-part=verdict]"), page.evaluate(drawn_heights())
    assert after[0].startswith(f"Member {other},") and before[0] != after[0] and before[1] != after[1]


def drawn_heights() -> str:
    return "() => Array.from(document.querySelector('[data-part=height]').data[0].y)"


def test_arrows_move_along_the_map_and_enter_runs(shown):
    page, sweep = shown.page, shown.sweeps["sliding"]
    page.check("[name=law][value=gated]")
    cells = cells_of(sweep, "gated")
    choose(page, sweep, cells[4])
    page.focus("[data-part=map]")
    drawn = page.evaluate(drawn_heights())
    page.keyboard.press("ArrowDown")  # to a smaller ωh
    assert int(page.input_value("[name=steps]")) == int(sweep.steps[cells[5]])
    assert page.is_hidden("[data-part=run]")
    page.keyboard.press("Enter")
    assert page.is_visible("[data-part=run]") and page.evaluate(drawn_heights()) != drawn
    page.keyboard.press("ArrowRight")
    stiffness = page.locator("[name=stiffness] option:checked").text_content()
    assert numbers(stiffness) == [pytest.approx(float(np.unique(sweep.stiffness.values)[1]))]
    assert_numbers(page.text_content("[data-part=summary]"), numbers(stiffness))


def stepwise(sweep: xr.Dataset, cell: int, member: int) -> tuple[dict[str, bool], dict[str, float]]:
    """Return what the package says of a stored member that takes every step: passes and measures by criterion."""
    here, model = sweep.isel(cell=cell), sweep.attrs["model"]
    scene = from_mapping(json.loads(sweep.attrs["scene"]))
    scene = scene.with_ground(contact=str(here.contact.values), stiffness=float(here.stiffness))
    tolerances = dict(zip(sweep.criterion.values.tolist(), sweep.tolerance.values.tolist(), strict=True))
    members, steps = int(sweep.attrs["members"]), int(here.steps)
    launches = turned(scene, model, members)
    compared, _ = references(scene, model, launches[member : member + 1], float(sweep.attrs["horizon"]))
    one = phased(scene, model, steps, members, launches, slice(member, member + 1))
    asked = {"criteria": tolerances, "stop": tolerances, "references": compared}
    run = simulate(scene, model=model, steps=steps, members=one, leap=False, **asked)
    passes = judge.passes(tolerances, run.measures, run.ending)[:, 0]
    named = zip(tolerances, passes.tolist(), strict=True)
    return dict(named), {name: float(run.measures[CRITERIA[name].MEASURE][0]) for name in tolerances}


def stored_passes(published: Path, sweep: xr.Dataset, name: str) -> dict[tuple[int, int], dict[str, bool]]:
    """Return by cell and member what the stored runs pass, read from the shards themselves."""
    found = {}
    places = {key: k for k, key in enumerate(keys_of(sweep))}
    tolerances = dict(zip(sweep.criterion.values.tolist(), sweep.tolerance.values.tolist(), strict=True))
    for path in (published.parent / stored_sweeps.PLACE / name / "shards").glob("*.h5"):
        runs = open_results(path)
        endings = np.where(runs.ending.values == "passed", 0, 1)
        passes = judge.passes(tolerances, {m: runs[m].values for m in runs.data_vars}, endings)
        for row, key in enumerate(keys_of(runs)):
            for member in range(runs.sizes["member"]):
                found[places[key], member] = dict(zip(tolerances, passes[:, row, member].tolist(), strict=True))
    return found


def keys_of(cells: xr.Dataset) -> list[tuple[str, float, int]]:
    return list(zip(*(cells[name].values.tolist() for name in ("contact", "stiffness", "steps")), strict=True))


def test_every_sliding_member_run_again_is_the_run_of_the_package_step_by_step(shown, published):
    page, sweep = shown.page, shown.sweeps["sliding"]
    stored = stored_passes(published, sweep, "sliding")
    differing = 0
    for (cell, member), passes in stored.items():
        again = page.evaluate(_RERUN, [0, cell, member])
        known = {name: held for name, held in again["passes"].items() if held is not None}
        assert set(passes) - set(known) <= {"trajectory"}
        differs = any(passes[name] != held for name, held in known.items())
        differing += differs
        if differs or cell % 7 == 0:
            ours, measures = stepwise(sweep, cell, member)
            assert {name: ours[name] for name in known} == known
            for name in ("energy", "apex"):
                assert again["measures"][name] == measures[name]
            assert again["measures"]["restitution"] == pytest.approx(measures["restitution"], rel=1e-9, nan_ok=True)
            assert again["measures"]["trajectory"] == pytest.approx(measures["trajectory"], rel=1e-3, abs=4e-4)
    # A stored run took flights at once: where that moves a touch-down's phase by a last digit, it may end otherwise.
    assert differing <= 0.02 * len(stored)


def test_a_member_is_launched_as_the_stored_one(shown):
    page, sweep = shown.page, shown.sweeps["sliding"]
    scene = from_mapping(json.loads(sweep.attrs["scene"]))
    for cell in range(0, sweep.sizes["cell"], 5):
        launches, _ = phased(scene, "sliding", int(sweep.steps[cell]), 4)
        for member in range(4):
            launch = page.evaluate("([c, m]) => opened.sweeps[0].member(c, m).scene", [cell, member])
            assert launch["position"] == launches["position"][member].tolist()
            assert launch["velocity"] == launches["velocity"][member].tolist()
            assert launch["node_offset"] == launches["node_offset"][member].ravel().tolist()


def test_a_tumbling_member_is_judged_as_stored_before_chaos_takes_over(shown, published):
    page, sweep = shown.page, shown.sweeps["tumbling"]
    for (cell, member), passes in stored_passes(published, sweep, "tumbling").items():
        again = page.evaluate(_RERUN, [1, cell, member])["passes"]
        if member >= 8:  # without an exact path
            assert again["trajectory"] is None
        for name, held in again.items():
            assert held is None or held == passes[name]


def test_of_a_tumbling_cube_the_page_says_what_is_the_same_and_what_is_known(shown):
    page, sweep = shown.page, shown.sweeps["tumbling"]
    page.select_option("[name=sweep]", "1")
    choose(page, sweep, 2)
    page.select_option("[name=member]", "1")
    assert "until chaos takes over" in page.text_content("[data-part=caveat]")
    page.select_option("[name=member]", "9")
    assert "No exact path of member 9 is published" in page.text_content("[data-part=caveat]")


def test_the_exact_path_that_is_drawn_is_the_one_of_the_scheme_event(shown):
    page, sweep = shown.page, shown.sweeps["sliding"]
    page.check("[name=law][value=gated]")
    cell = cells_of(sweep, "gated")[-1]
    choose(page, sweep, cell)
    drawn, energy = (
        page.evaluate(
            f"() => {{ const d = document.querySelector('[data-part={name}]').data[1]; return "
            "[Array.from(d.x), Array.from(d.y)]; }"
        )
        for name in ("height", "energy")
    )
    here = sweep.isel(cell=cell)
    scene = from_mapping(json.loads(sweep.attrs["scene"]))
    scene = scene.with_ground(contact="gated", stiffness=float(here.stiffness))
    exact = simulate(scene, model="sliding", scheme="event", steps=5000, every=1, tolerance=1e-11).trajectory
    between = np.interp(exact.time, *drawn)
    assert np.abs(between - exact.state["position"][:, 2]).max() < 5e-3  # a polyline through it
    assert np.abs(np.interp(exact.time, *energy) - exact.mechanical_energy).max() < 2e-3 * np.ptp(
        exact.mechanical_energy
    )


def shown_rows(page, part: str) -> list[str]:
    """Return the rows of a table that has just been unfolded: it is filled then."""
    rows = page.locator(f"[data-part={part}] tbody tr")
    rows.first.wait_for()
    return rows.all_inner_texts()


def test_tables_say_what_the_map_shows(shown, published):
    page, sweep = shown.page, shown.sweeps["sliding"]
    page.check("[name=law][value=gated]")
    page.check("[name=criterion][value=energy]")
    frontier = open_results(published.parent / stored_sweeps.PLACE / "sliding" / "frontier.h5")
    page.click("text=Edges as a table")
    rows = shown_rows(page, "edges")
    edges = frontier.sel(contact="gated", criterion="energy")
    for row, limit, first, last in zip(rows, edges.limit, edges.first_pass, edges.last_fail, strict=True):
        assert [round(float(value)) for value in (limit, first, last)] == numbers(row)[1:]
    choose(page, sweep, cells_of(sweep, "gated")[0])
    page.click("text=Cells of this stiffness as a table")
    rows = shown_rows(page, "cells")
    of_column = (sweep.contact == "gated") & (sweep.stiffness == sweep.stiffness[cells_of(sweep, "gated")[0]])
    assert [numbers(row)[0] for row in rows] == sweep.steps.values[of_column].tolist()


def test_it_fits_a_phone_and_asks_nobody_for_anything(chromium, published):
    found = show(chromium, published, width=390)
    assert found.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert found.trouble == []
    found.page.close()


def test_without_stored_studies_the_page_says_what_makes_them(chromium, tmp_path):
    target = tmp_path / "explorer.html"
    explorer.write(tmp_path, target)
    page = chromium.new_page()
    page.goto(target.as_uri())
    page.wait_for_function("document.getElementById('map').textContent.includes('make stability')")
    page.close()
