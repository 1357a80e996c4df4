"""What the documentation says is so: its commands run, its links lead somewhere, its tables name what there is.

Its pages are short, begin with what they are for, and can be reached.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from docs import make

from stiffdice.cli.main import main
from stiffdice.integrators.registry import SCHEMES
from stiffdice.scene import derived_parameters
from stiffdice.scene.cube import Cube
from stiffdice.scene.scene import PRESETS, Ground, Launch, Scene
from stiffdice.scene.scene import from_mapping as scene_from_mapping
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.engines.registry import ENGINES
from stiffdice.study.catalogue import EXPERIMENTS, TIMINGS
from stiffdice.study.config import load as load_study

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
SECTIONS = {"cube": Cube, "ground": Ground, "launch": Launch}
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for folder, pattern in ((ROOT, "*.md"), (ROOT / "config", "**/*.md"), (ROOT / "results", "*.md"), (DOCS, "**/*.md"))
    for path in folder.glob(pattern)
)


def without_code(page: str) -> str:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.sub(r"^ *```.*?^ *```|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)


def links(page: str) -> list[tuple[Path, str]]:
    """Return the files that a page leads to, with the places in them: `FILE#place`."""
    found = re.findall(r"\]\(([^)#:\s]*)(?:#([^)\s]+))?\)", without_code(page))
    return [((ROOT / page).parent.joinpath(file) if file else ROOT / page, place) for file, place in found]


def places(path: Path) -> set[str]:
    """Return the places of a page that a link may name, as code hosts name them: its headings."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    for path, place in links(page):
        assert path.exists(), path
        assert not place or place in places(path), f"{path}#{place}"


def test_every_page_can_be_reached_from_the_map():
    reached, new = set(), {DOCS / "index.md"}
    while new:
        reached |= new
        new = {path.resolve() for page in new for path, _ in links(page.relative_to(ROOT)) if path.suffix == ".md"}
        new -= reached
    assert {ROOT / page for page in PAGES} <= reached, "make docs names new pages in the index of their folder"


@pytest.mark.parametrize("page", sorted({*PAGES} - {"README.md", "CHANGELOG.md"}))
def test_a_page_is_short_and_begins_with_what_it_is_for_and_for_whom(page):
    title, empty, *lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 148
    assert re.match("# [^#]", title)
    assert not empty
    purpose = lines[: lines.index("")]
    assert len(purpose) <= 2
    assert re.search(r"\bwho\w*\b", " ".join(purpose)), "for whom?"


@pytest.mark.long
def test_pages_that_are_written_by_code_are_up_to_date():
    """And none is left that code no longer writes."""
    written = make.pages()
    there = {path: (DOCS / path).read_text(encoding="utf-8") if (DOCS / path).exists() else "" for path in written}
    assert [path for path, text in written.items() if text != there[path]] == [], "make docs"
    folders = {path.relative_to(DOCS).as_posix() for path in (DOCS / "reference").glob("*/*.md")}
    assert folders <= written.keys()


def rows(page: str, heading: str = "") -> list[list[str]]:
    """Return the rows of the tables under a heading of a page, or of all, whose first cell is code."""
    text = (ROOT / page).read_text()
    if heading:
        text = text.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = re.findall(r"(?m)^(\| `.*)\n(?!\| -- )", text)
    return [re.split(r"\s*(?<!\\)\|\s*", line.strip("| ")) for line in lines]


def test_the_page_of_scene_keys_tells_every_key_with_its_unit_and_the_default():
    """A scene of what it tells is the scene of an empty file."""
    told: dict[str, Any] = {}
    keys = rows("docs/reference/scene.md")
    for key, unit, default, _, meaning in (row for row in keys if len(row) == 5 and "." in row[0]):
        section, name = key.strip("`").split(".")
        assert meaning, key
        if default and default != "by preset":
            value = yaml.safe_load(default)
            told.setdefault(section, {})[name] = f"{value} {unit}".replace("'", "") if unit != "1" else value
    assert scene_from_mapping(told) == Scene()
    every = {f"{section}.{field.name}" for section, kind in SECTIONS.items() for field in dataclasses.fields(kind)}
    every |= {f"{section}.{name}" for section, names in derived_parameters.INSTEAD.items() for name in names}
    assert {row[0].strip("`") for row in keys} == every | {"preset", "gravity", "duration"} | set(PRESETS)


