from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from stiffdice.dynamics import code_digest as code_digests
from stiffdice.dynamics.code_digest import PACKAGE, _imports, code_digest


@pytest.fixture
def copy(tmp_path) -> Path:
    """A copy of the package that a test may change."""
    target = tmp_path / "src" / "stiffdice"
    shutil.copytree(PACKAGE, target, ignore=shutil.ignore_patterns("__pycache__"))
    return target


def python(copy, code, *words, **environment):
    path = {"PYTHONPATH": str(copy.parent)} | environment
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=True, env={**os.environ, **path}
    )
    return done.stdout.strip()


DIGESTS = """
import json, sys
from stiffdice.dynamics.code_digest import code_digest
print(json.dumps({module: code_digest(module) for module in sys.argv[1:]}))
"""


def digests_of(copy, modules):
    return json.loads(python(copy, DIGESTS, *modules))


SIMULATION = {"stiffdice.simulation.run", "stiffdice.sweep.shard", "stiffdice.simulation.dataset"}
DRAWING = {"stiffdice.report.figures.runs"}
COMPARING = {"stiffdice.experiments.work_precision.measure"}
DRIVING = {"stiffdice.simulation.engines.registry"}
EACH = SIMULATION | DRAWING | COMPARING | DRIVING


@pytest.mark.parametrize(
    ("changed", "touches"),
    [
        ("dynamics/contact.py", SIMULATION | COMPARING | DRIVING),
        ("dynamics/models/tumbling.py", SIMULATION | COMPARING | DRIVING),
        ("simulation/criteria/apex.py", SIMULATION | COMPARING | DRIVING),
        ("simulation/fast_forward.py", SIMULATION | COMPARING),
        ("simulation/reference_run.py", {"stiffdice.sweep.shard"}),
        ("io/shard_writer.py", {"stiffdice.sweep.shard"}),
        ("simulation/engines/scipy_ivp.py", COMPARING | DRIVING),
        ("simulation/engines/octave.m", COMPARING | DRIVING),
        ("simulation/engines/registry.py", COMPARING | DRIVING),
        ("report/figures/style.py", DRAWING),
        ("report/figures/runs.py", DRAWING),
        ("report/figures/stability.py", set()),
        ("cli/main.py", set()),
        ("__init__.py", SIMULATION | DRAWING | COMPARING | DRIVING),
    ],
)
def test_a_change_shows_in_what_stands_on_it_and_nowhere_else(copy, changed, touches, monkeypatch):
    with (copy / changed).open("a") as file:
        file.write("\n# changed\n")
    before = {module: code_digest(module) for module in EACH}
    monkeypatch.setattr(code_digests, "PACKAGE", copy)
    assert {module for module in EACH if code_digest.__wrapped__(module) != before[module]} == touches


@pytest.mark.long
def test_imports_are_those_that_python_finds():
    for path in PACKAGE.rglob("*.py"):
        names = {PACKAGE.name}
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                names.update(f"{node.module}.{alias.name}" for alias in node.names)
        ours = [name.split(".") for name in names if name.split(".")[0] == PACKAGE.name]
        known = {".".join(parts[:depth]) for parts in ours for depth in range(1, len(parts) + 1)}
        assert _imports(path) | {PACKAGE.name} == known, path


def test_digests_do_not_depend_on_where_the_code_lies(copy):
    assert digests_of(copy, EACH) == {module: code_digest(module) for module in EACH}


# A kernel that compiles quickly, and calls what another file says of a height.
RUN = """
from stiffdice.dynamics.energy import energies
from stiffdice.scene.scene import from_mapping
from stiffdice.dynamics.state import physics_of, start_of
scene = from_mapping({"launch": {"position": [0, 0, -1]}})
print(energies(physics_of(scene), start_of(scene, "sliding"))[2][0])
"""


@pytest.mark.parametrize(
    "first",
    [
        pytest.param("", id="", marks=pytest.mark.long),
        pytest.param("import numba\n", id="numba imported before", marks=pytest.mark.broad),
    ],
)
def test_an_edited_file_is_never_served_from_the_cache(copy, tmp_path, first):
    """Numba itself would not notice: the kernel that is cached lies in another file."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    before = python(copy, first + RUN, **cache)
    assert python(copy, first + RUN, **cache) == before
    law = copy / "dynamics/contact.py"
    law.write_text(
        law.read_text().replace("return upward(physics, vector(state", "return 2.0 * upward(physics, vector(state", 1)
    )
    after = python(copy, first + RUN, **cache)
    assert float(after) > float(before)
    assert len(list((tmp_path / "cache" / "stiffdice").iterdir())) == 2


@pytest.mark.long
def test_a_home_that_cannot_be_written_is_no_hindrance(copy, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert python(copy, RUN, NUMBA_CACHE_DIR=str(blocked))
