"""The figures that a file of ours can be drawn as, by its kind; which they are follows from the catalogue."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.scene import validation
from stiffdice.study import starter
from stiffdice.study.catalogue import DRAWINGS

ANIMATION = "animation"
_DPI = 150
# Of what has nodes, the way that it takes first; of a sweep; the other drawings of sweeps take several.
_OF_BODIES = ("cube-end", "cube-start", "cube-middle", ANIMATION)
_OF_PATHS = ("position", "energy")
_OF_SWEEPS = ("frontier", "stability-map", "pass-fraction")
_SWEPT = ("sweep", "frontier")


def drawings_of(found: xr.Dataset) -> list[str]:
    """Return the drawings of a file by their names in studies, the one that says most first; none if it has none."""
    kind = found.attrs.get("kind")
    if kind in ("run", "pair"):
        paths = _OF_PATHS if kind == "run" else ()
        return [*paths, *(_OF_BODIES if "node_offset" in found else ())]
    if kind in _SWEPT:
        one = len(set(found.stiffness.values.tolist())) == 1
        return ["pass-fraction"] if one else [name for name in _OF_SWEEPS if name != "pass-fraction"]
    measure = measure_of(found)
    given = {"experiment": "experiments", "timing": "timings"}.get(str(kind))
    return [name for name, entry in DRAWINGS.items() if entry.given == given and entry.measures == measure]


def measure_of(found: xr.Dataset) -> str:
    """Return which experiment or timing made a file; empty for other kinds."""
    config = found.attrs.get("config")
    plain = json.loads(config) if isinstance(config, str) else {}
    return str(plain.get("measure", "")) if isinstance(plain, dict) else ""


def chosen(found: xr.Dataset, source: str, drawing: str | None) -> str:
    """Return the drawing of a file that is asked for, or its first; raises InputError if it has none or not this."""
    names = drawings_of(found)
    if not names:
        what = f"{found.attrs.get('kind')} {measure_of(found)}".strip()
        kinds = sorted({entry.measures for entry in DRAWINGS.values() if entry.measures})
        told = f"run, pair, sweep, frontier, and experiment or timing of {', '.join(kinds)}"
        raise InputError(f"{source}: kind = {what}: cannot be drawn; allowed is {told}")
    if drawing is None:
        return names[0]
    validation.choice(f"{source}: --draw", drawing, names)
    return drawing


def draw(found: xr.Dataset, drawing: str, target: Path) -> None:
    """Draw a file into another, whose ending says the format; raises RefusedError if it lacks what the figure shows."""
    from stiffdice.report.figures import registry

    title = str(found.attrs.get("title", target.stem))
    try:
        registry.draw(drawing, {_name(found): _drawn(found)}, title, _DPI, [str(target)])
    except (KeyError, AttributeError) as error:
        raise RefusedError(f"it has no {error}, which {drawing} shows; made by another version?") from None


def _drawn(found: xr.Dataset) -> xr.Dataset:
    """Return what figures take: of a sweep, where its edges lie."""
    if found.attrs["kind"] != "sweep":
        return found
    from stiffdice.sweep import stability_limits

    return stability_limits.find(found)


def _name(found: xr.Dataset) -> str:
    """Return the name under which a figure shows it: of a run, the reading of the paper that its physics has."""
    if found.attrs["kind"] != "run":
        return str(found.attrs["kind"])
    scene: dict[str, Any] = json.loads(found.attrs["scene"])
    return starter.preset_of(scene["ground"]["contact"], scene["cube"]["geometry"])