SCHEMA = yaml.safe_load((ROOT / "src/stiffdice/study/study.schema.yaml").read_text())
WORDS = (OURS, "symplectic_euler")
NEEDED = {
    "run": {"scene": "config/scenes/figure-09.yaml", "model": "sliding", "steps": 100},
    "sweep": {
        "scene": "config/scenes/figure-09.yaml",
        "model": "sliding",
        "contact": ["gated"],
        "stiffness": 1e4,
        "omega_h": {"from": 1.0, "to": 0.5, "count": 3},
        "members": 2,
    },
    "experiment": {"measure": "bounce-map", "scene": "config/scenes/figure-09.yaml"},
}


def test_the_defaults_of_a_study_that_are_told_are_those_that_it_has(tmp_path, monkeypatch):
    """A default in words is no value: it is left out."""
    monkeypatch.chdir(ROOT)
    told: dict[str, Any] = {"question": "Why?", "dpi": SCHEMA["properties"]["dpi"]["default"]}
    least: dict[str, Any] = {"question": "Why?"}
    for kind, needed in NEEDED.items():
        properties = SCHEMA["$defs"][kind]["properties"]
        assert {*SCHEMA["$defs"][kind]["required"]} <= needed.keys()
        values = {key: part["default"] for key, part in properties.items() if "default" in part}
        given = {
            key: value for key, value in values.items() if not isinstance(value, str) or re.fullmatch(r"\w+", value)
        }
        given.pop("reach", None)
        least[f"{kind}s"] = {"it": needed}
        told[f"{kind}s"] = {"it": given | needed}
    studies = []
    for plan in (least, told):
        (tmp_path / "it.yaml").write_text(yaml.safe_dump(plan))
        studies.append(repr(load_study(tmp_path / "it.yaml")))
    assert studies[0] == studies[1]


def test_every_key_of_a_study_says_what_it_means():
    for kind in (SCHEMA, *(SCHEMA["$defs"][name] for name in ("run", "sweep", "experiment", "figure", "table"))):
        assert all(part["description"] for part in kind["properties"].values())
    told = {row[0].strip("`"): float(row[1]) for row in rows("docs/reference/study.md", "criteria")}
    assert told == {name: part.TOLERANCE for name, part in CRITERIA.items()}


@pytest.mark.parametrize(("heading", "registry"), [("Experiments", EXPERIMENTS), ("Timings", TIMINGS)])
def test_every_option_of_an_experiment_and_of_a_timing_is_explained(heading, registry):
    """In the docstring of its function, or in that of another that it names."""
    told = {name.strip("`"): meaning for name, meaning, _ in rows("docs/reference/experiments.md", heading)}
    assert told.keys() == registry.keys()
    for name, entry in registry.items():
        for option, part in inspect.signature(entry.load()).parameters.items():
            explained = re.search(rf"`{option}`", told[name]) or re.search("(as of|as for|as there)", told[name])
            assert part.kind is not part.KEYWORD_ONLY or explained, (name, option)


def test_every_scheme_is_explained(capsys):
    listed = [row[0].strip("`") for row in rows("docs/reference/schemes.md", "Schemes")]
    assert listed == [*SCHEMES]
    assert all(f"`{name}`" in (ROOT / "docs/explanation/schemes.md").read_text() for name in SCHEMES)
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in SCHEMES)


def test_every_engine_is_explained(capsys):
    for page, heading in (("docs/explanation/engines.md", "Engines"), ("docs/reference/schemes.md", "Simulators")):
        told = " ".join(row[0] for row in rows(page, heading))
        assert all(f"`{name}`" in told for name in ENGINES), page
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in [OURS, *ENGINES])


@pytest.mark.parametrize("page", PAGES)
def test_prose_is_in_short_lines(page):
    """Tables, code, pictures and what has no blank to break at may be longer."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"^ *```.*?^ *```", "", text, flags=re.MULTILINE | re.DOTALL)
    prose = [line for line in text.splitlines() if not re.match(r"\||\[?!\[|`[^`]*`\W*$", line)]
    assert [line for line in prose if len(line) > 100] == []


def test_the_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 120
    assert [line for line in lines if len(line) > 100] == []
