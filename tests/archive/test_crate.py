"""An archive says of itself what the RO-Crate specifications ask for, checked by their own validator, and it is so."""

from __future__ import annotations

import hashlib
import html.parser
import json
import os
import re
import shutil
import zipfile

import pytest
import yaml
from tests.archive import packing, roc

from stiffdice import __version__
from stiffdice.archive import crate
from stiffdice.archive.crate import Citation
from stiffdice.archive.pack import pack
from stiffdice.errors import InputError, RefusedError
from stiffdice.io.reader import open_file
from stiffdice.study import config as study
from stiffdice.study import outputs

# Its demands are those of Process Run Crate, Workflow RO-Crate and RO-Crate 1.1, and its own.
PROFILE = "workflow-run-crate"
# What is recommended and only somebody who publishes can say: where the project is found, who publishes it, who ran it.
NOT_OURS = {
    "./#author-1: The organization SHOULD have a URL.",
    "./#run: The Action SHOULD have an agent that is a Person or Organization",
    "./: The `publisher` property of a `Root Data Entity` SHOULD be an `Organization`",
}
# The workflow is a file of the crate, named by its path: the profile allows it ("MAY be a relative URI").
OF_FILES = {"http://schema.org/SoftwareSourceCode", "https://bioschemas.org/ComputationalWorkflow"}
NO_ADDRESS = "SHOULD be an absolute URI"


@pytest.fixture(scope="module")
def archive(finished, tmp_path_factory):
    return pack(finished[1], finished[0], tmp_path_factory.mktemp("packed") / "tiny.crate.zip").path


@pytest.fixture(scope="module")
def files(archive):
    with zipfile.ZipFile(archive) as opened:
        return {name: opened.read(name) for name in opened.namelist() if not name.endswith("/")}


@pytest.fixture(scope="module")
def entities(files):
    graph = json.loads(files[crate.NAME])["@graph"]
    assert len({entity["@id"] for entity in graph}) == len(graph)
    return {entity["@id"]: entity for entity in graph}


def ids(value) -> list[str]:
    return [part["@id"] for part in (value if isinstance(value, list) else [value])]


@pytest.mark.long
def test_the_validator_finds_nothing_that_is_required_or_that_we_could_say(archive, tmp_path):
    told = roc.findings(archive, PROFILE, tmp_path)
    assert told["REQUIRED"] == set()
    without_address = {message for message in told["RECOMMENDED"] if message.endswith(NO_ADDRESS)}
    assert told["RECOMMENDED"] - without_address == NOT_OURS


@pytest.mark.broad
def test_with_an_address_and_an_agent_only_the_publisher_is_left_to_say(finished, tmp_path):
    folder = tmp_path / "project"
    shutil.copytree(finished[0], folder, symlinks=True)
    cited = yaml.safe_load((folder / "CITATION.cff").read_text())
    cited["repository-code"] = "https://example.org/stiffdice"
    cited["authors"][0]["website"] = "https://example.org"
    (folder / "CITATION.cff").write_text(yaml.safe_dump(cited))
    packed = pack(finished[1], folder, tmp_path / "a.zip", agent="Ada Lovelace")
    told = roc.findings(packed.path, PROFILE, tmp_path)
    assert told["REQUIRED"] == set()
    (publisher,) = {message for message in told["RECOMMENDED"] if message.split(": ")[0] not in OF_FILES}
    assert "publisher" in publisher


@pytest.mark.broad
def test_the_validator_would_find_what_is_missing(archive, tmp_path):
    """Of every profile one demand, so that a validator that checks nothing is noticed."""
    demands = {
        ("./", "name"): "The Root Data Entity MUST have a `name`",
        ("#run", "instrument"): "The Action MUST have an instrument",
        ("workflow/Snakefile", "programmingLanguage"): "The Main Workflow must refer to its language",
    }
    with zipfile.ZipFile(archive) as whole, zipfile.ZipFile(tmp_path / "spoilt.zip", "w") as spoilt:
        for name in whole.namelist():
            data = whole.read(name)
            if name == crate.NAME:
                given = json.loads(data)
                for entity, key in demands:
                    del next(part for part in given["@graph"] if part["@id"] == entity)[key]
                data = json.dumps(given).encode()
            spoilt.writestr(name, data)
    told = "\n".join(roc.findings(tmp_path / "spoilt.zip", PROFILE, tmp_path)["REQUIRED"])
    assert [message for message in demands.values() if message not in told] == []


