"""Restitutions that were measured, each with its source. What has no source is not here."""

from __future__ import annotations

from typing import NamedTuple

from stiffdice.scene import validation


class Material(NamedTuple):
    """A pair of materials: restitution [1], its spread or range in words, speeds [m/s], who measured it."""

    pair: str
    restitution: float
    spread: str
    speeds: str
    source: str


MATERIALS = {
    "granite": Material(
        "granite spheres of 1 m, on each other",
        0.83,
        "± 0.06",
        "up to 1.5",
        "Durda et al. 2011, Icarus 211, 849",
    ),
    "table-tennis": Material(
        "table-tennis ball on a steel block",
        0.905,
        "0.887 to 0.923",
        "2.4",
        "International Table Tennis Federation, rule for balls: up 24 to 26 cm from 30.5 cm, e² their ratio",
    ),
    "glass": Material(
        "glass beads of 1 cm, on each other, as a gas",
        0.64,
        "fits all speeds",
        "0.0035 to 0.1",
        "Heißelmann, Blum and Wolling 2009, doi:10.1063/1.3180045",
    ),
    "ice": Material(
        "ice spheres of 1.5 cm, on each other",
        0.45,
        "0.06 to 0.84",
        "0.06 to 0.22",
        "Heißelmann, Blum, Fraser and Wolling 2010, arXiv:0908.3424",
    ),
    "acrylic-board": Material(
        "acrylic cube of 104.8 mm on a board",
        0.115,
        "0.04 to 0.16",
        "thrown by hand",
        "fitted to tosses of Pfrommer, Halm and Posa 2020, arXiv:2009.11193 (docs/explanation/tosses.md)",
    ),
}


def material(name: str) -> Material:
    """Return a pair of materials; raises InputError for one that is not known."""
    return MATERIALS[validation.choice("--material", name, MATERIALS)]
