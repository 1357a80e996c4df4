"""The page's controls rerun a throw, and what is shown is what `stiffdice run` stores."""

from __future__ import annotations

import shlex

import pytest
from tests.conftest import ROOT
from tests.report.explorer.conftest import PHONE

import stiffdice
from stiffdice.cli.main import main

pytestmark = pytest.mark.long


def verdict_of(tab):
    return tab.locator("#throw-verdict").get_attribute("data-verdict")


def measures_of(tab):
    names, values = tab.locator("#throw-measures dt").all_inner_texts(), tab.locator("#throw-measures dd")
    return dict(zip(names, values.all_inner_texts(), strict=True))


def number_of(cell):
    return 0.0 if "10⁻" in cell else float(cell.replace(",", "").replace("−", "-"))


def next_frame(tab):
    tab.evaluate("() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)))")


def test_three_buttons_show_the_papers_cure(opened):
    tab = opened()
    seen = {}
    for button in tab.get_by_role("group", name="Examples").get_by_role("button").all():
        button.click()
        next_frame(tab)
        assert button.get_attribute("aria-pressed") == "true"
        seen[button.get_attribute("value")] = verdict_of(tab)
    assert seen == {"10000": "energy_grew", "20000": "passed", "23000": "apex_rose"}
    assert measures_of(tab)["largest rebound, over the one before"] == "1.209"
    assert tab.locator("#throw-verdict").get_attribute("aria-live") == "polite"


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_the_command_that_is_shown_makes_the_run_that_is_shown(opened, tmp_path, monkeypatch, capsys, model):
    tab = opened()
    tab.select_option("#preset", "as_listed")
    tab.select_option("#model", model)
    tab.fill("#steps", "12345")
    tab.fill("#friction", "0.2")
    if model == "tumbling":
        tab.fill("#spin", "0.4")
    next_frame(tab)
    command = shlex.split(tab.locator("#throw-command").text_content())
    monkeypatch.chdir(tmp_path)
    command = [str(ROOT / word) if word.startswith("config/") else word for word in command]
    assert main([*command[1:], "--every", "4"]) == 0
    assert capsys.readouterr().out
    stored = stiffdice.open_results("run.h5")
    tab.get_by_text("Numbers behind the charts").click()
    rows = [row.split("\t") for row in tab.locator("#throw details table tbody tr").all_inner_texts()]
    until = 1.3 if model == "tumbling" else 10.1  # the turning cube is compared up to its first bounce
    for t, x, y, z, *_ in ([number_of(cell) for cell in row] for row in rows):
        place = stored.position.sel(time=t, method="nearest").values
        if t < until:
            assert [x, y, z] == pytest.approx(place, rel=6e-4, abs=1e-3), t


def test_sliders_and_numbers_move_each_other_and_rerun_the_throw(opened):
    tab = opened()
    slider = tab.locator("#damping-slider")
    slider.focus()
    before = measures_of(tab)
    for _ in range(20):
        slider.press("ArrowRight")
    next_frame(tab)
    assert tab.input_value("#damping") == "0.4"
    assert measures_of(tab) != before
    tab.fill("#stiffness", "10000")
    next_frame(tab)
    assert float(tab.input_value("#stiffness-slider")) == pytest.approx(1000 / 3, abs=1)
    assert verdict_of(tab) == "passed"
    assert "ground.stiffness=10000 " in tab.locator("#throw-command").text_content()


def test_a_number_that_is_not_allowed_is_refused_and_the_run_stays(opened):
    tab = opened()
    before = measures_of(tab)
    for text in ("10.5", "0", "9999999", ""):
        tab.fill("#steps", text)
        next_frame(tab)
        hint = tab.locator("#steps-hint").inner_text()
        assert hint == "Time steps: allowed is a whole number from 1,000 to 200,000 [to 10 s]"
        assert tab.locator("#steps").get_attribute("aria-invalid") is not None
        assert measures_of(tab) == before
    tab.fill("#steps", "20000")
    next_frame(tab)
    assert not tab.locator("#steps-hint").is_visible()
    assert verdict_of(tab) == "passed"


def test_spin_is_for_a_cube_that_turns(opened):
    tab = opened()
    assert tab.locator("#spin").is_disabled()
    tab.select_option("#model", "tumbling")
    next_frame(tab)
    assert tab.locator("#spin").is_enabled()
    assert measures_of(tab)["largest rebound, over the one before"].startswith("not judged")


def test_the_replay_plays_pauses_and_is_scrubbed(opened):
    tab = opened()
    shown = tab.locator("#throw-clock")
    picture = "() => document.getElementById('throw-view').toDataURL()"
    at_launch = tab.evaluate(picture)
    tab.click("#throw-play")
    tab.wait_for_function("() => parseFloat(document.getElementById('throw-clock').textContent) > 0.1")
    tab.click("#throw-play")
    paused, first = shown.inner_text(), tab.evaluate(picture)
    assert first != at_launch
    tab.wait_for_timeout(200)
    assert shown.inner_text() == paused
    scrub = tab.locator("#throw-scrub")
    scrub.focus()
    scrub.press("End")
    assert shown.inner_text() == "10.00 s"
    cursor = tab.locator("#throw-height .cursor")
    right = float(cursor.get_attribute("x1"))
    scrub.press("Home")
    assert shown.inner_text() == "0.00 s"
    assert float(cursor.get_attribute("x1")) < right
    assert tab.evaluate(picture) == at_launch


def test_who_asks_for_less_motion_gets_no_replay_unasked(opened):
    tab = opened(reduced_motion="reduce")
    tab.get_by_role("button", name="20,000 steps").click()
    tab.wait_for_timeout(300)
    assert tab.locator("#throw-clock").inner_text() == "0.00 s"
    assert tab.locator("#throw-play").inner_text() == "Play"


def test_every_control_has_a_name_and_is_reached_by_keyboard(opened):
    tab = opened()
    unnamed = tab.evaluate(
        """() => [...document.querySelectorAll("main input, main select, main button, main canvas, main svg")]
          .filter((e) => !e.closest("[aria-hidden=true]") && !e.labels?.length && !e.ariaLabel && !e.textContent.trim())
          .map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert unnamed == []
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.className") == "skip"
    ids = tab.evaluate("() => [...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_it_without_scrolling_sideways(opened, scheme):
    tab = opened(PHONE, color_scheme=scheme, has_touch=True)
    tab.click("#die-throw")
    for summary in tab.locator("summary").all():
        summary.click()
    assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    small = tab.evaluate(
        """() => [...document.querySelectorAll("main button, main select")]
          .filter((e) => e.offsetHeight > 0 && e.offsetHeight < 36).map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert small == [], "fingers need room"