@pytest.mark.long
def test_every_file_that_is_described_is_there_as_described(files, entities):
    described = [entity for entity in entities.values() if "File" in entity["@type"]]
    for entity in described:
        data = files[entity["@id"]]
        if entity["@id"] == "manifest-sha256.txt":
            continue  # it would have to hold its own digest
        assert entity["contentSize"] == str(len(data))
        assert entity["sha256"] == hashlib.sha256(data).hexdigest()
        assert entity["encodingFormat"]
    assert {entity["@id"] for entity in described} <= set(ids(entities["./"]["hasPart"]))


def test_the_run_made_all_results_of_the_study_from_its_scenes(finished, entities):
    run = entities["#run"]
    made = {f"results/tiny/{file}" for result in outputs.of(finished[1]) for file in result.files}
    assert set(ids(run["result"])) == made | {"results/tiny/"}
    assert set(ids(run["object"])) == {
        "config/tiny.yaml",
        "config/scenes/figure-09.yaml",
        "my-scene.yaml",
    }
    assert ids(run["instrument"]) == ids(entities["./"]["mainEntity"]) == ["workflow/Snakefile"]
    # By the times of the benchmarks: the first job took 12.5 seconds, all ended at once.
    assert (run["startTime"], run["endTime"]) == ("2027-01-15T07:59:47+00:00", "2027-01-15T08:00:00+00:00")
    assert entities["./"]["datePublished"] == "2027-01-15"
    assert "agent" not in run


def test_times_that_a_zip_file_does_not_keep_are_not_made_up(finished, tmp_path):
    folder = tmp_path / "project"
    shutil.copytree(finished[0], folder, symlinks=True)
    for path in (folder / "results/tiny/benchmarks").rglob("*.tsv"):
        os.utime(path, (315532800, 315532800))  # 1980-01-01
    with zipfile.ZipFile(pack(finished[1], folder, tmp_path / "a.zip").path) as opened:
        graph = {part["@id"]: part for part in json.loads(opened.read(crate.NAME))["@graph"]}
    assert "endTime" not in graph["#run"]
    assert graph["./"]["datePublished"] == Citation.load(packing.ROOT / "CITATION.cff").released


def test_a_benchmark_that_is_none_is_told(finished, tmp_path):
    folder = tmp_path / "project"
    shutil.copytree(finished[0], folder, symlinks=True)
    (folder / "results/tiny/benchmarks/frontier/steps.tsv").write_text("s\n")
    with pytest.raises(RefusedError, match=r"^results/tiny/benchmarks/frontier/steps\.tsv: not a benchmark"):
        pack(finished[1], folder, tmp_path / "a.zip")


def test_results_are_described_by_their_titles_or_stages():
    told = study.load(packing.ROOT / "config/tradeoff.yaml")
    for result in outputs.of(told):
        title = {"figure": told.figures, "table": told.tables}.get(result.stage, {}).get(result.name)
        assert crate.describe(result, told) == (title.title if title else f"{result.stage} {result.name}")


def test_it_names_the_versions_that_the_data_name(finished, entities):
    told = {
        entity["name"]: entity["softwareVersion"]
        for entity in map(entities.get, ids(entities["workflow/Snakefile"]["softwareRequirements"]))
    }
    data = open_file(finished[0] / "results/tiny/runs/fall.as_listed.h5")
    assert told == dict(entry.split(" ") for entry in data.attrs["libraries"].split("; ")) | {"stiffdice": __version__}


