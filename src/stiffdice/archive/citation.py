"""CITATION.cff: how this project wants to be cited (Citation File Format 1.2.0, https://doi.org/10.5281/zenodo.5171937)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader

_NEEDED = ("title", "version", "date-released", "license", "authors")
_NAMES = ("name", "given-names", "name-particle", "family-names", "name-suffix")


class Citation(NamedTuple):
    """What a citation file says. url: of the project, if it has one; references: title and authors of each work.

    authors: the entries of persons and organisations (`name_of`).
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


def name_of(author: Mapping[str, str]) -> str:
    """Return the whole name of a person or an organisation."""
    return " ".join(author[key] for key in _NAMES if key in author)


def _names(authors: Iterable[Mapping[str, str]]) -> str:
    return ", ".join(map(name_of, authors))
