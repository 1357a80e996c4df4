"""What an archive says of itself: to people a page, to programs an RO-Crate 1.1 that keeps to Workflow Run Crate 0.5.

The specifications: https://w3id.org/ro/crate/1.1, https://w3id.org/ro/wfrun/workflow/0.5 (and with it
https://w3id.org/ro/wfrun/process/0.5 and https://w3id.org/workflowhub/workflow-ro-crate/1.0).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from mimetypes import MimeTypes
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple
from urllib.parse import quote

from stiffdice.archive import manifest
from stiffdice.archive.contents import LOGS, REPORT, File, Sizes, in_megabytes
from stiffdice.errors import InputError, RefusedError, printable
from stiffdice.io import yaml_loader
from stiffdice.study.config import Study
from stiffdice.study.job_log import took
from stiffdice.study.outputs import Result

NAME, PREVIEW = "ro-crate-metadata.json", "ro-crate-preview.html"

# What the crate conforms to: names and versions; and what its workflow does.
_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": ("Process Run Crate", "0.5"),
    "https://w3id.org/ro/wfrun/workflow/0.5": ("Workflow Run Crate", "0.5"),
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": ("Workflow RO-Crate", "1.0"),
}
_WORKFLOW_PROFILE = "https://bioschemas.org/profiles/ComputationalWorkflow/1.0-RELEASE"
# Schema.org has had this property since its version 12, RO-Crate 1.1 goes by version 10.
_TERMS = {"sha256": "http://schema.org/sha256"}
_NETCDF = "https://docs.unidata.ucar.edu/netcdf-c/current/file_format_specifications.html"

# Besides those that Python knows.
_FORMATS = {
    ".cff": "application/yaml",
    ".md": "text/markdown",
    ".toml": "application/toml",
    ".yaml": "application/yaml",
}
# Files of the project that are described one by one, besides the study's and README.md, which is about the whole.
_FILES = ("CITATION.cff", "LICENSE", "CHANGELOG.md", "Makefile", "pyproject.toml", "results/README.md")
_HOMEPAGES = {
    "dartpy": "https://dartsim.github.io",
    "drake": "https://drake.mit.edu",
    "h5netcdf": "https://h5netcdf.org",
    "h5py": "https://www.h5py.org",
    "llvmlite": "https://llvmlite.readthedocs.io",
    "mujoco": "https://mujoco.org",
    "numba": "https://numba.pydata.org",
    "numpy": "https://numpy.org",
    "octave": "https://octave.org",
    "pybullet": "https://pybullet.org",
    "scipy": "https://scipy.org",
    "xarray": "https://xarray.dev",
}


# Of CITATION.cff, what must be there; of its persons, what makes a whole name.
_NEEDED = ("title", "version", "date-released", "license", "authors")
_NAMES = ("name", "given-names", "name-particle", "family-names", "name-suffix")


class Citation(NamedTuple):
    """What CITATION.cff says (Citation File Format 1.2.0, https://doi.org/10.5281/zenodo.5171937).

    url: of the project, if it has one. authors: entries of persons and organisations. references: title and authors of
    each work.
    """

    title: str
    version: str
    released: str
    licence: str
    url: str | None
    abstract: str
    keywords: tuple[str, ...]
    authors: Sequence[Mapping[str, str]]
    references: tuple[tuple[str, str], ...]

    @classmethod
    def load(cls, path: Path) -> Citation:
        """Return what the file says; raises InputError naming the file and the key that is missing."""
        data = yaml_loader.load(path)
        for key in _NEEDED:
            if not isinstance(data, dict) or key not in data:
                raise InputError(f"{path}: {key} is missing")
        return cls(
            title=str(data["title"]),
            version=str(data["version"]),
            released=str(data["date-released"]),
            licence=str(data["license"]),
            url=data.get("repository-code", data.get("url")),
            abstract=" ".join(str(data.get("abstract", "")).split()),
            keywords=tuple(data.get("keywords", ())),
            authors=data["authors"],
            references=tuple((work["title"], _names(work["authors"])) for work in data.get("references", ())),
        )

    @property
    def sentence(self) -> str:
        """How to cite it, in one line."""
        return f"{_names(self.authors)} ({self.released[:4]}): {self.title} Version {self.version}, {self.released}."


def _name_of(author: Mapping[str, str]) -> str:
    return " ".join(author[key] for key in _NAMES if key in author)


def _names(authors: Iterable[Mapping[str, str]]) -> str:
    return ", ".join(map(_name_of, authors))


class Facts(NamedTuple):
    """What an archive says of itself is told from.

    scenes: paths of those that the study names. digests: size in bytes and SHA-256 of every file, by its path.
    software: names and versions that the data give. span: when the first job began and the last one ended, if known.
    agent: who ran it, if that is to be said.
    """

    study: Study
    citation: Citation
    files: Sequence[File]
    scenes: Sequence[str]
    digests: Mapping[str, tuple[int, str]]
    sizes: Sizes
    software: Sequence[tuple[str, str]]
    span: tuple[datetime, datetime] | None
    agent: str | None

    @property
    def title(self) -> str:
        """What the archive is, in one line."""
        return f"stiffdice study {self.study.name}: {self.study.question}"


def span_of(files: Iterable[File]) -> tuple[datetime, datetime] | None:
    """Return when the first job began and when the last one ended, to the second, as their benchmarks tell.

    None if there are none, or if they come from a zip file, which keeps no times. Raises RefusedError naming what
    should be a benchmark and is none.
    """
    begun, ended = [], []
    for file in files:
        if file.kind == LOGS and file.source.suffix == ".tsv":
            seconds = took(file.source)
            if seconds is None:
                raise RefusedError(f"{file.path}: not a benchmark of Snakemake; remove it")
            ended.append(file.source.stat().st_mtime)
            begun.append(ended[-1] - seconds)
    if not ended or datetime.fromtimestamp(min(ended), UTC).year <= 1980:
        return None
    return datetime.fromtimestamp(int(min(begun)), UTC), datetime.fromtimestamp(int(max(ended)), UTC)


def describe(result: Result, study: Study) -> str:
    """Return in one line what a result is: the title of a figure or table, the stage and name of any other."""
    shown = {"figure": study.figures, "animation": study.figures, "pdf": study.figures, "table": study.tables}.get(
        result.stage, {}
    )
    return shown[result.name].title if result.name in shown else f"{result.stage} {result.name}"


def metadata(facts: Facts) -> str:
    """Return the text of ro-crate-metadata.json; it says nothing that the same files would not say again."""
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.1")
    _Crate(crate, facts).fill()
    graph = crate.metadata.generate()
    entities = sorted(graph["@graph"], key=lambda entity: str(entity["@id"]))
    for entity in entities:
        # RO-Crate 1.1 recommends no lists of one (appendix JSON-LD).
        entity.update((key, *value) for key, value in entity.items() if isinstance(value, list) and len(value) == 1)
    return json.dumps({**graph, "@graph": entities}, indent=1, sort_keys=True) + "\n"


def page(facts: Facts) -> str:
    """Return the page, as HTML: all text is shown as it is, in its order."""
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=True, keep_trailing_newline=True)
    environment.finalize = lambda value: printable(value) if isinstance(value, str) else value
    environment.filters["megabytes"] = in_megabytes
    template = environment.from_string(Path(__file__).with_name("preview.html.jinja").read_text(encoding="utf-8"))
    # Worth opening; shards, logs and code are in the manifest.
    paths = ["README.md", "LICENSE", "CITATION.cff", f"config/{facts.study.name}.yaml", manifest.NAME]
    for file in facts.files:
        is_data = file.result is not None and file.result.stage not in {"shard", "figure", "animation", "pdf"}
        if is_data or file.kind == REPORT or file.path == "docs/reference/FORMAT.md":
            paths.append(file.path)
    return template.render(facts=facts, paths=paths, manifest=manifest.NAME)


class _Crate:
    """Fills a crate: each method adds entities, and returns those that others refer to."""

    def __init__(self, crate: Any, facts: Facts) -> None:
        self.crate, self.facts = crate, facts

    def fill(self) -> None:
        """Add everything."""
        facts, root = self.facts, self.crate.root_dataset
        self.crate.metadata.extra_terms.update(_TERMS)
        self._add(PREVIEW, "CreativeWork", name="What this is, for people", encodingFormat="text/html", about=root)
        workflow = self._workflow()
        inputs = [self._file(path) for path in (f"config/{facts.study.name}.yaml", *facts.scenes)]
        outputs = self._results()
        for path in _FILES:
            self._file(path)
        self._file("README.md", about=root)
        self._add(_NETCDF, "WebSite", name="netCDF-4 on HDF5")
        told = {"name": manifest.NAME, "encodingFormat": "text/plain"}
        told["description"] = "The SHA-256 of every file but itself: sha256sum --check"
        self.crate.add_file(dest_path=manifest.NAME, properties=told)
        begun, ended = (time.isoformat() for time in facts.span) if facts.span else (None, None)
        run = self._add(
            "#run",
            "CreateAction",
            name=f"The run of the study {facts.study.name}",
            description=f"snakemake study --config study={facts.study.name}",
            actionStatus="http://schema.org/CompletedActionStatus",
            instrument=workflow,
            object=inputs,
            result=outputs,
            startTime=begun,
            endTime=ended,
            agent=self._add("#agent", "Person", name=facts.agent) if facts.agent else None,
        )
        for key, value in self._described(run).items():
            root[key] = value

    def _add(self, identifier: str, kind: str, **properties: Any) -> Any:
        """Add an entity that is no file, and return it; properties without a value are left out."""
        from rocrate.model.contextentity import ContextEntity

        told = {key: value for key, value in properties.items() if value not in (None, [], "")}
        return self.crate.add(ContextEntity(self.crate, identifier, properties={"@type": kind, **told}))

    def _file(self, path: str, **properties: Any) -> Any:
        return self.crate.add_file(dest_path=quote(path), properties=self._said(path) | properties)

    def _said(self, path: str) -> dict[str, Any]:
        """Return size, digest and format of a file."""
        size, sha256 = self.facts.digests[path]
        suffix = PurePosixPath(path).suffix
        media = _FORMATS.get(suffix) or MimeTypes().types_map[True].get(suffix, "text/plain")
        told: dict[str, Any] = {"name": PurePosixPath(path).name, "contentSize": str(size), "sha256": sha256}
        return told | {"encodingFormat": [media, {"@id": _NETCDF}] if suffix == ".h5" else media}

    def _described(self, run: Any) -> dict[str, Any]:
        """Return what the crate says of itself."""
        facts, cited = self.facts, self.facts.citation
        licence = f"https://spdx.org/licenses/{cited.licence}"
        about = (
            f"{facts.study.question} A study of stiffdice {cited.version}: its data, figures, report, configuration, "
            "workflow, code and locked versions. 'stiffdice verify' checks it, 'stiffdice rebuild' makes it again. "
            f"{facts.sizes.sentence}"
        ).strip()
        told = f"{cited.licence} licence; its text is in the file LICENSE."
        authors = []
        for k, author in enumerate(cited.authors, 1):
            kind, where = "Organization" if "name" in author else "Person", author.get("affiliation")
            employer = self._add(f"#affiliation-{k}", "Organization", name=where) if where else None
            url = author.get("orcid", author.get("website"))
            authors.append(self._add(url or f"#author-{k}", kind, name=_name_of(author), url=url, affiliation=employer))
        references = [
            self._add(f"#reference-{k}", "CreativeWork", name=title, description=f"By {names}")
            for k, (title, names) in enumerate(cited.references, 1)
        ]
        properties = {
            "name": facts.title,
            "description": " ".join([about, *(f"{line}." for line in facts.study.left_out)]),
            # The day on which the last result was made or, if that is not known, the program released.
            "datePublished": facts.span[1].date().isoformat() if facts.span else cited.released,
            "version": cited.version,
            "keywords": ", ".join(cited.keywords),
            "license": self._add(licence, "CreativeWork", name=cited.licence, description=told, url=licence),
            "author": authors,
            "citation": references,
            "conformsTo": [
                self._add(identifier, "CreativeWork", name=name, version=number)
                for identifier, (name, number) in _PROFILES.items()
            ],
            "mentions": [run],
        }
        return {key: value for key, value in properties.items() if value}

    def _workflow(self) -> Any:
        """Add the workflow, with whatever made the numbers, in the versions that the files of results give."""
        try:
            number = version("snakemake")
        except PackageNotFoundError:
            number = None
        ours, software = self.facts.citation.url, []
        for name, release in self.facts.software:
            home = (ours if name == "stiffdice" else _HOMEPAGES.get(name)) or ""
            url = home or ({"@id": "README.md"} if name == "stiffdice" else None)
            told = {"name": name, "softwareVersion": release, "url": url}
            software.append(self._add(f"{home}#{quote(f'{name}-{release}')}", "SoftwareApplication", **told))
        about = self._said("Snakefile") | {
            "name": "stiffdice: how many time steps a stiff ground costs",
            "description": "From a study to runs, shards, sweeps, frontiers, figures and tables.",
            "version": self.facts.citation.version,
            "url": ours or {"@id": "README.md"},
            "encodingFormat": "text/plain",
            "conformsTo": self._add(_WORKFLOW_PROFILE, "CreativeWork", name="Bioschemas ComputationalWorkflow"),
            "softwareRequirements": software,
        }
        return self.crate.add_workflow(
            dest_path="Snakefile", main=True, lang="snakemake", lang_version=number, properties=about
        )

    def _results(self) -> list[Any]:
        """Add everything below results/STUDY/, and return what the workflow made."""
        facts, top = self.facts, f"results/{self.facts.study.name}"
        made, sides, of_run = [], [], {"about": {"@id": "#run"}}
        for file in facts.files:
            if file.result is not None:
                made.append(self._file(file.path, description=describe(file.result, facts.study)))
            elif file.kind == REPORT:
                told = "Snakemake's report: every figure with its caption, code and configuration, and when jobs ran"
                sides.append(self._file(file.path, description=told, **of_run))
        for name, told in (("logs", "What every job said"), ("benchmarks", "How long it took")):
            if any(file.path.startswith(f"{top}/{name}/") for file in facts.files):
                about = {"name": name, "description": f"{told}; differs between two rebuilds", **of_run}
                sides.append(self.crate.add_dataset(dest_path=f"{top}/{name}/", properties=about))
        about = {"name": facts.study.name, "description": "All results of the study", "hasPart": [*made, *sides]}
        return [self.crate.add_dataset(dest_path=f"{top}/", properties=about), *made]
