"""A study: one sweep with its question, one YAML file. What it asks for, checked, and which cells answer it."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from stiffdice.dynamics import model_selection
from stiffdice.dynamics.state import TURNING, start_of
from stiffdice.errors import InputError, NotInstalledError, printable
from stiffdice.integrators import registry as schemes
from stiffdice.io import yaml_loader
from stiffdice.scene import scene as scenes
from stiffdice.scene import validation
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation import backend
from stiffdice.simulation.criteria.registry import tolerances_of
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.study import catalogue
from stiffdice.sweep.grid import Sweep

# What the schema of a study's file leaves to the code.
_NAMES = {
    "model": model_selection.CHOICES,
    "scheme": schemes.SCHEMES,
    "simulator": (backend.OURS, *engines.ENGINES),
    "contact_law": CONTACT_LAWS,
}

# In units of the side: nodes that are this level land at once, as far as their restitution shows.
_FLAT = 1e-9


class PlannedRun(NamedTuple):
    """One scene to be run, once for each reading of the paper's physics.

    A tuple, as PlannedFigure: Snakemake notices a changed parameter only if it is plain data.
    """

    scene: str
    presets: tuple[str, ...]
    model: str
    simulator: str
    scheme: str
    steps: int
    every: int


class Experiment(NamedTuple):
    """One question that is no sweep, or one timing: what to measure (a name in the catalogue), of what scene, how."""

    measure: str
    scene: str
    changes: tuple[str, ...]
    options: dict[str, Any]


class PlannedFigure(NamedTuple):
    """One figure or table: what to draw (a name in the catalogue), of which run, sweeps, experiments or timings.

    timings: those shown besides experiments.
    """

    draw: str
    of: tuple[str, ...]
    title: str
    timings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return what Snakemake's report shows of it: inside a script element, which a `</script>` in it would end."""
        return repr(self).replace("<", r"\x3c")

    @property
    def caption(self) -> str:
        """The title for a caption in reStructuredText, in which it has no markup."""
        return re.sub(r"([^a-zA-Z0-9\s])", r"\\\1", printable(" ".join(self.title.split())))


@dataclass(frozen=True)
class Study:
    """Everything one YAML file in config/ asks for, and what of it is left out: a line for each, and why.

    formats: of figures; PDF is made if it is among them, the others always.

    Left out is what needs an engine that is not installed: runs, sweeps, methods of experiments and timings, and what
    is drawn or told of these alone.
    """

    name: str
    question: str
    runs: Mapping[str, PlannedRun]
    sweeps: Mapping[str, Sweep]
    experiments: Mapping[str, Experiment]
    timings: Mapping[str, Experiment]
    figures: Mapping[str, PlannedFigure]
    tables: Mapping[str, PlannedFigure]
    dpi: int
    formats: tuple[str, ...] = ("png", "svg")
    left_out: tuple[str, ...] = ()


NAME = re.compile("[A-Za-z0-9][A-Za-z0-9_-]*")


def load(path: str | Path, schema: str | Path) -> Study:
    """Return the study in a YAML file, checked against the JSON schema in another and with its scenes read.

    Raises InputError naming the file, the key, the value and what is allowed.
    """
    if not NAME.fullmatch(Path(path).stem):
        raise InputError(f"{path}: allowed in a study's name are letters, digits, hyphens and underscores")
    if not Path(path).exists():
        above, name = Path(path).parent, Path(path).stem
        there = sorted(other.stem for other in above.glob("*.yaml") if NAME.fullmatch(other.stem))
        told = f"those in {above}/ are {', '.join(there)}" if there else f"{above}/ has none"
        raise InputError(f"{path}: there is no study {name}; {told}{validation.meant(name, there)}")
    data = yaml_loader.load(path)
    _check(data, yaml_loader.load(schema), str(path))
    try:
        tolerances_of("sliding", data.get("criteria"))  # a wrong name is told though no sweep may ask it
        left_out: list[str] = []
        parts = {
            "runs": _installed(data, "runs", _planned_run, left_out),
            "sweeps": _installed(data, "sweeps", partial(_sweep, data.get("criteria")), left_out),
            "experiments": _installed(data, "experiments", partial(_experiment, catalogue.EXPERIMENTS), left_out),
            "timings": _installed(data, "timings", partial(_experiment, catalogue.TIMINGS), left_out),
        }
        return Study(
            name=Path(path).stem,
            question=data["question"],
            **parts,
            figures=_shown(data, "figures", catalogue.DRAWINGS, parts, left_out),
            tables=_shown(data, "tables", catalogue.TABLES, parts, left_out),
            dpi=int(data.get("dpi", 200)),
            formats=tuple(data.get("formats", ("png", "svg"))),
            left_out=tuple(left_out),
        )
    except InputError as error:
        raise error.within(str(path)) from None


