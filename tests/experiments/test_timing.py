from __future__ import annotations

import time

import numpy as np
import pytest

from stiffdice.experiments.timing import SHORTEST, interleaved, machine


class Clock:
    """A clock that goes as far as runs say, whatever else this machine does meanwhile."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def run(self, seconds, then=lambda: None):
        def call():
            self.now += seconds
            then()

        return call


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(time, "perf_counter", clock)
    return clock


@pytest.mark.long
def test_runs_take_turns_and_a_long_one_is_called_once(clock):
    calls = []
    seconds = {"a": 2 * SHORTEST, "long": 0.03, "b": 4 * SHORTEST}
    runs = [clock.run(cost, lambda name=name: calls.append(name)) for name, cost in seconds.items()]
    median, spread = interleaved([lambda run=run: run for run in runs], 3, 0.02)
    assert calls == ["a", "long", "b"] + ["a", "b"] * 3
    assert median == pytest.approx(list(seconds.values()))
    assert spread == pytest.approx(0, abs=1e-12)


def test_a_short_run_is_repeated_until_the_clock_can_tell(clock):
    calls = []
    median = interleaved([lambda: clock.run(SHORTEST / 100, lambda: calls.append(1))], 5, 1.0)[0][0]
    assert median == pytest.approx(SHORTEST / 100)
    assert len(calls) == pytest.approx(1 + 5 * 100, abs=5)


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


def test_what_makes_a_run_ready_is_not_timed(clock):
    order = []

    def ready():
        clock.now += 1.0
        order.append("ready")
        return clock.run(0.25, lambda: order.append("made"))

    assert interleaved([ready], 3, 1.0)[0] == pytest.approx([0.25])
    assert order == ["ready", "made"] * 4
