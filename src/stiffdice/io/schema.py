"""The format of our files as tables. From them follow the layout of written files, the check of read ones
(`problems`), and the tables of docs/FORMAT.md (`make docs`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.structure_check import FORMAT_VERSION

# How much a reader may count on something.
REQUIRED, RECOMMENDED, OPTIONAL = "required", "recommended", "optional"

TEXT, WHOLE, NUMBER = "text", "whole number", "number"
COORDINATE, ENUM, LABELS = "coordinate", "enum", "coordinate, enum"


class Attribute(NamedTuple):
    """A global attribute. type: TEXT, WHOLE or NUMBER. what: it says, for docs/FORMAT.md."""

    type: str
    what: str
    need: str = REQUIRED


class Variable(NamedTuple):
    """A variable. type: as NumPy writes it without byte order. role: COORDINATE, ENUM, LABELS (both) or none.

    note: what docs/FORMAT.md adds to the long_name. since: version of the format from which on it is there.
    """

    dimensions: tuple[str, ...]
    type: str
    long_name: str
    units: str = "1"
    role: str = ""
    note: str = ""
    need: str = REQUIRED
    since: str = "1.2"


class Kind(NamedTuple):
    """A kind of file: what it has besides what every file has."""

    attributes: Mapping[str, Attribute]
    variables: Mapping[str, Variable]


ATTRIBUTES = {
    "Conventions": Attribute(TEXT, "`CF-1.11`"),
    "title": Attribute(TEXT, "of what, in words"),
    "format_version": Attribute(TEXT, f"of this page: `{FORMAT_VERSION}`"),
    "kind": Attribute(TEXT, "`run`, `shard`, `sweep`, `frontier`, `experiment`, `timing` or `bench`"),
    "stiffdice_version": Attribute(TEXT, "of the package that wrote it"),
    "libraries": Attribute(
        TEXT, "versions of NumPy, numba, LLVM, h5py, h5netcdf, xarray: `name version; name version`"
    ),
    "code_digest": Attribute(
        TEXT, "SHA-256 of the source that the numbers depend on (each module named and all it imports)"
    ),
    "scene": Attribute(TEXT, "the physical problem, as JSON: every key, defaults resolved"),
    "scene_digest": Attribute(TEXT, "SHA-256 of the scene's canonical JSON (keys sorted, no blanks)"),
    "config": Attribute(
        TEXT,
        "the request, as JSON: model, scheme, steps, members, seed, grid, ... and for experiments the options given",
    ),
    "config_digest": Attribute(TEXT, "SHA-256 of that text"),
    "model": Attribute(TEXT, "`vertical`, `sliding`, `tumbling`, `flying`; in experiments also `case` or `all`"),
    "scheme": Attribute(TEXT, "the time-stepping scheme; of an outside engine, its own"),
    "formula": Attribute(TEXT, "contact law and one step of the scheme, as formulas"),
    "history": Attribute(TEXT, "by which version it was made; no time", RECOMMENDED),
    "source": Attribute(TEXT, "how: CF's word for it", RECOMMENDED),
    "references": Attribute(TEXT, "what it is about", RECOMMENDED),
}

_SIMULATOR = {
    "simulator": Attribute(TEXT, "`stiffdice`, or the engine"),
    "simulator_version": Attribute(TEXT, "its name and version"),
    "model_reason": Attribute(TEXT, "why this model, where `auto` was requested", RECOMMENDED),
}
_CRITERIA = "criteria of the run, `name: measure <= limit; ...`"
_HOP_HEIGHT = Attribute(
    NUMBER,
    "height that a rebound must reach to be judged by `apex`, in the unit of `hop_height_units` (m)",
    RECOMMENDED,
)
_OF_RUNS = {
    **_SIMULATOR,
    "seed": Attribute(WHOLE, "of the jitter of the scan"),
    "early_stop": Attribute(WHOLE, "1 if a run ends once all criteria are decided, else 0"),
    "scene_note": Attribute(TEXT, "says that contact law and stiffness are the cell's", RECOMMENDED),
    "criteria": Attribute(TEXT, f"{_CRITERIA}; only where runs stop early", OPTIONAL),
    "horizon": Attribute(NUMBER, "until when `trajectory` compares, in the unit of `horizon_units` (s)", OPTIONAL),
    "hop_height": _HOP_HEIGHT,
}
_JUDGED = {
    "members": Attribute(WHOLE, "number of members of a cell"),
    "runs_digest": Attribute(
        TEXT, "SHA-256 of all runs of the sweep, however they are dealt to shards (`io/content_digest.py`)"
    ),
    "judging_code_digest": Attribute(TEXT, "SHA-256 of the source that judged"),
}
_MACHINE = {
    "machine_processor": Attribute(
        TEXT,
        "what the times were taken on; with `machine_cores`, `machine_system`, `machine_load_1_minute`, `versions`",
    ),
    "measured_at": Attribute(TEXT, "when, UTC"),
}

_TIME, _PLACE, _RUN, _CELL = ("time",), ("time", "axis"), ("cell", "member"), ("cell",)
_EDGES, _FIT = ("contact", "criterion", "stiffness"), ("contact", "criterion", "edge")
_SCAN = ("criterion", "cell")

_CELLS = {
    "contact": Variable(_CELL, "i1", "contact law", role=LABELS),
    "stiffness": Variable(_CELL, "f8", "ground stiffness", "kg s-2", role=COORDINATE, note="per node"),
    "steps": Variable(_CELL, "i8", "number of time steps", role=COORDINATE),
    "omega_h": Variable(_CELL, "f8", "contact frequency of a flat landing times step size", role=COORDINATE),
}
_CRITERION = Variable(("criterion",), "i1", "criterion", role=LABELS)
_TOLERANCE = Variable(("criterion",), "f8", "tolerance of the criterion")

# Of a run, in its own file without dimensions. The long_name of a measure is its criterion's.
_OUTCOME = {
    "touchdown_phase": Variable(
        _RUN, "f8", "phase of the first touch-down within its time step", note="NaN if there is none"
    ),
    "verdict": Variable(_RUN, "i1", "verdict", role=ENUM, note="the gravest of the criteria broken and of `ending`"),
    "ending": Variable(
        _RUN,
        "i1",
        "how the run ended whatever it was asked, passed if well",
        role=ENUM,
        note="a run that did not end well passes no criterion",
        since="1.3",
    ),
    "steps_done": Variable(_RUN, "i8", "steps done when the run ended"),
}
_OUT_OF_RANGE = Variable(_RUN, "f8", "1 if a number left the range of doubles")

_RUN_VARIABLES = {
    "step": Variable(_TIME, "i8", "number of time steps done"),
    "position": Variable(_PLACE, "f8", "centre of mass", "m"),
    "velocity": Variable(_PLACE, "f8", "velocity of it", "m s-1"),
    "kinetic_energy": Variable(_TIME, "f8", "kinetic energy, of translation and rotation", "J"),
    "potential_energy": Variable(_TIME, "f8", "potential energy m g z of the centre of mass", "J"),
    "elastic_energy": Variable(_TIME, "f8", "energy in the ground's springs, S d²/2 per node", "J"),
    "energy_paper": Variable(_TIME, "f8", "kinetic and potential energy, the paper's total", "J"),
    "mechanical_energy": Variable(
        _TIME,
        "f8",
        "kinetic, potential and elastic energy, the velocity taken at the time of the place",
        "J",
        need=RECOMMENDED,
    ),
    "angular_momentum": Variable(
        _PLACE, "f8", "angular momentum about the centre", "kg m2 s-1", note="where the cube turns", need=OPTIONAL
    ),
    "node_offset": Variable(
        ("time", "node", "axis"), "f8", "node relative to the centre", "m", note="where the cube turns", need=OPTIONAL
    ),
    **{name: part._replace(dimensions=()) for name, part in {"out_of_range": _OUT_OF_RANGE, **_OUTCOME}.items()},
    "touchdown_phase": _OUTCOME["touchdown_phase"]._replace(dimensions=(), need=RECOMMENDED),
    "evaluations": Variable((), "i8", "evaluations of the force", need=RECOMMENDED),
    "time": Variable(_TIME, "f8", "time since the launch", "s", role=COORDINATE),
    "axis": Variable(("axis",), "i1", "Cartesian axis, z up", role=LABELS, note="x, y, z"),
    "node": Variable(("node",), "i1", "node, numbered as in cube.m", role=COORDINATE, note="1 to 8", need=OPTIONAL),
}

_FRONTIER_VARIABLES = {
    "first_pass": Variable(_EDGES, "f8", "fewest steps at which every member passes", note="NaN if none"),
    "last_fail": Variable(_EDGES, "f8", "most steps at which a member still fails", note="NaN if none"),
    "steps_needed": Variable(
        _EDGES, "f8", "fewest scanned steps from which on every member passes", note="NaN if none"
    ),
    "flips": Variable(_EDGES, "f8", "changes between pass and fail along the scan"),
    "limit": Variable(("stiffness",), "f8", "steps at the linear stability limit, omega h = 2"),
    "pass_fraction": Variable(_SCAN, "f8", "share of a cell's members that pass the criterion"),
    "pass_fraction_low": Variable(_SCAN, "f8", "lower end of its 95 % confidence interval", note="Wilson's"),
    "pass_fraction_high": Variable(_SCAN, "f8", "upper end of its 95 % confidence interval"),
    "tolerance": _TOLERANCE,
    "exponent": Variable(_FIT, "f8", "exponent of the power law", note="NaN with fewer than three points"),
    "exponent_error": Variable(_FIT, "f8", "standard error of it"),
    "factor": Variable(_FIT, "f8", "steps at stiffness 1 kg s-2 by the power law"),
    "scatter": Variable(_FIT, "f8", "standard deviation of log10 of the steps about the power law"),
    "centre": Variable(_FIT, "f8", "geometric mean of the stiffnesses in the fit", "kg s-2"),
    "points": Variable(_FIT, "f8", "number of stiffnesses in the fit"),
    "contact": Variable(("contact",), "i1", "contact law", role=LABELS),
    "criterion": _CRITERION,
    "edge": Variable(("edge",), "i1", "edge of a criterion", role=LABELS, note="first_pass, last_fail, steps_needed"),
    "stiffness": Variable(("stiffness",), "f8", "ground stiffness", "kg s-2", role=COORDINATE, note="per node"),
    **{f"cell_{name}": part for name, part in _CELLS.items()},
}

KINDS: dict[str, Kind] = {
    "run": Kind(
        {
            **_SIMULATOR,
            "steps": Attribute(WHOLE, "number of time steps of the run"),
            "step_size": Attribute(NUMBER, "duration/steps, in the unit of `step_size_units` (s)"),
            "omega_h": Attribute(NUMBER, "contact frequency of a flat landing times step size"),
            "criteria": Attribute(TEXT, _CRITERIA),
            "tolerance": Attribute(NUMBER, "of the error, for a scheme that controls its own", RECOMMENDED),
            "hop_height": _HOP_HEIGHT,
            "scene_derived": Attribute(
                TEXT,
                "values of the scene that were given in other words (a side for a radius, a restitution for a damping),"
                " and from what; the values themselves are in `scene`",
                OPTIONAL,
            ),
        },
        _RUN_VARIABLES,
    ),
    "shard": Kind(
        _OF_RUNS,
        {
            "out_of_range": _OUT_OF_RANGE,
            "energy_ratio": Variable(_RUN, "f8", "measure of criterion energy"),
            "apex_ratio": Variable(_RUN, "f8", "measure of criterion apex"),
            "restitution_error": Variable(_RUN, "f8", "measure of criterion restitution"),
            "trajectory_error": Variable(_RUN, "f8", "measure of criterion trajectory"),
            **_OUTCOME,
            "steps_computed": Variable(_RUN, "i8", "steps computed one by one, not many at once"),
            "decided": Variable(
                (*_RUN, "criterion"), "i8", "step that decided the criterion, 0 if none before the end"
            ),
            **_CELLS,
            "member": Variable(
                ("member",), "i4", "member: number k of n is launched k/n of a time step late", role=COORDINATE
            ),
            "criterion": _CRITERION,
        },
    ),
    "sweep": Kind(
        {**_OF_RUNS, **_JUDGED},
        {
            "failing": Variable(_SCAN, "i4", "number of members that fail the criterion"),
            "verdicts": Variable(("cell", "verdict"), "i4", "number of members that ended with a verdict"),
            "steps_computed": Variable(_CELL, "i8", "steps computed one by one, of all members"),
            "tolerance": _TOLERANCE,
            **_CELLS,
            "criterion": _CRITERION,
            "verdict": Variable(("verdict",), "i1", "verdict", role=LABELS),
        },
    ),
    "frontier": Kind(
        {
            **_OF_RUNS,
            **_JUDGED,
            "analysis_code_digest": Attribute(TEXT, "SHA-256 of the source that found the edges"),
        },
        _FRONTIER_VARIABLES,
    ),
    "experiment": Kind({}, {}),
    "timing": Kind(_MACHINE, {}),
    "bench": Kind(
        {**_MACHINE, "bench_code_digest": Attribute(TEXT, "SHA-256 of the benchmarks' source")},
        {"round": Variable(("round",), "i4", "round, in which the cases take turns", role=COORDINATE)},
    ),
}


def attributes_of(kind: str, name: str, meanings: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the attributes of a variable; meanings: the words of an enum."""
    variable = KINDS[kind].variables[name]
    if meanings is not None:
        return enum_attributes(variable.long_name, meanings)
    return {"long_name": variable.long_name, "units": variable.units}


