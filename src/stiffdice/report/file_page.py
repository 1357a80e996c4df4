"""What a file holds, for people and for programs."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import xarray as xr
import yaml

from stiffdice.errors import printable
from stiffdice.io.cf_enums import meanings_of
from stiffdice.simulation.outcome import Verdict

_LONG = (
    *("title", "Conventions", "history", "source", "references", "scene"),
    "verdict_text",  # of older files; the sentence follows from the verdict
    *("scene_digest", "config_digest", "code_digest", "runs_digest", "judging_code_digest", "analysis_code_digest"),
)


def as_text(dataset: xr.Dataset, name: str) -> str:
    """Return a page on a dataset: what it is, its verdict, its scene, its variables with units."""
    attributes = dataset.attrs
    lines = [f"{name}: {attributes.get('title', 'untitled')}", ""]
    lines += [f"  {key}: {_plain(value)}" for key, value in attributes.items() if key not in _LONG]
    lines += ["", "verdict", *_verdicts(dataset)]
    if "scene" in attributes:
        scene = yaml.safe_dump(json.loads(attributes["scene"]), sort_keys=False, default_flow_style=None, width=100)
        lines += ["", "scene", *(f"  {line}" for line in scene.splitlines())]
    if _has_ledger(dataset):
        lines += ["", "energy ledger of the run", *_ledger(dataset)]
    lines += ["", "variables", *_variables(dataset)]
    return "\n".join(map(printable, lines))


def _plain(value: Any) -> Any:
    """Return an attribute as plain data."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _has_verdicts(dataset: xr.Dataset) -> bool:
    return "verdict" in dataset and "flag_meanings" in dataset.verdict.attrs


def _verdicts(dataset: xr.Dataset) -> list[str]:
    counts = _verdict_counts(dataset)
    if not counts:
        return ["  none: this file holds no runs"]
    total = sum(counts.values())
    if total == 1:
        measures = [
            _measured(str(name), variable)
            for name, variable in dataset.data_vars.items()
            if variable.ndim == 0 and str(name).endswith(("_ratio", "_error", "_phase"))
        ]
        return [f"  {_sentence(next(iter(counts)))}", *measures]
    return [f"  {name}: {count} of {total} runs ({count / total:.1%})" for name, count in counts.items()]


def _sentence(name: str) -> str:
    """Return a verdict as a sentence; the name itself of one that a later version has."""
    return Verdict[name.upper()].sentence if name.upper() in Verdict.__members__ else name


def _measured(name: str, variable: xr.DataArray) -> str:
    if name == "apex_ratio" and not float(variable):
        return f"  {name}: no rebound to compare with the one before"
    return f"  {name} = {float(variable):.6g}: {variable.attrs['long_name']}"


SHOWN = 10  # bounces of a ledger

# Of a run's ledger, in this order.
_BOOKED = ("launch_energy", "damping_work", "drag_work", "friction_work", "scheme_work", "end_energy")
_OF_BOUNCES = (
    "bounce_start",
    *(f"bounce_{part}" for part in ("damping_work", "drag_work", "friction_work", "scheme_work")),
)


def _has_ledger(dataset: xr.Dataset) -> bool:
    single = all(name in dataset and dataset[name].ndim == 0 for name in (*_BOOKED, "bounce_count"))
    return single and all(name in dataset and dataset[name].dims == ("bounce",) for name in _OF_BOUNCES)


def _ledger(dataset: xr.Dataset) -> list[str]:
    """Return where the energy of a run went, a line each."""
    lines = [f"  {name:14} {float(dataset[name]):+12.6g} J" for name in _BOOKED]
    lines.append(f"  in {int(dataset.bounce_count)} bounces and the flights between them; the first of them:")
    parts = ("damping_work", "drag_work", "friction_work", "scheme_work")
    lines.append(f"  {'start [s]':>16}" + "".join(f"{part + ' [J]':>18}" for part in parts))
    for k in range(min(SHOWN, dataset.sizes["bounce"])):
        works = [float(dataset[f"bounce_{part}"][k]) for part in parts]
        lines.append(f"  {float(dataset.bounce_start[k]):16.6g}" + "".join(f"{work:+18.6g}" for work in works))
    return lines


def _verdict_counts(dataset: xr.Dataset) -> dict[str, int]:
    """Return how many runs ended with each verdict, those that none ended with left out; nothing if it holds no runs.

    In a judged sweep `verdict` is a coordinate, and how many runs ended so in each cell is in `verdicts`.
    """
    if not _has_verdicts(dataset):
        return {}
    names = meanings_of(dataset.verdict)
    if "verdict" not in dataset.dims:
        counts = np.bincount(dataset.verdict.values.astype(int).ravel(), minlength=len(names))
    elif "verdicts" in dataset:
        counts = dataset.verdicts.sum([dim for dim in dataset.verdicts.dims if dim != "verdict"]).values
        names = [names[value] for value in dataset.verdict.values]
    else:
        return {}
    return {name: int(count) for name, count in zip(names, counts, strict=True) if count}


def _variables(dataset: xr.Dataset) -> list[str]:
    rows = []
    for name, variable in dataset.variables.items():
        sizes = " × ".join(f"{size} {dim}" for dim, size in variable.sizes.items()) or "one value"
        rows.append((str(name), sizes, f"[{variable.attrs.get('units', '?')}]", variable.attrs.get("long_name", "")))
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    return [
        "  " + "  ".join([*(part.ljust(width) for part, width in zip(row, widths, strict=False)), row[3]])
        for row in rows
    ]


def _number(variable: xr.DataArray) -> float | None:
    """Return a single value; none where it is not a number that JSON has."""
    value = float(variable)
    return value if math.isfinite(value) else None


def as_json(dataset: xr.Dataset) -> str:
    """Return the same as JSON: attributes, sizes, verdicts and variables."""
    attributes = {key: _plain(value) for key, value in dataset.attrs.items()}
    if "scene" in attributes:
        attributes["scene"] = json.loads(attributes["scene"])
    content = {
        "attributes": attributes,
        "sizes": {str(name): size for name, size in dataset.sizes.items()},
        "values": {str(name): _number(variable) for name, variable in dataset.data_vars.items() if variable.ndim == 0},
        "verdicts": _verdict_counts(dataset),
        "variables": {
            str(name): {"dimensions": list(variable.dims), "units": variable.attrs.get("units")}
            for name, variable in dataset.variables.items()
        },
    }
    return json.dumps(content, indent=2)
