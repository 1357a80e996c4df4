from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from stiffdice import study, theory
from stiffdice.errors import InputError
from stiffdice.figures import DRAWINGS
from stiffdice.models import MODELS
from stiffdice.scene import PRESETS
from stiffdice.schemes import SCHEMES
from stiffdice.verdict import CRITERIA

CONFIG = Path(__file__).parent.parent / "config"


@pytest.fixture(scope="module")
def paper(study_schema):
    return study.load(CONFIG / "paper.yaml", study_schema)


@pytest.fixture
def changed(tmp_path, monkeypatch, study_schema):
    """Load config/quick.yaml with one key changed (None takes it away)."""
    monkeypatch.chdir(CONFIG.parent)

    def load(path, value):
        data = yaml.safe_load((CONFIG / "quick.yaml").read_text())
        *above, last = path.split(".")
        part = data
        for key in above:
            part = part[key]
        if value is None:
            del part[last]
        else:
            part[last] = value
        file = tmp_path / "quick.yaml"
        file.write_text(yaml.safe_dump(data))
        return study.load(file, study_schema)

    return load


@pytest.fixture(autouse=True)
def _at_the_top(monkeypatch):
    monkeypatch.chdir(CONFIG.parent)


def test_figure_13_is_the_sweep_that_was_promised(paper):
    sweep = paper.sweep
    cells = sweep.cells()
    stiffness = sorted({cell.stiffness for cell in cells})
    assert len(stiffness) >= 16
    assert (stiffness[0], stiffness[-1]) == (1e2, 1e7)
    assert {cell.contact for cell in cells} == {"ungated", "gated"}
    assert sweep.members >= 32
    for value in stiffness:
        steps = [cell.steps for cell in cells if cell.stiffness == value and cell.contact == "gated"]
        assert len(set(steps)) >= 40
        omega_h = [theory.omega_h(sweep.scene.with_ground(stiffness=value), n) for n in steps]
        assert min(omega_h) < 0.105
        assert max(omega_h) > 2.8


def test_step_counts_favour_no_round_numbers(paper):
    steps = np.array([cell.steps for cell in paper.sweep.cells() if cell.steps > 1000])
    assert np.mean(steps % 10 == 0) < 0.15


def test_every_figure_of_the_paper_is_planned(paper):
    assert {f"figure-{n:02d}" for n in range(1, 14)} <= set(paper.figures)
    for number in range(4, 13):
        assert paper.runs[paper.figures[f"figure-{number:02d}"].run].presets == ("as_listed", "as_written")


def test_shards_share_out_all_cells_evenly(paper):
    shards = paper.sweep.shards()
    dealt = [cell for cells in shards.values() for cell in cells]
    assert sorted(dealt) == sorted(paper.sweep.cells())
    work = [sum(cell.steps for cell in cells) for cells in shards.values()]
    assert max(work) < 1.2 * min(work)


def test_a_shards_name_tells_what_it_computes(changed):
    names = set(changed("sweep.seed", 1).sweep.shards())
    assert names == set(changed("sweep.seed", 1).sweep.shards())
    for path, value in (("sweep.seed", 2), ("sweep.members", 9), ("sweep.set", ["cube.mass=2"])):
        assert names.isdisjoint(changed(path, value).sweep.shards())
    # What is only judged or drawn from the shards leaves their names alone.
    assert names == set(changed("criteria", {"energy": 0.5}).sweep.shards())


def test_a_stiffness_has_the_same_steps_in_another_grid(changed):
    def steps(study):
        return [cell.steps for cell in study.sweep.cells() if cell.stiffness == 1e4 and cell.contact == "gated"]

    assert steps(changed("sweep.seed", 1)) == steps(changed("sweep.stiffness", {"from": 1e3, "to": 1e5, "count": 3}))


def test_steps_may_be_counts_instead(changed):
    quick = changed("sweep.seed", 1)
    given = {"from": 100, "to": 200, "count": 10}
    counted = changed("sweep", {**_sweep_of("quick"), "steps": given})
    steps = {cell.steps for cell in counted.sweep.cells()}
    assert min(steps) >= 100
    assert max(steps) <= 200
    assert quick.sweep.omega_h is not None


