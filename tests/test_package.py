"""What the package says of itself, to registries, to who cites it, and to the catalogue of Snakemake workflows."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import jsonschema
import pytest
import yaml

import stiffdice
from tests.forks import run_module

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CITATION = json.loads(json.dumps(yaml.safe_load((ROOT / "CITATION.cff").read_text()), default=str))

# https://github.com/snakemake/snakemake-workflow-catalog, README.md: "Standardized usage workflows"; `report` is read
# from where it stands here (scripts/generate-catalog.py).
FLAGS = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string", "pattern": "^-"}}]}
WAYS = ("conda", "apptainer", "apptainer+conda")
CATALOGUE = {
    "type": "object",
    "additionalProperties": False,
    "required": ["usage"],
    "properties": {
        "usage": {
            "type": "object",
            "additionalProperties": False,
            "required": ["software-stack-deployment"],
            "properties": {
                "mandatory-flags": {
                    "type": "object",
                    "additionalProperties": False,
                    "properties": {"desc": {"type": "string"}, "flags": FLAGS},
                },
                "software-stack-deployment": {
                    "type": "object",
                    "additionalProperties": False,
                    "properties": {name: {"type": "boolean"} for name in WAYS},
                    "anyOf": [{"properties": {name: {"const": True}}, "required": [name]} for name in WAYS],
                },
                "report": {"type": "boolean"},
            },
        }
    },
}


def test_the_citation_keeps_to_its_format():
    schema = json.loads((ROOT / "tests/reference/citation/schema.json").read_text())
    checker = jsonschema.Draft7Validator(schema, format_checker=jsonschema.Draft7Validator.FORMAT_CHECKER)
    assert [error.message for error in checker.iter_errors(CITATION)] == []
    assert not checker.is_valid({**CITATION, "date-released": "November 2026"})


def test_citation_package_and_library_say_the_same():
    assert CITATION["version"] == PROJECT["version"] == stiffdice.__version__
    assert CITATION["license"] == PROJECT["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text().startswith("MIT License")
    assert CITATION["title"].lower() == f"{PROJECT['name']}: {PROJECT['description']}".lower()
    assert CITATION["keywords"] == PROJECT["keywords"]
    assert CITATION["authors"] == PROJECT["authors"]


def test_the_change_log_knows_the_version_of_the_citation():
    assert re.search(rf"^## .*{re.escape(CITATION['version'])}", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)


def test_the_pythons_that_are_named_are_those_that_are_allowed():
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    env = yaml.safe_load((ROOT / "workflow/envs/stiffdice.yaml").read_text())
    assert named == ["3.11", "3.12", "3.13"]
    assert PROJECT["requires-python"] == f">={named[0]}"
    assert env["dependencies"][0] == f"python >={named[0]},<3.14"


def test_every_package_that_the_library_needs_is_in_the_conda_environment():
    env = yaml.safe_load((ROOT / "workflow/envs/stiffdice.yaml").read_text())
    (pip,) = (part["pip"] for part in env["dependencies"] if isinstance(part, dict))
    assert {name.lower() for name in PROJECT["dependencies"]} <= {line.partition("==")[0] for line in pip}


def test_the_catalogue_lists_the_workflow_among_those_with_standardized_usage():
    said = yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text())
    jsonschema.validate(said, CATALOGUE)
    assert (ROOT / "workflow/Snakefile").is_file()
    assert [*(ROOT / "workflow/rules").glob("*.smk")]
    readme = (ROOT / "README.md").read_text().lower()
    assert "snakemake" in readme and "workflow" in readme


def test_the_ways_of_deployment_that_the_catalogue_is_told_are_those_that_rules_have():
    ways = yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text())["usage"]["software-stack-deployment"]
    rules = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    assert ways["conda"] == (rules.count("    conda:\n") == rules.count("    script:\n") > 0)
    assert ways["apptainer"] == ("container:" in rules)


def test_the_configuration_that_is_deployed_names_a_study_and_is_explained():
    """Who deploys the workflow gets all of config/, and the catalogue shows its README.md."""
    (study,) = yaml.safe_load((ROOT / "config/config.yml").read_text()).values()
    assert (ROOT / f"config/{study}.yaml").is_file()
    top = (ROOT / "config/README.md").read_text().partition("## Scene\n")[0]
    words = ("config/config.yml", f"config/{study}.yaml", "pip install", "snakemake --cores")
    assert [word for word in words if word not in top] == []


@pytest.mark.long
def test_the_snakefile_at_the_top_is_the_workflows():
    asked = [[], ["--snakefile", "workflow/Snakefile"]]
    said = [run_module("snakemake", "--list-rules", *more, cwd=ROOT) for more in asked]
    assert [done.returncode for done in said] == [0, 0], said
    assert said[0].stdout == said[1].stdout != ""
