from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from stiffdice.advice.result import MEASURED, THEORY, Advice, Check, Option
from stiffdice.report.advice_page import as_json, as_text, check_as_text, command
from stiffdice.scene.scene import Scene

EVENT = Option(
    scheme="event",
    steps=600,
    tolerance=1e-5,
    error=3.4e-6,
    basis=MEASURED,
    evaluations=120,
    seconds=2e-4,
    omega_h=None,
    limit=None,
    keeps=True,
    evidence="it was made",
)
STEPS = dataclasses.replace(
    EVENT,
    scheme="symplectic_euler",
    steps=249_600,
    tolerance=None,
    error=None,
    basis=THEORY,
    seconds=1.4e-2,
    omega_h=0.1,
    limit=2.0,
    keeps=False,
)


def advice(**changes):
    given = {
        "scene": Scene(),
        "asked": 0.001,
        "duration": 20.0,
        "horizon": 9.0,
        "cut": "round-off grows",
        "model": "tumbling",
        "model_reason": "the cube spins",
        "best": EVENT,
        "options": (EVENT, STEPS),
        "floor": 6e-11,
        "paths": (),
        "landings": 3,
        "growth": 16.0,
        "mode": "bounce",
        "outside": ("gravity = 0",),
    }
    return Advice(**given | changes)


@pytest.mark.parametrize(
    "line",
    [
        "model     the cube spins",
        "scheme    event, tolerance 1e-05, 600 output intervals",
        "until     t = 9 s of 20 s: round-off grows",
        "growth    errors grow 16 times from the second of 3 landings to the end, 4 times at each",
        "margin    none needed: event takes steps of its own and has no stability limit",
        "evidence  measured: it was made",
        "outside   gravity = 0",
        "  event             600      1e-05      3.4×10⁻⁶  200 µs   × 1     measured",
        "  symplectic_euler  > 249,600           unknown    > 14 ms  > × 70  theory, may not keep it",
        "stiffdice run a.yaml --set duration=9 --model tumbling --scheme event --steps 600 --tolerance 1e-05 -o OUT.h5",
    ],
)
def test_what_is_advised_is_said_with_its_reasons(line):
    told = as_text(advice(), ["a.yaml"]).splitlines()
    assert line.split() in [part.split() for part in told]


@pytest.mark.parametrize(
    ("omega_h", "limit", "told"),
    [
        (0.0, 2.0, "none needed: nothing touches"),
        (0.1, 2.0, "20 times: ωh = 0.1 (bounce), stability limit ωh = 2"),
        (0.1, np.inf, "inf times: ωh = 0.1 (bounce), stable at any step"),
        (0.1, 0.0, "0 times: ωh = 0.1 (bounce), stability limit ωh = 0"),
    ],
)
def test_the_margin_is_told_of_fixed_steps(omega_h, limit, told):
    best = dataclasses.replace(STEPS, omega_h=omega_h, limit=limit)
    assert f"margin    {told}" in as_text(advice(best=best), []).splitlines()


def test_a_page_is_printable_whatever_the_scene_is_called():
    assert as_text(advice(), ["\x1b[2J"]).replace("\n", "").isprintable()


def test_where_nothing_keeps_the_error_that_is_said():
    none = advice(best=None)
    assert "scheme    none found that keeps 0.001 radii until t = 9 s" in as_text(none, ["a.yaml"]).splitlines()
    assert command(none, ["a.yaml"]) == ""
    assert json.loads(as_json(none))["advised"] is None


def test_programs_get_the_same_with_null_for_what_is_no_number():
    check = Check(promised=0.001, found=np.inf, against="others")
    content = json.loads(as_json(advice(), check))
    assert content["outside"] == ["gravity = 0"]
    assert content["growth_per_landing"] == 4
    assert content["options"][1]["margin"] == 20
    assert content["check"] == {"promised_radii": 0.001, "found_radii": None, "against": "others", "kept": False}


def test_a_broken_promise_is_told_as_one():
    assert "NOT KEPT" in check_as_text(Check(promised=1e-6, found=1e-3, against="others"))
    assert check_as_text(Check(promised=1e-6, found=1e-7, against="others")).endswith("others: kept")