def _sweep_of(name):
    sweep = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())["sweep"]
    del sweep["omega_h"]
    return sweep


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("sweep.members", 0, "sweep.members = 0: allowed is a whole number from 1"),
        ("sweep.members", "many", "sweep.members = many: allowed is a whole number"),
        ("sweep.members", None, "sweep.members is missing"),
        ("sweep.membrs", 3, "sweep.membrs: unknown key; allowed are"),
        ("sweep.steps", {"from": 1, "to": 2, "count": 1}, "sweep: give one of steps and omega_h"),
        ("sweep.omega_h", None, "sweep: give one of steps and omega_h"),
        ("sweep.stiffness.from", -1, "sweep.stiffness.from = -1: allowed is a finite number > 0"),
        ("sweep.stiffness.from", float("nan"), "sweep.stiffness.from = nan: allowed is a finite number"),
        ("sweep.stiffness.to", float("inf"), "sweep.stiffness.to = inf: allowed is a finite number > 0"),
        ("sweep.stiffness.count", 0, "sweep.stiffness.count = 0"),
        ("sweep.contact", ["sticky"], "sweep.contact.0 = sticky: allowed is ungated or gated"),
        ("sweep.contact", [], "sweep.contact = []"),
        ("sweep.model", "falling", "sweep.model = falling: allowed is sliding or tumbling"),
        ("sweep.scene", "nowhere.yaml", "nowhere.yaml: No such file"),
        ("sweep.set", ["ground.S=1"], "ground.S"),
        ("sweep.set", ["launch.position=[0, 0, 0.1]"], "sweep: members = 8: they are spread over the phase"),
        ("criteria", {"energy": -1}, "criteria.energy = -1: allowed is a number from 0 to 1e6"),
        ("criteria", {"beauty": 1}, "criteria.beauty: unknown key; allowed are energy, apex"),
        ("question", "", "question = "),
        ("question", None, "question is missing"),
        ("dpi", 5, "dpi = 5: allowed is a whole number from 50 to 1200"),
        ("runs.figure-04.steps", 0, "runs.figure-04.steps = 0: allowed is a whole number from 1 to"),
        ("runs.figure-04.every", 30_000, "runs.figure-04.every = 30000"),
        ("runs.figure-04.presets", ["corrected"], "state cube.inertia"),
        ("runs.Figure 4", {"scene": "x", "model": "sliding", "steps": 1}, "Figure 4"),
        ("figures.energy.run", "figure-99", "figures.energy.run = figure-99: allowed is figure-04 or figure-09"),
        (
            "figures.energy.draw",
            "cube-start",
            "figures.energy.run = figure-09: cube-start needs a run of model tumbling",
        ),
        ("figures.energy.draw", "poetry", "figures.energy.draw = poetry: allowed is"),
        ("sweep", None, "figures.frontier: frontier draws a sweep"),
        ("figures.frontier.run", "figure-04", "figures.frontier.run = figure-04: frontier draws the sweep"),
        ("figures.Big Figure", {"draw": "frontier", "title": "x"}, "figures.Big Figure: allowed names have small"),
        ("sweep.omega_h.to", 1e-300, "sweep.omega_h: asks for up to"),
        ("sweep.set", ["ground.stiffness=3"], "the sweep sets this itself, from sweep.stiffness"),
        ("sweep.contact", "gated", "sweep.contact = gated: allowed is a list of different contact laws"),
    ],
)
def test_bad_studies_end_with_one_line(changed, path, value, told):
    with pytest.raises(InputError) as caught:
        changed(path, value)
    assert told in str(caught.value)
    assert "quick.yaml: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_schema_knows_what_the_code_knows(study_schema):
    schema = yaml.safe_load(study_schema.read_text())
    kinds, parts = schema["$defs"], schema["properties"]
    assert kinds["model"]["enum"] == list(MODELS)
    assert kinds["scheme"]["enum"] == list(SCHEMES)
    assert kinds["run"]["properties"]["presets"]["items"]["enum"] == list(PRESETS)
    assert list(parts["criteria"]["properties"]) == list(CRITERIA)
    assert parts["figures"]["additionalProperties"]["properties"]["draw"]["enum"] == list(DRAWINGS)
