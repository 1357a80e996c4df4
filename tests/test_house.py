"""docs/reference/house.md is true: it draws the packages that there are, and what it says adds a thing does add it."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from stiffdice.scene.scene import load
from stiffdice.simulation.run import simulate

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "stiffdice"
PAGE = (ROOT / "docs/reference/house.md").read_text()


def test_the_page_draws_the_packages_in_the_order_of_their_imports():
    drawing = PAGE.partition("## Packages")[2].split("```")[1]
    drawn = re.findall(r"^([a-z]+) ", drawing, re.MULTILINE)
    (layers, *_) = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    assert drawn == layers["layers"]
    there = {path.name.removesuffix(".py") for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert there - {"__init__", "__pycache__"} == set(drawn)


def test_no_package_has_more_modules_than_a_reader_can_hold():
    for folder in [PACKAGE, *(path for path in PACKAGE.rglob("*") if (path / "__init__.py").is_file())]:
        assert len({path.name for path in folder.glob("*.py")} - {"__init__.py"}) <= 14, folder


# By the rows of the page: new files, each with the file of which it is a copy, changed.
ADDED: dict[str, dict[str, str]] = {
    "a criterion": {"simulation/criteria/fastest.py": "simulation/criteria/finite.py"},
    "a time-stepping scheme": {"integrators/listed.py": "integrators/symplectic_euler.py"},
    "a model of the motion": {"dynamics/models/gliding.py": "dynamics/models/sliding.py"},
    "an engine": {"simulation/engines/mine.py": "simulation/engines/numpy_loop.py"},
    "an experiment": {"experiments/weight.py": ""},
    "a figure": {"report/figures/weight.py": ""},
    "a table": {"report/tables/weight.py": ""},
    "a benchmark": {"benchmarks/nothing.py": ""},
    "a command": {"cli/greet.py": ""},
    "a contact law": {},
}

# What is replaced in which file, so that the page's lines are there.
CHANGES = {
    "simulation/criteria/fastest.py": [
        ('MEASURE = "out_of_range"', 'MEASURE = "top_speed"'),
        (
            "    if not total < math.inf:\n        slots[0] = 1.0\n",
            "    slots[0] = max(slots[0], abs(state.velocity[2]))\n",
        ),
    ],
    "simulation/criteria/registry.py": [
        ("import apex, energy,", "import apex, energy, fastest,"),
        ('    "trajectory": trajectory,\n', '    "trajectory": trajectory,\n    "fastest": fastest,\n'),
    ],
    "integrators/listed.py": [
        ('SymplecticEuler = namedtuple("SymplecticEuler"', 'Listed = namedtuple("Listed"'),
        ("TAG = SymplecticEuler", "TAG = Listed"),
    ],
    "integrators/registry.py": [
        ("implicit_euler, rk4", "implicit_euler, listed, rk4"),
        ('    "event": event,\n', '    "event": event,\n    "listed": listed,\n'),
    ],
    "dynamics/models/gliding.py": [
        ('Sliding = namedtuple("Sliding"', 'Gliding = namedtuple("Gliding"'),
        ("TAG = Sliding", "TAG = Gliding"),
    ],
    "dynamics/models/registry.py": [
        ("import free_flight, pair", "import free_flight, gliding, pair"),
        ('    "flying": free_flight,\n', '    "flying": free_flight,\n    "gliding": gliding,\n'),
    ],
    "dynamics/state.py": [('{"vertical", "sliding", "tumbling"}', '{"vertical", "sliding", "tumbling", "gliding"}')],
    "simulation/engines/registry.py": [
        (
            "def _scipy(",
            "def _mine() -> type[Engine]:\n    from stiffdice.simulation.engines.mine import NumpyLoop\n\n"
            "    return NumpyLoop\n\n\ndef _scipy(",
        ),
        ('    "numpy": Peer(', '    "mine": Peer(_mine, "Mine", "nothing"),\n    "numpy": Peer('),
    ],
    "study/catalogue.py": [
        (
            "EXPERIMENTS: dict[str, Entry] = {\n",
            'EXPERIMENTS: dict[str, Entry] = {\n    "weight": Entry("stiffdice.experiments.weight", "measure"),\n',
        ),
        (
            "DRAWINGS: dict[str, Entry] = {\n",
            "DRAWINGS: dict[str, Entry] = {\n"
            '    "weight": Entry("stiffdice.report.figures.weight", "draw", "experiments", "weight"),\n',
        ),
        (
            "TABLES: dict[str, Entry] = {\n",
            "TABLES: dict[str, Entry] = {\n"
            '    "weight": Entry("stiffdice.report.tables.weight", "table", "experiments", "weight"),\n',
        ),
    ],
    "benchmarks/__init__.py": [
        ('    "jobs": "benchmarks.jobs",\n', '    "jobs": "benchmarks.jobs",\n    "nothing": "benchmarks.nothing",\n')
    ],
    "cli/main.py": [
        ("import advise, check, ground,", "import advise, check, greet, ground,"),
        ("*(run, advise,", "*(greet, run, advise,"),
    ],
    "scene/flat_landing.py": [
        ('"gated": ContactLaw(0.0, 1.0)}', '"gated": ContactLaw(0.0, 1.0), "gated_again": ContactLaw(0.0, 1.0)}')
    ],
    "report/figures/style.py": [
        (
            '    "trajectory": {"color": PURPLE',
            '    "fastest": {"color": INK, "first": "*", "last": "+"},\n    "trajectory": {"color": PURPLE',
        ),
        ('"gated": "as written (gated)"}', '"gated": "as written (gated)", "gated_again": "again"}'),
    ],
}

# New files that are copies of none.
NEW = {
    "experiments/weight.py": """
