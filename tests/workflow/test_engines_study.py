from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.errors import NotInstalledError
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.engines.registry import ENGINES
from stiffdice.study import config as study

ROOT = Path(__file__).parents[2]


def installed(engine):
    try:
        engines.adapter_of(engine)
    except NotInstalledError:
        return False
    return True


@pytest.fixture(scope="module")
def planned():
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        return study.load("config/engines.yaml")


def test_every_engine_that_is_installed_is_asked_and_every_other_told(planned):
    parts = {f"experiments.{name}": part for name, part in planned.experiments.items()}
    parts |= {f"timings.{name}": part for name, part in planned.timings.items()}
    assert len(parts) == 7
    told = "\n".join(planned.left_out)
    for where, part in parts.items():
        for engine in ENGINES:
            # `work-precision` calls SciPy's methods otherwise; without friction only some are asked.
            if engine == "scipy" or (where.endswith("smooth") and engine in ("octave", "numpy")):
                continue
            assert (engine in part.options["methods"]) == installed(engine), (where, engine)
            assert (f"{where}: methods = {engine}" in told) == (not installed(engine)), (where, engine)


def test_nothing_but_engines_is_left_out(planned):
    assert set(planned.figures) == {"limits", "throw", "throw-smooth", "speed", "work-position", "work-restitution"}
    assert set(planned.tables) == {"contact", "limits", "speed"}