def _check(data: object, schema: Any, source: str) -> None:
    """Raise InputError unless a study's data are as a JSON schema says, which leaves names to the code."""
    import jsonschema  # which takes a while to import

    numbers = jsonschema.Draft202012Validator.TYPE_CHECKER.redefine("number", _is_number)
    kind = jsonschema.validators.extend(jsonschema.Draft202012Validator, type_checker=numbers)  # type: ignore[no-untyped-call]
    for name, words in _NAMES.items():
        schema["$defs"][name] = {"enum": list(words), "errorMessage": f"allowed is {' or '.join(words)}"}
    error = jsonschema.exceptions.best_match(kind(schema).iter_errors(data))
    if error is not None:
        raise InputError(f"{source}: {_reason(error)}")


def _is_number(_checker: object, value: object) -> bool:
    """Return whether a value is a number; NaN is none: no bound of a schema stops it."""
    return not isinstance(value, bool) and (
        isinstance(value, int) or (isinstance(value, float) and not math.isnan(value))
    )


def _reason(error: Any) -> str:
    """Return a schema error as one line that names the key, its value and what is allowed."""
    where = ".".join(str(part) for part in error.absolute_path)
    try:
        if error.validator == "additionalProperties":
            validation.known_keys(where, error.instance, list(error.schema["properties"]))
    except InputError as unknown:
        return str(unknown)
    if error.validator == "required":
        missing = [key for key in error.validator_value if key not in error.instance]
        return f"{where + '.' if where else ''}{missing[0]} is missing"
    allowed = error.schema.get("errorMessage")
    if error.validator == "enum" and allowed:
        allowed += validation.meant(error.instance, error.validator_value)
    if error.validator == "oneOf":
        return f"{where}: {allowed}"
    if "propertyNames" in error.absolute_schema_path:
        return f"{where}.{error.instance}: allowed names have small letters, digits and hyphens"
    return f"{where or 'the file'} = {validation.shown(error.instance)}: {allowed or error.message}"


def _installed(
    data: Mapping[str, Any], kind: str, plan: Callable[[Any, list[NotInstalledError]], Any], left_out: list[str]
) -> dict[str, Any]:
    """Return the parts of one kind that a study names, planned, without those that need what is not installed."""
    planned = {}
    for name, part in data.get(kind, {}).items():
        missing: list[NotInstalledError] = []
        try:
            planned[name] = plan(part, missing)
        except NotInstalledError as error:
            missing.append(error)
        except InputError as error:
            raise error.within(f"{kind}.{name}") from None
        left_out += [f"left out: {error.within(f'{kind}.{name}')}" for error in missing]
    return planned


def _shown(
    data: Mapping[str, Any],
    kind: str,
    registry: Mapping[str, catalogue.Entry],
    parts: Mapping[str, Mapping[str, Any]],
    left_out: list[str],
) -> dict[str, PlannedFigure]:
    """Return figures or tables of what there is, without those that would have nothing to show."""
    shown = {}
    for name, part in data.get(kind, {}).items():
        planned = _planned_figure(f"{kind}.{name}", registry, part, data)
        there = tuple(source for source in planned.of if source in parts[registry[planned.draw].given])
        timings = tuple(source for source in planned.timings if source in parts["timings"])
        if planned.draw.startswith(("cube", "animation")):
            for run in there:
                if not _models_of(parts["runs"][run]) <= TURNING:
                    raise InputError(f"{kind}.{name}.run = {run}: {planned.draw} needs a run of model tumbling")
        if there and bool(timings) == bool(planned.timings):
            shown[name] = planned._replace(of=there, timings=timings)
        else:
            left_out.append(f"left out: {kind}.{name}: nothing of what it shows is there")
    return shown


