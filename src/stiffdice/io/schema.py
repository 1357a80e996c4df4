"""The format of our files, as a table: which attributes and variables each kind of file has (docs/FORMAT.md)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

# How much a reader may count on something.
REQUIRED, RECOMMENDED, OPTIONAL = "required", "recommended", "optional"

TEXT, WHOLE, NUMBER = "text", "whole number", "number"


class Attribute(NamedTuple):
    """A global attribute: TEXT, WHOLE or NUMBER."""

    type: str
    need: str = REQUIRED


class Variable(NamedTuple):
    """A variable: its dimensions, its type as NumPy writes it without byte order, its unit."""

    dimensions: tuple[str, ...]
    type: str
    units: str = "1"
    need: str = REQUIRED


class Kind(NamedTuple):
    """A kind of file: what it has besides what every file has."""

    attributes: Mapping[str, Attribute]
    variables: Mapping[str, Variable]


# Of every file.
ATTRIBUTES = {
    "Conventions": Attribute(TEXT),
    "title": Attribute(TEXT),
    "format_version": Attribute(TEXT),
    "kind": Attribute(TEXT),
    "stiffdice_version": Attribute(TEXT),
    "libraries": Attribute(TEXT),
    "code_digest": Attribute(TEXT),
    "scene": Attribute(TEXT),
    "scene_digest": Attribute(TEXT),
    "config": Attribute(TEXT),
    "config_digest": Attribute(TEXT),
    "model": Attribute(TEXT),
    "scheme": Attribute(TEXT),
    "formula": Attribute(TEXT),
    "history": Attribute(TEXT, RECOMMENDED),
    "source": Attribute(TEXT, RECOMMENDED),
    "references": Attribute(TEXT, RECOMMENDED),
}

_SIMULATOR = {
    "simulator": Attribute(TEXT),
    "simulator_version": Attribute(TEXT),
    "model_reason": Attribute(TEXT, RECOMMENDED),
}
_OF_RUNS = {
    **_SIMULATOR,
    "seed": Attribute(WHOLE),
    "early_stop": Attribute(WHOLE),
    "scene_note": Attribute(TEXT, RECOMMENDED),
    "criteria": Attribute(TEXT, OPTIONAL),
    "horizon": Attribute(NUMBER, OPTIONAL),
    "hop_height": Attribute(NUMBER, RECOMMENDED),
}
_JUDGED = {
    "members": Attribute(WHOLE),
    "runs_digest": Attribute(TEXT),
    "judging_code_digest": Attribute(TEXT),
}

_TIME, _PLACE, _RUN, _CELL = ("time",), ("time", "axis"), ("cell", "member"), ("cell",)
_EDGES, _FIT = ("contact", "criterion", "stiffness"), ("contact", "criterion", "edge")
_SCAN = ("criterion", "cell")

_CELLS = {
    "contact": Variable(_CELL, "i1"),
    "stiffness": Variable(_CELL, "f8", "kg s-2"),
    "steps": Variable(_CELL, "i8"),
    "omega_h": Variable(_CELL, "f8"),
    "criterion": Variable(("criterion",), "i1"),
}

KINDS: dict[str, Kind] = {
    "run": Kind(
        {
            **_SIMULATOR,
            "steps": Attribute(WHOLE),
            "step_size": Attribute(NUMBER),
            "omega_h": Attribute(NUMBER),
            "criteria": Attribute(TEXT),
            "tolerance": Attribute(NUMBER, RECOMMENDED),
            "hop_height": Attribute(NUMBER, RECOMMENDED),
            "scene_derived": Attribute(TEXT, OPTIONAL),
        },
        {
            "time": Variable(_TIME, "f8", "s"),
            "axis": Variable(("axis",), "i1"),
            "step": Variable(_TIME, "i8"),
            "position": Variable(_PLACE, "f8", "m"),
            "velocity": Variable(_PLACE, "f8", "m s-1"),
            "kinetic_energy": Variable(_TIME, "f8", "J"),
            "potential_energy": Variable(_TIME, "f8", "J"),
            "elastic_energy": Variable(_TIME, "f8", "J"),
            "energy_paper": Variable(_TIME, "f8", "J"),
            "mechanical_energy": Variable(_TIME, "f8", "J", RECOMMENDED),
            "verdict": Variable((), "i1"),
            "ending": Variable((), "i1", need=RECOMMENDED),
            "steps_done": Variable((), "i8"),
            "out_of_range": Variable((), "f8"),
            "evaluations": Variable((), "i8", need=RECOMMENDED),
            "touchdown_phase": Variable((), "f8", need=RECOMMENDED),
            "node": Variable(("node",), "i1", need=OPTIONAL),
            "angular_momentum": Variable(_PLACE, "f8", "kg m2 s-1", OPTIONAL),
            "node_offset": Variable(("time", "node", "axis"), "f8", "m", OPTIONAL),
        },
    ),
    "shard": Kind(
        _OF_RUNS,
        {
            **_CELLS,
            "member": Variable(("member",), "i4"),
            "out_of_range": Variable(_RUN, "f8"),
            "energy_ratio": Variable(_RUN, "f8"),
            "apex_ratio": Variable(_RUN, "f8"),
            "restitution_error": Variable(_RUN, "f8"),
            "trajectory_error": Variable(_RUN, "f8"),
            "touchdown_phase": Variable(_RUN, "f8"),
            "verdict": Variable(_RUN, "i1"),
            "ending": Variable(_RUN, "i1", need=RECOMMENDED),
            "steps_done": Variable(_RUN, "i8"),
            "steps_computed": Variable(_RUN, "i8"),
            "decided": Variable((*_RUN, "criterion"), "i8"),
        },
    ),
    "sweep": Kind(
        {**_OF_RUNS, **_JUDGED},
        {
            **_CELLS,
            "failing": Variable(_SCAN, "i4"),
            "verdict": Variable(("verdict",), "i1"),
            "verdicts": Variable(("cell", "verdict"), "i4"),
            "steps_computed": Variable(_CELL, "i8"),
            "tolerance": Variable(("criterion",), "f8"),
        },
    ),
    "frontier": Kind(
        {**_OF_RUNS, **_JUDGED, "analysis_code_digest": Attribute(TEXT)},
        {
            "contact": Variable(("contact",), "i1"),
            "criterion": Variable(("criterion",), "i1"),
            "stiffness": Variable(("stiffness",), "f8", "kg s-2"),
            "edge": Variable(("edge",), "i1"),
            **{name: Variable(_EDGES, "f8") for name in ("first_pass", "last_fail", "steps_needed", "flips")},
            "limit": Variable(("stiffness",), "f8"),
            "tolerance": Variable(("criterion",), "f8"),
            **{f"pass_fraction{end}": Variable(_SCAN, "f8") for end in ("", "_low", "_high")},
            **{name: Variable(_FIT, "f8") for name in ("exponent", "exponent_error", "factor", "scatter", "points")},
            "centre": Variable(_FIT, "f8", "kg s-2"),
            **{f"cell_{name}": _CELLS[name] for name in ("contact", "stiffness", "steps", "omega_h")},
        },
    ),
    "experiment": Kind({}, {}),
    "timing": Kind({"machine_processor": Attribute(TEXT), "measured_at": Attribute(TEXT)}, {}),
    "bench": Kind(
        {"machine_processor": Attribute(TEXT), "measured_at": Attribute(TEXT), "bench_code_digest": Attribute(TEXT)},
        {"round": Variable(("round",), "i4")},
    ),
}

# Files of earlier versions say less of themselves.
_WITHOUT_KIND = ("1.0", "1.1")


def problems(dataset: xr.Dataset) -> list[str]:
    """Return what of a file is not as its kind asks, a line each; none for files of before there were kinds.

    What all files have in common, reading checks: structure, units, enums, the scene against its digest.
    """
    if dataset.attrs.get("format_version") in _WITHOUT_KIND:
        return []
    kind = dataset.attrs.get("kind")
    if kind not in KINDS:
        return [f"attribute kind = {kind}: allowed is {' or '.join(KINDS)}"]
    return [
        *_missing_attributes(dataset, {**ATTRIBUTES, **KINDS[kind].attributes}),
        *_missing_variables(dataset, KINDS[kind].variables),
        *_wrong_config(dataset),
    ]


def _missing_attributes(dataset: xr.Dataset, asked: Mapping[str, Attribute]) -> Iterator[str]:
    for name, attribute in asked.items():
        if name not in dataset.attrs:
            if attribute.need == REQUIRED:
                yield f"attribute {name} is missing"
        elif not _is(attribute.type, dataset.attrs[name]):
            yield f"attribute {name} = {str(dataset.attrs[name])[:40]}: allowed is a {attribute.type}"


def _is(kind: str, value: Any) -> bool:
    if kind == TEXT:
        return isinstance(value, str)
    if np.ndim(value) or np.asarray(value).dtype.kind not in ("i" if kind == WHOLE else "if"):
        return False
    return bool(np.isfinite(value))


def _missing_variables(dataset: xr.Dataset, asked: Mapping[str, Variable]) -> Iterator[str]:
    for name, variable in asked.items():
        if name not in dataset.variables:
            if variable.need == REQUIRED:
                yield f"variable {name} is missing"
            continue
        found = dataset[name]
        if found.dims != variable.dimensions:
            yield f"{name} has dimensions ({_listed(found.dims)}): allowed are ({_listed(variable.dimensions)})"
        if found.dtype.str[1:] != variable.type:
            yield f"{name} is of type {found.dtype.str[1:]}: allowed is {variable.type}"
        if found.attrs.get("units") != variable.units:
            yield f"{name} has units {found.attrs.get('units')}: allowed is {variable.units}"


def _listed(names: tuple[Any, ...]) -> str:
    return ", ".join(map(str, names))


def _wrong_config(dataset: xr.Dataset) -> Iterator[str]:
    text = dataset.attrs.get("config")
    if isinstance(text, str) and hashlib.sha256(text.encode()).hexdigest() != dataset.attrs.get("config_digest"):
        yield "attribute config is not that of config_digest"