def dataset(
    kind: str, values: Mapping[str, Any], meanings: Mapping[str, Sequence[str]], attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Return a dataset of one kind.

    values: of each variable by name, in the order in which they are stored; a tuple (dimensions, values, attributes)
    for one that the table does not have. meanings: the words of enums, by name. attributes: of the file.
    """
    known = KINDS[kind].variables
    variables = {
        name: given
        if isinstance(given, tuple)
        else (known[name].dimensions, given, attributes_of(kind, name, meanings.get(name)))
        for name, given in values.items()
    }
    coordinates = {name: variables.pop(name) for name in values if name in known and COORDINATE in known[name].role}
    return xr.Dataset(variables, coordinates, attributes)


def problems(dataset: xr.Dataset) -> list[str]:
    """Return what of a file is not as its kind demands, a line each; none for files older than kinds.

    What all files have in common is checked when they are read: structure, units, enums, the scene's digest.
    """
    version = _numbers(dataset.attrs.get("format_version", FORMAT_VERSION))
    if version < _numbers("1.2"):
        return []
    kind = dataset.attrs.get("kind")
    if kind not in KINDS:
        return [f"attribute kind = {kind}: allowed is {' or '.join(KINDS)}"]
    return [
        *_wrong_attributes(dataset, {**ATTRIBUTES, **KINDS[kind].attributes}),
        *_wrong_variables(dataset, KINDS[kind].variables, version),
        *_wrong_config(dataset),
    ]


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def _wrong_attributes(dataset: xr.Dataset, known: Mapping[str, Attribute]) -> Iterator[str]:
    for name, attribute in known.items():
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


def _wrong_variables(dataset: xr.Dataset, known: Mapping[str, Variable], version: tuple[int, ...]) -> Iterator[str]:
    for name, variable in known.items():
        if name not in dataset.variables:
            if variable.need == REQUIRED and version >= _numbers(variable.since):
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
