from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import settings

from stiffdice.io.reader import parts
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.study import config as study
from stiffdice.sweep.collect import collect
from tests import rounds

# A shell that runs the tests in the background lets them, and all that they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The first call of a kernel may compile it.
settings.register_profile("stiffdice", deadline=None)
settings.load_profile("stiffdice")


def pytest_collection_modifyitems(items):
    """Put the workflow's tests first: they take longest, and a worker takes a file at a time."""
    items.sort(key=lambda item: item.get_closest_marker("workflow") is None)


ROOT = Path(__file__).parent.parent
REFERENCE = Path(__file__).parent / "reference"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="session")
def chromium():
    """A browser for all tests of a worker: there is one loop of events in a process."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on the PATH (apt-get install chromium): pages are not tried in a browser")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as engine:
        # Chromium's own sandbox does not start for root, as tests run in containers.
        browser = engine.chromium.launch(executable_path=CHROMIUM, chromium_sandbox=os.geteuid() != 0)
        yield browser
        browser.close()


class Reference(NamedTuple):
    scene: Scene
    model: str
    steps: int
    every: int
    table: np.ndarray  # a row for each kept step, columns by name
    whole_run: dict  # extremes over all steps


def read_reference(name: str) -> Reference:
    given = json.loads((REFERENCE / f"{name}.json").read_text())
    launch = {"position": given["x0"], "velocity": given["u0"], "angular_momentum": given.get("L0", [0, 0, 0])}
    scene = from_mapping(
        {
            "cube": {"radius": given["r"], "mass": given["total_mass"]},
            "ground": {"stiffness": given["S"], "damping": given["D"], "friction": given["mu"]},
            "launch": launch,
            "gravity": given["g"],
            "duration": given["tmax"],
        },
        preset="as_listed",
    )
    model = "tumbling" if given["listing"] == "real_throw_cube" else "sliding"
    table = np.genfromtxt(REFERENCE / f"{name}.csv", delimiter=",", names=True)
    return Reference(scene, model, given["clockmax"], given["every_nth_step"], table, given)


@pytest.fixture
def reference():
    return read_reference


def columns(table: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=-1)


@pytest.fixture(scope="session")
def plan():
    """The sweep of config/quick.yaml."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return study.load("config/quick.yaml").sweeps["steps-needed"]


@pytest.fixture(scope="session")
def small(plan):
    """A sweep of six columns that takes no time."""
    return dataclasses.replace(
        plan,
        stiffness={"from": 1e2, "to": 1e3, "count": 3},
        omega_h={"from": 2.0, "to": 0.5, "count": 5},
        members=3,
        refine=0,
    )


@pytest.fixture(scope="session")
def shards(plan, tmp_path_factory):
    """The files of that sweep's shards."""
    return rounds.compute(plan, tmp_path_factory.mktemp("shards"))


@pytest.fixture(scope="session")
def collected(plan, shards):
    """All cells of that sweep, judged."""
    return collect(each(shards), plan.criteria)


def each(paths):
    """Read one file after another, part by part, as the workflow does."""
    for path in paths:
        yield from parts(path, 7)
