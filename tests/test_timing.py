from __future__ import annotations

import time

import numpy as np
import pytest

from stiffdice.timing import SHORTEST, Launched, interleaved, machine, seconds_of


def test_runs_take_turns_and_a_long_one_is_called_once():
    calls = []

    def run(name, seconds):
        def call():
            calls.append(name)
            time.sleep(seconds)

        return call

    times = interleaved([run("a", 2 * SHORTEST), run("long", 0.03), run("b", 4 * SHORTEST)], 3, 0.02)
    assert calls == ["a", "long", "b"] + ["a", "b"] * 3
    assert (times.median >= [2 * SHORTEST, 0.03, 4 * SHORTEST]).all()
    assert (times.spread >= 0).all()
    assert times.spread[1] == 0


def test_a_short_run_is_repeated_until_the_clock_can_tell():
    count = 0

    def run():
        nonlocal count
        count += 1

    median = interleaved([run], 5, 1.0).median[0]
    assert median < 1e-4
    assert count > 100


def test_the_machine_is_named():
    told = machine()
    assert told["machine_cores"] >= 1
    assert told["machine_processor"]
    assert f"numpy {np.__version__}" in told["versions"]
    assert "scipy" in told["versions"]
    assert told["measured_at"].endswith("Z")


@pytest.mark.parametrize("key", ["machine_processor", "machine_system", "versions", "measured_at"])
def test_what_is_told_of_it_is_text(key):
    assert isinstance(machine()[key], str)


def test_what_makes_a_run_ready_is_not_timed():
    order = []

    def ready():
        time.sleep(0.02)
        order.append("ready")
        return lambda: order.append("made")

    run = Launched(ready)
    assert seconds_of(run, 3) < 0.005
    assert order == ["ready", "made"] * 3
    run()
    assert order == ["ready", "made"] * 4