import xarray as xr


def measure(scene, *, times: float = 1.0):
    value = times * scene.cube.mass * scene.gravity
    return xr.Dataset({"weight": ((), value, {"long_name": "weight", "units": "N"})})
""",
    "report/figures/weight.py": """
from stiffdice.report.figures import style


def draw(experiments, title):
    (dataset,) = experiments.values()
    figure = style.new_figure(title)
    figure.subplots().bar(["weight"], [float(dataset.weight)])
    return figure
""",
    "report/tables/weight.py": """
from stiffdice.report.markdown_table import rendered


def table(experiments, title):
    return rendered(title, ["what", "weight [N]"], [[name, float(data.weight)] for name, data in experiments.items()])
""",
    "cli/greet.py": """
HELP = "say hello"
EXAMPLES = ""


def add(greet):
    pass


def call(options):
    print("hello")
""",
    "benchmarks/nothing.py": """
from benchmarks.case import Case


def cases(effort):
    return [Case("nothing", "nothing at all", "call", 1.0, lambda: int, effort.rounds, "nothing")]
""",
}

STUDY = """
question: Does a study find what was added?
criteria: {fastest: 20, energy: 0.05}
runs:
  mine: {scene: config/scenes/figure-09.yaml, model: gliding, scheme: listed, steps: 10000}
  theirs: {scene: config/scenes/figure-09.yaml, model: sliding, simulator: mine, steps: 10000}
sweeps:
  laws:
    scene: config/scenes/figure-13.yaml
    model: sliding
    scheme: listed
    contact: [gated, gated_again]
    stiffness: 1.0e4
    steps: {from: 1000, to: 2000, count: 2}
    members: 2
  theirs:
    scene: config/scenes/figure-13.yaml
    model: gliding
    simulator: mine
    contact: [gated]
    stiffness: 1.0e4
    steps: {from: 1000, to: 2000, count: 2}
    members: 2
experiments:
  heavy: {measure: weight, scene: config/scenes/figure-09.yaml, options: {times: 2}}
figures:
  weight: {draw: weight, of: [heavy], title: Weight}
tables:
  weight: {tell: weight, of: [heavy], title: Weight}