def test_what_a_run_takes_is_stated(files, entities):
    shards = [len(data) for name, data in files.items() if "/shards/" in name and name.endswith(".h5")]
    told = re.search(r"([0-9]+) runs in ([0-9]+) shards: ([0-9.]+) bytes a run", entities["./"]["description"])
    assert (int(told[1]), int(told[2])) == (3 * 5 * 4, len(shards))
    assert float(told[3]) == pytest.approx(sum(shards) / 60, abs=0.05)


class Page(html.parser.HTMLParser):
    """Notes what a page refers to, and its text."""

    def __init__(self):
        super().__init__()
        self.targets: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.targets += [value for key, value in attrs if key in ("href", "src")]

    def handle_data(self, data):
        self.text += data


def test_the_page_for_people_needs_nothing_from_elsewhere(files):
    page = Page()
    page.feed(files["ro-crate-preview.html"].decode())
    assert set(page.targets) <= files.keys()
    assert {"LICENSE", "CITATION.cff", "results/tiny/figures/position.png", "results/tiny/report.html"} <= set(
        page.targets
    )
    assert "Is <all> of it packed?" in page.text
    assert "Position & place" in page.text
    assert "60 runs in 2 shards" in page.text
    assert "make study STUDY=tiny" in page.text


# --- CITATION.cff, by the schema of Citation File Format 1.2.0 ---

KEYS = {
    "abstract", "authors", "cff-version", "commit", "contact", "date-released", "doi", "identifiers", "keywords",
    "license", "license-url", "message", "preferred-citation", "references", "repository", "repository-artifact",
    "repository-code", "title", "type", "url", "version",
}  # fmt: skip
ENTITY = {
    "address", "alias", "city", "country", "date-end", "date-start", "email", "fax", "location", "name", "orcid",
    "post-code", "region", "tel", "website",
}  # fmt: skip
PERSON = {
    "address", "affiliation", "alias", "city", "country", "email", "family-names", "fax", "given-names",
    "name-particle", "name-suffix", "orcid", "post-code", "region", "tel", "website",
}  # fmt: skip
WORKS = {"article", "conference-paper", "generic", "report", "software", "software-code", "thesis", "unpublished"}


def test_the_citation_file_keeps_to_its_format():
    given = yaml.load((packing.ROOT / "CITATION.cff").read_text(), yaml.BaseLoader)
    assert given.keys() >= {"authors", "cff-version", "message", "title"}
    assert given.keys() <= KEYS
    assert given["cff-version"] == "1.2.0"
    assert given["type"] in {"software", "dataset"}
    assert given["version"] == __version__
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", given["date-released"])
    assert len(set(given["keywords"])) == len(given["keywords"])
    for work in (given, *given["references"]):
        assert work["title"]
        assert work["authors"]
        for author in work["authors"]:
            assert author.keys() <= (ENTITY if "name" in author else PERSON)
    for work in given["references"]:
        assert work["type"] in WORKS


def test_the_paper_is_cited_and_the_licence_is_the_one_in_the_file():
    cited = Citation.load(packing.ROOT / "CITATION.cff")
    assert "Modeling and Simulating Dice" in [title for title, _ in cited.references]
    assert cited.licence == "MIT"
    assert (packing.ROOT / "LICENSE").read_text().startswith("MIT License")


def test_people_are_cited_by_their_whole_names(tmp_path):
    path = tmp_path / "CITATION.cff"
    ada = {"family-names": "King", "given-names": "Ada", "orcid": "https://orcid.org/0000-0001-2345-6789"}
    text = {"title": "T", "version": "1", "date-released": "2026-01-02", "license": "MIT", "authors": [ada]}
    path.write_text(yaml.safe_dump(text))
    cited = Citation.load(path)
    assert cited.sentence == "Ada King (2026): T Version 1, 2026-01-02."
    del text["license"]
    path.write_text(yaml.safe_dump(text))
    with pytest.raises(InputError, match=r"CITATION\.cff: license is missing"):
        Citation.load(path)
