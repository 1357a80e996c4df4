"""What a file holds, for people and for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from stiffdice.errors import printable
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.plain_dataset import PlainDataset
from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import finite
from stiffdice.simulation.outcome import Verdict

if TYPE_CHECKING:
    import xarray as xr

_LONG = (
    *("title", "Conventions", "history", "source", "references", "scene"),
    "verdict_text",  # of older files; the sentence follows from the verdict
    *("scene_digest", "config_digest", "code_digest", "runs_digest", "judging_code_digest", "analysis_code_digest"),
)

# Of a run's ledger, in this order; and of its bounces, of which so many are shown.
_BOOKED = ("launch_energy", "damping_work", "drag_work", "friction_work", "scheme_work", "end_energy")
_OF_BOUNCES = tuple(f"bounce_{part}" for part in ("start", "damping_work", "drag_work", "friction_work", "scheme_work"))
SHOWN = 10

# How the names end of what a verdict rests on.
_MEASURES = ("_ratio", "_error", "_phase", "deepest_contact", "meetings")


def as_text(dataset: PlainDataset | xr.Dataset, name: str) -> str:
    """Return a page on a dataset: what it is, its verdict, its scene, its variables with units."""
    attributes, variables = dataset.attrs, dataset.variables
    lines = [f"{name}: {attributes.get('title', 'untitled')}", ""]
    lines += [f"  {key}: {_plain(value)}" for key, value in attributes.items() if key not in _LONG]
    lines += ["", "verdict", *_verdicts(dataset)]
    if "scene" in attributes:
        scene = yaml.safe_dump(json.loads(attributes["scene"]), sort_keys=False, default_flow_style=None, width=100)
        lines += ["", "scene", *(f"  {line}" for line in scene.splitlines())]
    dimensions = dict.fromkeys((*_BOOKED, "bounce_count"), ()) | dict.fromkeys(_OF_BOUNCES, ("bounce",))
    if all(name in variables and variables[name].dims == dims for name, dims in dimensions.items()):
        lines += ["", "energy ledger of the run", *_ledger(dataset)]
    if booked := {name: part for name, part in variables.items() if str(name).startswith("body_")}:
        lines += ["", "energy of each cube since the launch [J]", *_ledger_of_bodies(booked)]
    rows = []
    for key, variable in variables.items():
        shape = zip(variable.values.shape, variable.dims, strict=True)
        sizes = " × ".join(f"{size} {dim}" for size, dim in shape) or "one value"
        rows.append((str(key), sizes, f"[{variable.attrs.get('units', '?')}]", variable.attrs.get("long_name", "")))
    lines += ["", "variables", *aligned(rows)]
    return "\n".join(map(printable, lines))


def _plain(value: Any) -> Any:
    """Return an attribute as plain data."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _verdicts(dataset: PlainDataset | xr.Dataset) -> list[str]:
    counts = _verdict_counts(dataset)
    total = sum(counts.values())
    if not total:
        return ["  none: this file holds no runs"]
    if total > 1:
        return [f"  {name}: {count} of {total} runs ({count / total:.1%})" for name, count in counts.items()]
    (name,) = counts
    measures = []
    for measure, variable in dataset.data_vars.items():
        if not variable.dims and str(measure).endswith(_MEASURES):
            unit = "" if variable.attrs["units"] == "1" else f" {variable.attrs['units']}"
            found = f" = {variable.values:.6g}{unit}: {variable.attrs['long_name']}"
            none = measure == "apex_ratio" and not variable.values
            measures.append(f"  {measure}{': no rebound to compare with the one before' if none else found}")
    # A later version may have verdicts of other names.
    return [f"  {Verdict[name.upper()].sentence if name.upper() in Verdict.__members__ else name}", *measures]


def _ledger(dataset: PlainDataset | xr.Dataset) -> list[str]:
    """Return where the energy of a run went, a line each."""
    variables = dataset.variables
    bounces = int(variables["bounce_count"].values)
    lines = [f"  {name:14} {variables[name].values:+12.6g} J" for name in _BOOKED]
    lines.append(f"  in {bounces} bounces and the flights between them; the first of them:")
    units = [f"{name.removeprefix('bounce_')} [{'s' if name == 'bounce_start' else 'J'}]" for name in _OF_BOUNCES]
    values = zip(*(variables[name].values[:SHOWN] for name in _OF_BOUNCES), strict=True)
    return [*lines, *aligned([units, *([f"{value:.6g}" for value in row] for row in values)])]


def _ledger_of_bodies(booked: Mapping[Any, Any]) -> list[str]:
    """Return what was booked of each body until the end, a line for each force."""
    rows = [["", "cube 0", "cube 1"]]
    for name, variable in booked.items():
        if variable.dims == ("time", "cube") and variable.values.shape[1] == 2:
            first, last = variable.values[0], variable.values[-1]
            rows.append([str(name).removeprefix("body_"), *(f"{value:+.6g}" for value in last - first)])
    return list(aligned(rows))


def _verdict_counts(dataset: PlainDataset | xr.Dataset) -> dict[str, int]:
    """Return how many runs ended with each verdict, those that none ended with left out; nothing if it holds no runs.

    In a judged sweep `verdict` is a coordinate, and how many runs ended so in each cell is in `verdicts`.
    """
    variables = dataset.variables
    verdict, counted = variables.get("verdict"), variables.get("verdicts")
    if verdict is None or "flag_meanings" not in verdict.attrs:
        return {}
    names = meanings_of(verdict)
    if "verdict" not in dataset.sizes:
        counts = np.bincount(verdict.values.astype(int).ravel(), minlength=len(names))
    elif counted is not None:
        others = tuple(axis for axis, name in enumerate(counted.dims) if name != "verdict")
        counts = counted.values.sum(axis=others)
        names = [names[value] for value in verdict.values]
    else:
        return {}
    return {name: int(count) for name, count in zip(names, counts, strict=True) if count}


def as_json(dataset: PlainDataset | xr.Dataset) -> str:
    """Return the same as JSON: attributes, sizes, verdicts and variables."""
    attributes = {key: _plain(value) for key, value in dataset.attrs.items()}
    if "scene" in attributes:
        attributes["scene"] = json.loads(attributes["scene"])
    content = {
        "attributes": attributes,
        "sizes": dict(dataset.sizes),
        "values": {
            name: finite(float(variable.values)) for name, variable in dataset.data_vars.items() if not variable.dims
        },
        "verdicts": _verdict_counts(dataset),
        "variables": {
            name: {"dimensions": variable.dims, "units": variable.attrs.get("units")}
            for name, variable in dataset.variables.items()
        },
    }
    return json.dumps(content, indent=2)