"""


def place(name: str) -> str:
    return name if name.startswith("benchmarks/") else f"src/stiffdice/{name}"


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Path:
    """A copy of the code in which everything was added as the page says."""
    folder = tmp_path_factory.mktemp("house")
    for name in ("src", "benchmarks", "config", "workflow/schemas"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for files in ADDED.values():
        for name, original in files.items():
            text = NEW[name] if name in NEW else (folder / place(original)).read_text()
            (folder / place(name)).write_text(text)
    for name, changes in CHANGES.items():
        file = folder / place(name)
        text = file.read_text()
        for old, new in changes:
            assert text.count(old) == 1, (name, old)
            text = text.replace(old, new)
        file.write_text(text)
    (folder / "config" / "house.yaml").write_text(STUDY)
    return folder


def python(copy: Path, *arguments: str) -> str:
    path = {**os.environ, "PYTHONPATH": str(copy / "src"), "NUMBA_CACHE_DIR": str(copy / "cache")}
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=copy, env=path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_command_is_found(copy):
    assert python(copy, "-m", "stiffdice.cli", "greet") == "hello\n"


def rows() -> dict[str, str]:
    lines = PAGE.partition("## To add")[2].splitlines()
    return {line.split(" | ")[0].strip("| "): line for line in lines if line.startswith("| a")}


@pytest.mark.parametrize("what", ADDED)
def test_the_page_names_the_files_that_are_changed(what):
    named = set(re.findall(r"`((?:\w+/)+\w+\.\w+)`", rows()[what]))
    for new in ADDED[what]:
        assert new.replace(Path(new).stem, "NAME") in named
        named.remove(new.replace(Path(new).stem, "NAME"))
    assert named - {"requirements/engines.in"} <= set(CHANGES)  # a package that there is need not be installed


def test_every_change_is_on_the_page():
    told = " ".join(rows().values())
    created = {name for files in ADDED.values() for name in files}
    assert not [name for name in CHANGES if name not in created and f"`{name}`" not in told]
    assert rows().keys() == ADDED.keys()


STUDY_FOUND = """
from stiffdice.scene import scene as scenes
from stiffdice.study import catalogue, config
from stiffdice.sweep import partition

study = config.load("config/house.yaml", "workflow/schemas/study.schema.yaml")
assert not study.left_out, study.left_out
assert study.sweeps["laws"].criteria["fastest"] == 20
assert all(partition.of(sweep) for sweep in study.sweeps.values())
(heavy,) = study.experiments.values()
found = catalogue.EXPERIMENTS[heavy.measure].load()(scenes.load(heavy.scene), **heavy.options)
catalogue.DRAWINGS[study.figures["weight"].draw].load()({"heavy": found}, "Weight").savefig("weight.png")
print(catalogue.TABLES[study.tables["weight"].draw].load()({"heavy": found}, "Weight").csv)
"""


@pytest.mark.long
def test_a_study_finds_what_was_added(copy):
    """An experiment, a figure, a table; and the names of a criterion, a scheme, a model, a law and an engine."""
    assert python(copy, "-c", STUDY_FOUND).splitlines()[1].startswith("heavy,")
    assert (copy / "weight.png").stat().st_size > 1000


RUNS_FOUND = """
import hashlib
import json
import numpy as np
import stiffdice
from stiffdice.cli.main import main

scene = stiffdice.load_scene("config/scenes/figure-09.yaml", ["duration=2", "ground.contact=gated_again"])
new = stiffdice.simulate(scene, model="gliding", scheme="listed", steps=20000, every=1, criteria={"fastest": 20})
command = "run config/scenes/figure-09.yaml --set duration=0.1 --model sliding --simulator mine --steps 100 -o mine.h5"
told = {
    "state": hashlib.sha256(new.trajectory.state.tobytes()).hexdigest(),
    "bounced": bool(new.trajectory.elastic_energy.max() > 0),
    "verdict": stiffdice.Verdict(new.verdict[0]).name,
    "measured": float(new.measures["top_speed"][0]),
    "fastest": float(np.abs(new.trajectory.state["velocity"][1:, 2]).max()),
    "status": main(command.split()),
    "simulator": stiffdice.open_results("mine.h5").attrs["simulator"],
}
stiffdice.write_dataset(stiffdice.run_dataset(new), "new.h5")
stored = stiffdice.open_results("new.h5")
told["stored"] = [stored.attrs["scheme"], stored.attrs["model"], float(stored.top_speed)]
print(json.dumps(told))
"""


@pytest.mark.long
def test_runs_take_what_was_added(copy):
    """A law, a scheme and a model under other names give the same run to the last bit."""
    found = json.loads(python(copy, "-c", RUNS_FOUND).splitlines()[-1])
    scene = load(ROOT / "config/scenes/figure-09.yaml", ["duration=2", "ground.contact=gated"])
    ours = simulate(scene, model="sliding", steps=20000, every=1)
    assert found["state"] == hashlib.sha256(ours.trajectory.state.tobytes()).hexdigest()
    assert found["bounced"]
    assert found["verdict"] == "PASSED"
    assert found["measured"] == found["fastest"] > 5
    assert (found["status"], found["simulator"]) == (0, "mine")
    assert found["stored"] == ["listed", "gliding", found["measured"]]


@pytest.mark.long
def test_a_benchmark_is_found(copy):
    told = python(copy, "-m", "benchmarks", "nothing", "--quick", "--folder", "bench")
    assert "nothing at all" in told
