"""What figures and tables of two cubes share: words for cases and poses, and units."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.number_format import scene_of
from stiffdice.scene import scene as scenes

CASES = {
    "head_on": "head-on, face on face",
    "edge_edge": "edge on edge, crossed",
    "corner_face": "corner on face",
    "stacked": "stacked on the ground",
}
POSES = {"parallel": "faces parallel", "turned": "the struck cube turned by 45°"}


def cases_of(experiments: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return what was found by case."""
    return {
        name: found.isel(case=k) for found in experiments.values() for k, name in enumerate(meanings_of(found.case))
    }


def spin_of_units(found: xr.Dataset) -> float:
    """Return the spin [rad/s] at which a cube turns by one radian while the launch moves it by its side."""
    return float(found.attrs["speed"]) / scenes.from_mapping(scene_of(found)).cube.side
