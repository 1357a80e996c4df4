"""CITATION.cff: how this project wants to be cited (Citation File Format 1.2.0, https://doi.org/10.5281/zenodo.5171937)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader

_NEEDED = ("title", "version", "date-released", "license", "authors")
_NAMES = ("name", "given-names", "name-particle", "family-names", "name-suffix")


class Author(NamedTuple):
    """A person or, if there are no family names, an organisation; url: an ORCID or a web site, if there is one."""

    name: str
    is_person: bool
    url: str | None
    affiliation: str | None


class Citation(NamedTuple):
    """What a citation file says. url: of the project, if it has one; references: title and authors of each work."""

    title: str
    version: str
    released: str
    licence: str
    url: str | None
    abstract: str
    keywords: tuple[str, ...]
    authors: tuple[Author, ...]
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
            authors=_authors(data),
            references=tuple((work["title"], _named(_authors(work))) for work in data.get("references", ())),
        )

    @property
    def sentence(self) -> str:
        """How to cite it, in one line."""
        return f"{_named(self.authors)} ({self.released[:4]}): {self.title} Version {self.version}, {self.released}."


def _named(authors: Iterable[Author]) -> str:
    return ", ".join(author.name for author in authors)


def _authors(work: Mapping[str, Any]) -> tuple[Author, ...]:
    return tuple(
        Author(
            " ".join(entry[key] for key in _NAMES if key in entry),
            "name" not in entry,
            entry.get("orcid", entry.get("website")),
            entry.get("affiliation"),
        )
        for entry in work["authors"]
    )
