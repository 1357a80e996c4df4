"""What the documentation says is so: its links lead somewhere, its tables name what there is.

That its commands run is tested in tests/documentation/.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest
import yaml

from stiffdice.cli.main import main
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene import derived_parameters
from stiffdice.scene.scene import PRESETS, Scene
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.engines.registry import ENGINES
from stiffdice.study.catalogue import DRAWINGS, EXPERIMENTS, TABLES, TIMINGS

ROOT = Path(__file__).parent.parent
PAGES = [
    "README.md",
    "config/README.md",
    "results/README.md",
    "docs/reference/house.md",
    "docs/reference/figures.md",
    "docs/reference/api.md",
    "docs/explanation/method.md",
    "docs/how-to/advice.md",
    "docs/how-to/ground.md",
    "docs/how-to/command-line.md",
    "docs/how-to/check.md",
    "docs/explanation/speed.md",
    "docs/explanation/stability.md",
    "docs/explanation/tradeoff.md",
    "docs/explanation/engines.md",
    "docs/explanation/pair.md",
    "docs/explanation/pair-engines.md",
    "docs/explanation/engines-dart.md",
    "docs/explanation/engines-drake.md",
    "docs/explanation/engines-mujoco-pybullet.md",
    "docs/explanation/granular.md",
    "docs/reference/FORMAT.md",
    "docs/how-to/archive.md",
    "docs/how-to/verify.md",
    "docs/how-to/diff.md",
    "docs/how-to/status.md",
    "docs/how-to/robustness.md",
    "docs/reference/trust.md",
    "docs/how-to/slurm.md",
    "docs/explanation/scale.md",
    "docs/explanation/cost.md",
    "docs/explanation/refinement.md",
    "docs/explanation/pair-limits.md",
    "docs/explanation/dice.md",
    "docs/explanation/dice-shapes.md",
    "docs/how-to/dice-rolls.md",
    "docs/explanation/tosses.md",
    "docs/explanation/paper.md",
    "docs/how-to/targets.md",
    "docs/tutorial/first-throw.md",
    "docs/tutorial/first-study.md",
    "docs/tutorial/first-die.md",
    "docs/tutorial/first-engine-check.md",
    "CHANGELOG.md",
]


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    text = re.sub(r"<!--.*?-->", "", (ROOT / page).read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / page).parent.joinpath(target).exists(), target


def table_keys(page: str, heading: str) -> list[tuple[str, ...]]:
    text = (ROOT / page).read_text().partition(f"## {heading}\n")[2].partition("\n## ")[0]
    return [tuple(re.split(r"\s*\|\s*", line.strip("| "))) for line in text.splitlines() if line.startswith("| `")]


def test_the_table_of_scene_keys_has_every_key_and_its_default():
    plain = Scene().as_mapping()
    expected = {key: plain[key] for key in ("gravity", "duration")} | {"cube.load": None, "cube.moments": None}
    for section in ("cube", "ground", "launch"):
        expected |= {f"{section}.{key}": value for key, value in plain[section].items()}
    told, in_other_words = {}, set()
    for row in table_keys("config/README.md", "Scene"):
        key = re.match(r"`([\w.]+)`", row[0])[1]
        if key in PRESETS or key == "preset":
            continue
        section, _, name = key.partition(".")
        if name in derived_parameters.INSTEAD.get(section, ()):
            assert row[2] == "", "what is given in other words has no default"
            in_other_words.add(key)
            continue
        told[key] = yaml.safe_load(row[2].strip("`").replace("e4", "e+4"))
    assert told == expected
    assert in_other_words == {
        f"{section}.{name}" for section, names in derived_parameters.INSTEAD.items() for name in names
    }


def test_the_table_of_study_keys_has_every_key():
    schema = yaml.safe_load((ROOT / "workflow/schemas/study.schema.yaml").read_text())
    told = " ".join(row[0] for row in table_keys("config/README.md", "Study"))
    parts = schema["properties"]
    kinds = schema["$defs"]
    keys = [*parts, *CRITERIA]
    for name in ("sweep", "run", "experiment", "figure", "table"):
        keys += [*kinds[name]["properties"]]
    for key in keys:
        assert re.search(rf"[`.]{key}[`.]", told), key


def test_the_tolerances_that_are_told_are_the_defaults():
    told = {
        row[0].strip("`"): float(row[1]) for row in table_keys("config/README.md", "Study") if "`criteria." in row[0]
    }
    assert told == {f"criteria.{name}": part.TOLERANCE for name, part in CRITERIA.items()}


@pytest.mark.parametrize(("heading", "registry"), [("`measure`", EXPERIMENTS), ("`measure` of a timing", TIMINGS)])
def test_every_option_of_an_experiment_and_of_a_timing_is_explained(heading, registry):
    text = (ROOT / "config/README.md").read_text().partition(f"| {heading} | what |")[2].partition("\n\n")[0]
    for name, entry in registry.items():
        (row,) = (line for line in text.splitlines() if line.startswith(f"| `{name}` |"))
        for option, part in inspect.signature(entry.load()).parameters.items():
            assert part.kind is not part.KEYWORD_ONLY or f"`{option}`" in row, (name, option)


def test_the_tables_of_what_a_study_asks_for_name_all_that_there_is():
    rows = [row for row in table_keys("config/README.md", "Study") if len(row) == 3]
    of_study = {key: sorted(re.findall(r"`([\w-]+)`", meaning)) for key, _, meaning in rows}
    assert of_study["`figures.NAME.draw`"] == sorted(DRAWINGS)
    assert of_study["`tables.NAME.tell`"] == sorted(TABLES)
    text = (ROOT / "config/README.md").read_text()
    for heading, registry in (("`measure`", EXPERIMENTS), ("`measure` of a timing", TIMINGS)):
        rows = text.partition(f"| {heading} | what |")[2].partition("\n\n")[0]
        assert sorted(re.findall(r"^\| `([\w-]+)` \|", rows, re.MULTILINE)) == sorted(registry)


def test_every_scheme_is_explained(capsys):
    rows = [row[0] for row in table_keys("config/README.md", "Study")]
    assert [name for name in rows if name.strip("`") in SCHEMES] == [f"`{name}`" for name in SCHEMES]
    assert all(f"`{name}`" in (ROOT / "docs/explanation/method.md").read_text() for name in SCHEMES)
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in SCHEMES)


def test_every_engine_is_explained(capsys):
    for page, heading in (("docs/explanation/engines.md", "Engines"), ("config/README.md", "Study")):
        told = " ".join(row[0] for row in table_keys(page, heading))
        assert all(f"`{name}`" in told for name in ENGINES), page
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in [OURS, *ENGINES])


@pytest.mark.parametrize("page", PAGES)
def test_prose_is_in_short_lines(page):
    """Tables, code, pictures and what has no blank to break at may be longer."""
    text = re.sub(r"^ *```.*?^ *```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    prose = [line for line in text.splitlines() if not re.match(r"\||\[?!\[|`[^`]*`\W*$", line)]
    assert [line for line in prose if len(line) > 100] == []


def test_the_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    assert [line for line in lines if len(line) > 100] == []