def _planned_run(run: Mapping[str, Any], _missing: object) -> PlannedRun:
    steps, every, simulator = int(run["steps"]), int(run.get("every", 1)), run.get("simulator", backend.OURS)
    if every > steps:
        raise InputError(f"every = {every}: allowed is a whole number <= steps = {steps}")
    presets = tuple(run.get("presets", ("as_listed", "as_written")))
    scheme = backend.scheme_of(simulator, run.get("scheme"))
    planned = PlannedRun(run["scene"], presets, run["model"], simulator, scheme, steps, every)
    _models_of(planned)
    return planned


def _models_of(run: PlannedRun) -> set[str]:
    """Return the models that a run computes, one for each preset; raises InputError if one cannot be started."""
    models = set()
    for preset in run.presets:
        scene = scenes.load(run.scene, preset=preset)
        model, _ = model_selection.chosen(run.model, [scene], scene.duration / run.steps)
        backend.check_fit(run.simulator, run.scheme, scene, model)
        start_of(scene, model)
        models.add(model)
    return models


def _planned_figure(
    where: str, registry: Mapping[str, catalogue.Entry], part: Mapping[str, Any], data: Mapping[str, Any]
) -> PlannedFigure:
    """Return the plan of a figure or a table; raises InputError unless the study has what it names."""
    word = "draw" if "draw" in part else "tell"
    draw = validation.choice(f"{where}.{word}", part[word], registry)
    entry = registry[draw]
    takes = {"run": "runs"} if entry.given == "runs" else {"of": entry.given}
    if entry.timed:
        takes["timings"] = "timings"
    asked = {key: [part[key]] if key == "run" else part[key] for key in ("run", "of", "timings") if key in part}
    for key, names in asked.items():
        if key not in takes:
            told = "; ".join(f"name {given} with `{other}`" for other, given in takes.items())
            raise InputError(f"{where}.{key} = {validation.shown(part[key])}: {draw} shows none of these; {told}")
        kind, allowed = takes[key], data.get(takes[key], {})
        for name in names:
            if name not in allowed:
                told = " or ".join(allowed) or f"none: this study has no {kind}"
                raise InputError(f"{where}.{key} = {name}: allowed is {told}{validation.meant(name, allowed)}")
            if entry.measures and allowed[name]["measure"] != entry.measures:
                raise InputError(f"{where}.{key} = {name}: {draw} shows only {kind} that measure {entry.measures}")
    first, *_ = takes
    if first not in asked:
        raise InputError(f"{where}.{first} is missing: {draw} needs names of {entry.given}")
    return PlannedFigure(draw, tuple(asked[first]), part["title"], tuple(asked.get("timings", ())))


def _experiment(
    registry: Mapping[str, catalogue.Entry], experiment: Mapping[str, Any], missing: list[NotInstalledError]
) -> Experiment:
    """Return the plan, its methods without those that are not installed; `missing` gets an error for each."""
    measure, changes = experiment["measure"], tuple(experiment.get("set", ()))
    options = dict(experiment.get("options", {}))
    validation.choice("measure", measure, registry)
    scene = scenes.load(experiment["scene"], changes)
    if not registry[measure].on_its_ground:
        _refuse_restitution(scene, "an experiment may take others")
    parameters = inspect.signature(registry[measure].load()).parameters.values()
    known = {part.name: part.default for part in parameters if part.kind is part.KEYWORD_ONLY}
    validation.known_keys("options", options, known)
    for key, value in options.items():
        _same_kind(f"options.{key}", value, known[key])
    if "methods" in options:
        options["methods"] = [method for method in options["methods"] if _is_installed(method, missing)]
        if missing and not options["methods"]:
            raise NotInstalledError("methods: none of them is left")
    return Experiment(measure, experiment["scene"], changes, options)


def _is_installed(method: str, missing: list[NotInstalledError]) -> bool:
    """Return whether a method is there; `missing` gets the error of an engine that is not installed."""
    try:
        if method in engines.ENGINES:
            engines.adapter_of(method, "methods")
    except NotInstalledError as error:
        missing.append(error)
        return False
    return True


