"""The format of our files as tables. From them follow the layout of written files, the check of read ones
(`problems`), and the tables of docs/reference/FORMAT.md (`make docs`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.plain_dataset import PlainDataset, PlainVariable
from stiffdice.io.structure_check import FORMAT_VERSION

if TYPE_CHECKING:
    import xarray as xr

# How much a reader may count on something.
REQUIRED, RECOMMENDED, OPTIONAL = "required", "recommended", "optional"

TEXT, WHOLE, NUMBER = "text", "whole number", "number"
COORDINATE, ENUM, LABELS = "coordinate", "enum", "coordinate, enum"


class Attribute(NamedTuple):
    """A global attribute. what: it says, for docs/reference/FORMAT.md. type: TEXT, WHOLE or NUMBER."""

    what: str
    need: str = REQUIRED
    type: str = TEXT


class Variable(NamedTuple):
    """A variable. type: as NumPy writes it without byte order. role: COORDINATE, ENUM, LABELS (both) or none.

    note: what docs/reference/FORMAT.md adds to the long_name. since: version of the format from which on it is there.
    """

    dimensions: tuple[str, ...]
    long_name: str
    units: str = "1"
    type: str = "f8"
    role: str = ""
    note: str = ""
    need: str = REQUIRED
    since: str = "1.2"


class Kind(NamedTuple):
    """A kind of file: what it has besides what every file has."""

    attributes: Mapping[str, Attribute]
    variables: Mapping[str, Variable]


ATTRIBUTES = {
    "Conventions": Attribute("`CF-1.11`"),
    "title": Attribute("of what, in words"),
    "format_version": Attribute(f"of this page: `{FORMAT_VERSION}`"),
    "kind": Attribute("`run`, `pair`, `shard`, `sweep`, `frontier`, `experiment`, `timing` or `bench`"),
    "stiffdice_version": Attribute("of the package that wrote it"),
    "libraries": Attribute("versions of NumPy, numba, LLVM, h5py, h5netcdf, xarray: `name version; name version`"),
    "code_digest": Attribute("SHA-256 of the source that the numbers depend on: modules named, all they import"),
    "scene": Attribute("the physical problem, as JSON: every key, defaults resolved"),
    "scene_digest": Attribute("SHA-256 of the scene's canonical JSON (keys sorted, no blanks)"),
    "config": Attribute(
        "the request, as JSON: model, scheme, steps, members, seed, grid, …; of experiments the options"
    ),
    "config_digest": Attribute("SHA-256 of that text"),
    "model": Attribute("`vertical`, `sliding`, `tumbling`, `flying`, `pair`; in experiments also `case` or `all`"),
    "scheme": Attribute("the time-stepping scheme; of an outside engine, its own"),
    "formula": Attribute("contact law and one step of the scheme, as formulas"),
    "history": Attribute("by which version it was made; no time", RECOMMENDED),
    "source": Attribute("how: CF's word for it", RECOMMENDED),
    "references": Attribute("what it is about", RECOMMENDED),
}

_SIMULATOR = {
    "simulator": Attribute("`stiffdice`, or the engine"),
    "simulator_version": Attribute("its name and version"),
    "model_reason": Attribute("why this model, where `auto` was requested", RECOMMENDED),
}
_CRITERIA = "criteria of the run, `name: measure <= limit; ...`"
_HOP_HEIGHT = Attribute("lowest rebound that `apex` judges, in the unit of `hop_height_units` (m)", RECOMMENDED, NUMBER)
_OF_RUNS = {
    **_SIMULATOR,
    "seed": Attribute("of the jitter of the scan", type=WHOLE),
    "early_stop": Attribute("1 if a run ends once all criteria are decided, else 0", type=WHOLE),
    "scene_note": Attribute("says that contact law and stiffness are the cell's", RECOMMENDED),
    "criteria": Attribute(f"{_CRITERIA}; only where runs stop early", OPTIONAL),
    "horizon": Attribute("until when `trajectory` compares, in the unit of `horizon_units` (s)", OPTIONAL, NUMBER),
    "hop_height": _HOP_HEIGHT,
}
_JUDGED = {
    "members": Attribute("number of members of a cell", type=WHOLE),
    "runs_digest": Attribute("SHA-256 of all runs, however they are dealt to shards (`io/content_digest.py`)"),
    "judging_code_digest": Attribute("SHA-256 of the source that judged"),
}
_MACHINE = {
    "machine_processor": Attribute(
        "what the times were taken on; with `machine_cores`, `machine_system`, `machine_load_1_minute`, `versions`"
    ),
    "measured_at": Attribute("when, UTC"),
}

_TIME, _PLACE, _RUN, _CELL = ("time",), ("time", "axis"), ("cell", "member"), ("cell",)
_PLACES = "time", "cube", "axis"
_EDGES, _FIT = ("contact", "criterion", "stiffness"), ("contact", "criterion", "edge")
_SCAN = ("criterion", "cell")

_CELLS = {
    "contact": Variable(_CELL, "contact law", type="i1", role=LABELS),
    "stiffness": Variable(_CELL, "ground stiffness", "kg s-2", role=COORDINATE, note="per node"),
    "steps": Variable(_CELL, "number of time steps", type="i8", role=COORDINATE),
    "omega_h": Variable(_CELL, "contact frequency of a flat landing times step size", role=COORDINATE),
}
_CRITERION = Variable(("criterion",), "criterion", type="i1", role=LABELS)
_TOLERANCE = Variable(("criterion",), "tolerance of the criterion")

# Of a run, in its own file without dimensions. The long_name of a measure is its criterion's.
_OUTCOME = {
    "touchdown_phase": Variable(_RUN, "phase of the first touch-down within its time step", note="NaN if none"),
    "verdict": Variable(_RUN, "verdict", type="i1", role=ENUM, note="gravest of the criteria broken and `ending`"),
    "ending": Variable(
        _RUN,
        "how the run ended whatever it was asked, passed if well",
        type="i1",
        role=ENUM,
        note="a run that did not end well passes no criterion",
        since="1.3",
    ),
    "steps_done": Variable(_RUN, "steps done when the run ended", type="i8"),
}
_OUT_OF_RANGE = Variable(_RUN, "1 if a number left the range of doubles")

_RUN_VARIABLES = {
    "step": Variable(_TIME, "number of time steps done", type="i8"),
    "position": Variable(_PLACE, "centre of mass", "m"),
    "velocity": Variable(_PLACE, "velocity of it", "m s-1"),
    "kinetic_energy": Variable(_TIME, "kinetic energy, of translation and rotation", "J"),
    "potential_energy": Variable(_TIME, "potential energy m g z of the centre of mass", "J"),
    "elastic_energy": Variable(_TIME, "energy in the ground's springs, S d²/2 per node", "J"),
    "energy_paper": Variable(_TIME, "kinetic and potential energy, the paper's total", "J"),
    "mechanical_energy": Variable(
        _TIME,
        "kinetic, potential and elastic energy, the velocity taken at the time of the place",
        "J",
        need=RECOMMENDED,
    ),
    "angular_momentum": Variable(
        _PLACE, "angular momentum about the centre", "kg m2 s-1", note="where the cube turns", need=OPTIONAL
    ),
    "node_offset": Variable(
        ("time", "node", "axis"), "node relative to the centre", "m", note="where the cube turns", need=OPTIONAL
    ),
    **{name: part._replace(dimensions=()) for name, part in {"out_of_range": _OUT_OF_RANGE, **_OUTCOME}.items()},
    "touchdown_phase": _OUTCOME["touchdown_phase"]._replace(dimensions=(), need=RECOMMENDED),
    "evaluations": Variable((), "evaluations of the force", type="i8", need=RECOMMENDED),
    "time": Variable(_TIME, "time since the launch", "s", role=COORDINATE),
    "axis": Variable(("axis",), "Cartesian axis, z up", type="i1", role=LABELS, note="x, y, z"),
    "node": Variable(
        ("node",), "node, numbered as in cube.m", type="i1", role=COORDINATE, note="1 to 8", need=OPTIONAL
    ),
}

_PAIR_VARIABLES = {
    "step": _RUN_VARIABLES["step"],
    "position": _RUN_VARIABLES["position"]._replace(dimensions=_PLACES),
    "velocity": _RUN_VARIABLES["velocity"]._replace(dimensions=_PLACES),
    "angular_momentum": Variable(_PLACES, "angular momentum about the centre", "kg m2 s-1"),
    "node_offset": Variable(("time", "cube", "node", "axis"), "node relative to the centre", "m"),
    "kinetic_energy": Variable(_TIME, "kinetic energy of both, of translation and rotation", "J"),
    "potential_energy": Variable(_TIME, "potential energy m g z of both centres of mass", "J"),
    "elastic_energy": _RUN_VARIABLES["elastic_energy"],
    "contact_energy": Variable(_TIME, "energy in the springs between the cubes", "J"),
    "mechanical_energy": Variable(_TIME, "all four energies, the velocity taken at the time of the place", "J"),
    "energy_ratio": Variable(
        (),
        "largest energy in the air over that of the launch",
        note="counted from both cubes at rest on the ground",
    ),
    "deepest_contact": Variable((), "deepest contact between the cubes", "m"),
    "meetings": Variable((), "how often the cubes have begun to touch", type="i8"),
    "verdict": _RUN_VARIABLES["verdict"]._replace(note=""),
    "steps_done": _RUN_VARIABLES["steps_done"],
    "time": _RUN_VARIABLES["time"],
    "cube": Variable(("cube",), "cube, numbered as in the scene", type="i1", role=COORDINATE, note="0, 1"),
    "axis": _RUN_VARIABLES["axis"],
    "node": _RUN_VARIABLES["node"]._replace(need=REQUIRED),
}

_FRONTIER_VARIABLES = {
    "first_pass": Variable(_EDGES, "fewest steps at which every member passes", note="NaN if none"),
    "last_fail": Variable(_EDGES, "most steps at which a member still fails", note="NaN if none"),
    "steps_needed": Variable(_EDGES, "fewest scanned steps from which on every member passes", note="NaN if none"),
    "flips": Variable(_EDGES, "changes between pass and fail along the scan"),
    "limit": Variable(("stiffness",), "steps at the linear stability limit, omega h = 2"),
    "pass_fraction": Variable(_SCAN, "share of a cell's members that pass the criterion"),
    "pass_fraction_low": Variable(_SCAN, "lower end of its 95 % confidence interval", note="Wilson's"),
    "pass_fraction_high": Variable(_SCAN, "upper end of its 95 % confidence interval"),
    "tolerance": _TOLERANCE,
    "exponent": Variable(_FIT, "exponent of the power law", note="NaN with fewer than three points"),
    "exponent_error": Variable(_FIT, "standard error of it"),
    "factor": Variable(_FIT, "steps at stiffness 1 kg s-2 by the power law"),
    "scatter": Variable(_FIT, "standard deviation of log10 of the steps about the power law"),
    "centre": Variable(_FIT, "geometric mean of the stiffnesses in the fit", "kg s-2"),
    "points": Variable(_FIT, "number of stiffnesses in the fit"),
    "contact": Variable(("contact",), "contact law", type="i1", role=LABELS),
    "criterion": _CRITERION,
    "edge": Variable(
        ("edge",), "edge of a criterion", type="i1", role=LABELS, note="first_pass, last_fail, steps_needed"
    ),
    "stiffness": Variable(("stiffness",), "ground stiffness", "kg s-2", role=COORDINATE, note="per node"),
    **{f"cell_{name}": part for name, part in _CELLS.items()},
}

_STEPS = {
    "steps": Attribute("number of time steps of the run", type=WHOLE),
    "step_size": Attribute("duration/steps, in the unit of `step_size_units` (s)", type=NUMBER),
}
_DERIVED = Attribute(
    "values of the scene that were given in other words (a side for a radius, a restitution for a damping),"
    " and from what; the values themselves are in `scene`",
    OPTIONAL,
)

KINDS: dict[str, Kind] = {
    "run": Kind(
        {
            **_SIMULATOR,
            **_STEPS,
            "omega_h": Attribute("contact frequency of a flat landing times step size", type=NUMBER),
            "criteria": Attribute(_CRITERIA),
            "tolerance": Attribute("of the error, for a scheme that controls its own", RECOMMENDED, NUMBER),
            "hop_height": _HOP_HEIGHT,
            "scene_derived": _DERIVED,
        },
        _RUN_VARIABLES,
    ),
    "pair": Kind(
        {
            **{name: part for name, part in _SIMULATOR.items() if name != "model_reason"},
            **_STEPS,
            "omega_h": Attribute("fastest contact of the two stacked on the ground times step size", type=NUMBER),
            "criteria": Attribute(_CRITERIA),
            "scene_derived": _DERIVED,
        },
        _PAIR_VARIABLES,
    ),
    "shard": Kind(
        _OF_RUNS,
        {
            "out_of_range": _OUT_OF_RANGE,
            "energy_ratio": Variable(_RUN, "measure of criterion energy"),
            "apex_ratio": Variable(_RUN, "measure of criterion apex"),
            "restitution_error": Variable(_RUN, "measure of criterion restitution"),
            "trajectory_error": Variable(_RUN, "measure of criterion trajectory"),
            **_OUTCOME,
            "steps_computed": Variable(_RUN, "steps computed one by one, not many at once", type="i8"),
            "decided": Variable(
                (*_RUN, "criterion"), "step that decided the criterion, 0 if none before the end", type="i8"
            ),
            **_CELLS,
            "member": Variable(
                ("member",), "member: number k of n is launched k/n of a time step late", type="i4", role=COORDINATE
            ),
            "criterion": _CRITERION,
        },
    ),
    "sweep": Kind(
        {**_OF_RUNS, **_JUDGED},
        {
            "failing": Variable(_SCAN, "number of members that fail the criterion", type="i4"),
            "verdicts": Variable(("cell", "verdict"), "number of members that ended with a verdict", type="i4"),
            "steps_computed": Variable(_CELL, "steps computed one by one, of all members", type="i8"),
            "tolerance": _TOLERANCE,
            **_CELLS,
            "criterion": _CRITERION,
            "verdict": Variable(("verdict",), "verdict", type="i1", role=LABELS),
        },
    ),
    "frontier": Kind(
        {**_OF_RUNS, **_JUDGED, "analysis_code_digest": Attribute("SHA-256 of the source that found the edges")},
        _FRONTIER_VARIABLES,
    ),
    "experiment": Kind({}, {}),
    "timing": Kind(_MACHINE, {}),
    "bench": Kind(
        {**_MACHINE, "bench_code_digest": Attribute("SHA-256 of the benchmarks' source")},
        {"round": Variable(("round",), "round, in which the cases take turns", type="i4", role=COORDINATE)},
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
    """Return a dataset of one kind; arguments as of `plain_dataset`."""
    import xarray as xr

    return xr.Dataset(*plain_dataset(kind, values, meanings, attributes))


def plain_dataset(
    kind: str, values: Mapping[str, Any], meanings: Mapping[str, Sequence[str]], attributes: Mapping[str, Any]
) -> PlainDataset:
    """Return a dataset of one kind.

    values: of each variable by name, in the order in which they are stored; a tuple (dimensions, values, attributes)
    for one that the table does not have. meanings: the words of enums, by name. attributes: of the file.
    """
    known = KINDS[kind].variables
    variables = {
        name: PlainVariable(given[0], np.asarray(given[1]), given[2])
        if isinstance(given, tuple)
        else PlainVariable(known[name].dimensions, np.asarray(given), attributes_of(kind, name, meanings.get(name)))
        for name, given in values.items()
    }
    coordinates = {name: variables.pop(name) for name in values if name in known and COORDINATE in known[name].role}
    return PlainDataset(variables, coordinates, attributes)


def problems(dataset: xr.Dataset) -> list[str]:
    """Return what of a file is not as its kind demands, a line each; none for files older than kinds.

    What all files have in common is checked when they are read: structure, units, enums, the scene's digest.
    """
    version = _numbers(dataset.attrs.get("format_version", FORMAT_VERSION))
    if version < _numbers("1.2"):
        return []
    kind, told = dataset.attrs.get("kind"), dataset.attrs
    if kind not in KINDS:
        return [f"attribute kind = {kind}: allowed is {' or '.join(KINDS)}"]
    wrong = []
    for name, attribute in {**ATTRIBUTES, **KINDS[kind].attributes}.items():
        if name in told and not _is(attribute.type, told[name]):
            wrong.append(f"attribute {name} = {str(told[name])[:40]}: allowed is a {attribute.type}")
        elif name not in told and attribute.need == REQUIRED:
            wrong.append(f"attribute {name} is missing")
    for name, variable in KINDS[kind].variables.items():
        if name in dataset.variables:
            found = dataset[name]
            for what, theirs, ours in (
                ("dimensions", " ".join(map(str, found.dims)), " ".join(variable.dimensions)),
                ("type", found.dtype.str[1:], variable.type),
                ("units", found.attrs.get("units"), variable.units),
            ):
                if ours != theirs:
                    wrong.append(f"{name} has {what} {theirs}: allowed is {ours}")
        elif variable.need == REQUIRED and version >= _numbers(variable.since):
            wrong.append(f"variable {name} is missing")
    text = told.get("config")
    if isinstance(text, str) and hashlib.sha256(text.encode()).hexdigest() != told.get("config_digest"):
        wrong.append("attribute config is not that of config_digest")
    return wrong


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def _is(kind: str, value: Any) -> bool:
    if kind == TEXT:
        return isinstance(value, str)
    kinds = "i" if kind == WHOLE else "if"
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in kinds and bool(np.isfinite(value))