def _same_kind(key: str, value: object, default: Any) -> None:
    """Raise InputError unless an option's value is of the kind that its default is."""
    if isinstance(default, tuple):
        like = default[0] if default else 0.0
        if not isinstance(value, list) or not value:
            kind = "words" if isinstance(like, str) else "numbers"
            raise InputError(f"{key} = {validation.shown(value)}: allowed is a list of {kind}")
        for part in value:
            _same_kind(key, part, like)
    elif isinstance(default, str):
        if not isinstance(value, str):
            raise InputError(f"{key} = {validation.shown(value)}: allowed is a word, as {default}")
    elif isinstance(default, int):
        validation.count(key, value)
    else:
        validation.number(key, value, "", at_least=0)


def _sweep(given_criteria: Mapping[str, float] | None, sweep: Mapping[str, Any], _missing: object) -> Sweep:
    scene = scenes.load(sweep["scene"], sweep.get("set", ()))
    stiffness, simulator = sweep["stiffness"], sweep.get("simulator", backend.OURS)
    given = {key: value for key, value in sweep.items() if key not in ("set", "criteria")}
    given |= {key: int(sweep[key]) for key in ("members", "seed", "refine") if key in sweep}
    given |= {"scene": scene, "scheme": backend.scheme_of(simulator, sweep.get("scheme"))}
    given |= {"contact": tuple(sweep["contact"]), "horizon": float(sweep.get("horizon", scene.duration))}
    if isinstance(stiffness, int | float):
        given["stiffness"] = {"from": stiffness, "to": stiffness, "count": 1}
    asked = Sweep(**given, criteria={})
    columns = asked.columns()
    longest_step = scene.duration / max(1.0, min(asked.step_range(column.stiffness)[0] for column in columns))
    model, reason = model_selection.chosen(asked.model, map(asked.scene_of, columns), longest_step)
    criteria = tolerances_of(model, sweep.get("criteria", given_criteria))
    planned = dataclasses.replace(asked, model=model, model_reason=reason, criteria=criteria)
    for column in columns:
        backend.check_fit(simulator, planned.scheme, planned.scene_of(column), model)
    if not planned.criteria:
        raise InputError(f"criteria: none of them means anything for model {planned.model}")
    if planned.horizon > scene.duration:
        raise InputError(f"horizon = {planned.horizon:g}: allowed is a number <= duration = {scene.duration:g} [s]")
    for span in [planned.stiffness] if isinstance(planned.stiffness, Mapping) else planned.stiffness:
        if span["from"] > span["to"]:
            raise InputError(f"stiffness.from = {span['from']:g}: allowed is a number <= to = {span['to']:g} [kg/s²]")
    if any(column != (scene.ground.contact, scene.ground.stiffness) for column in columns):
        _refuse_restitution(scene, "the sweep sets others")
    for key in ("stiffness", "contact"):
        for override in sweep.get("set", ()):
            if override.split("=")[0].strip() in ("ground", f"ground.{key}"):
                raise InputError(f"set: {override}: the sweep sets this itself, from its key {key}")
    if "restitution" in planned.criteria and not model_selection.lands_flat(scene, _FLAT):
        raise InputError("criteria.restitution: is known exactly for flat landings only, and this cube lands tilted")
    most = max(planned.step_range(column.stiffness)[1] for column in columns)
    if not most <= validation.LARGEST_COUNT:
        key = "steps" if planned.steps else "omega_h"
        raise InputError(f"{key}: asks for up to {most:.3g} steps; allowed are {validation.LARGEST_COUNT}")
    fewest, column = min((planned.scan(column)[0], column) for column in columns)
    phased(planned.scene_of(column), model, fewest, planned.members, turned(scene, model, planned.members))
    return planned


def _refuse_restitution(scene: scenes.Scene, reason: str) -> None:
    """Raise InputError if the damping of a scene's ground follows from its restitution."""
    if any(line.startswith("ground.damping") for line in scene.derived):
        raise InputError(
            f"scene: its ground.restitution is that of stiffness {scene.ground.stiffness:g} kg/s² and the "
            f"{scene.ground.contact} law alone, and {reason}; give ground.damping"
        )
