"""A study: one sweep with its question, one YAML file. What it asks for, checked, and which cells answer it."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stiffdice import checks, theory
from stiffdice import scene as scenes
from stiffdice.ensemble import phased
from stiffdice.errors import InputError
from stiffdice.io import yaml_file
from stiffdice.scene import Scene


class Cell(NamedTuple):
    """One point of a sweep, with all its members."""

    contact: str
    stiffness: float  # [kg/s²]
    steps: int


class PlannedRun(NamedTuple):
    """One scene to be run, once for each reading of the paper's physics.

    A tuple, as PlannedFigure: Snakemake notices a changed parameter only if it is plain data.
    """

    scene: str
    presets: tuple[str, ...]
    model: str
    scheme: str
    steps: int
    every: int


@dataclass(frozen=True)
class Sweep:
    """A grid of stiffness and steps, in shards."""

    scene: Scene
    model: str
    scheme: str
    contact: tuple[str, ...]
    stiffness: Mapping[str, float]
    steps: Mapping[str, float] | None
    omega_h: Mapping[str, float] | None
    members: int
    seed: int
    cells_per_shard: int

    def scene_of(self, cell: Cell) -> Scene:
        """Return the sweep's scene on the ground of a cell."""
        return self.scene.with_ground(contact=cell.contact, stiffness=cell.stiffness)

    def cells(self) -> list[Cell]:
        """Return all cells: contact law by law, stiffness by stiffness, steps ascending."""
        return [
            Cell(contact, stiffness, steps)
            for contact in self.contact
            for stiffness in dict.fromkeys(_geometric(self.stiffness))
            for steps in self._steps_of(stiffness)
        ]

    @property
    def _grid(self) -> Mapping[str, float]:
        """The span of steps, given as counts or as ωh."""
        grid = self.omega_h if self.steps is None else self.steps
        assert grid is not None, "the schema asks for one of them"
        return grid

    def step_range(self, stiffness: float) -> tuple[float, float]:
        """Return the fewest and the most steps of the grid at one stiffness [kg/s²], not rounded."""
        ends = self._grid
        if self.steps is None:
            scene = self.scene.with_ground(stiffness=stiffness)
            ends = {end: theory.steps_for(scene, ends[end]) for end in ("from", "to")}
        return min(ends["from"], ends["to"]), max(ends["from"], ends["to"])

    def _steps_of(self, stiffness: float) -> list[int]:
        """Return the step counts tried at one stiffness: spread evenly in their logarithm, jittered within each part.

        Round numbers are special (the step may be a whole fraction of everything else in a scene), so none is favoured.
        """
        low, high = np.log(self.step_range(stiffness))
        count = int(self._grid["count"])
        key = int.from_bytes(hashlib.sha256(repr(stiffness).encode()).digest()[:8])
        part = (np.arange(count) + np.random.default_rng([self.seed, key]).random(count)) / count
        return sorted({max(1, round(float(steps))) for steps in np.exp(low + (high - low) * part)})

    def shards(self) -> dict[str, list[Cell]]:
        """Return the cells of each shard, by the shard's id: a digest of all that its numbers depend on but the code.

        Cells are dealt out in turn, so that every shard gets its share of the expensive ones.
        """
        cells = self.cells()
        count = -(-len(cells) // self.cells_per_shard)
        return {self._digest(cells[k::count]): cells[k::count] for k in range(count)}

    def _digest(self, cells: Sequence[Cell]) -> str:
        parts = [self.scene.digest, self.model, self.scheme, self.members, cells]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]


class PlannedFigure(NamedTuple):
    """One figure: what to draw (a name of `figures.DRAWINGS`), of which run (none for the sweep's)."""

    draw: str
    run: str | None
    title: str


@dataclass(frozen=True)
class Study:
    """Everything one YAML file in config/ asks for."""

    name: str
    question: str
    runs: Mapping[str, PlannedRun]
    sweep: Sweep | None
    tolerances: Mapping[str, float]
    figures: Mapping[str, PlannedFigure]
    dpi: int


NAME = re.compile("[A-Za-z0-9][A-Za-z0-9_-]*")


def load(path: str | Path, schema: str | Path) -> Study:
    """Return the study in a YAML file, checked against the JSON schema in another and with its scenes read.

    Raises InputError naming the file, the key, the value and what is allowed.
    """
    if not NAME.fullmatch(Path(path).stem):
        raise InputError(f"{path}: allowed in a study's name are letters, digits, hyphens and underscores")
    data = yaml_file.load(path)
    _validate(data, schema, str(path))
    try:
        return Study(
            name=Path(path).stem,
            question=data["question"],
            runs={name: _planned_run(name, run) for name, run in data.get("runs", {}).items()},
            sweep=_sweep(data["sweep"]) if "sweep" in data else None,
            tolerances=data.get("criteria", {}),
            figures={name: _planned_figure(name, part, data) for name, part in data.get("figures", {}).items()},
            dpi=int(data.get("dpi", 150)),
        )
    except InputError as error:
        raise error.within(str(path)) from None


def _validate(data: object, schema: str | Path, source: str) -> None:
    import jsonschema

    _refuse_nan(data, "", source)
    validator = jsonschema.Draft202012Validator(yaml_file.load(schema))
    errors = sorted(validator.iter_errors(data), key=lambda error: _RANK.get(str(error.validator), 1))
    if errors:
        raise InputError(f"{source}: {_told(errors[0])}")


def _refuse_nan(data: object, where: str, source: str) -> None:
    """Raise InputError if a number is not one: no bound of a schema stops a NaN."""
    if isinstance(data, float) and math.isnan(data):
        raise InputError(f"{source}: {where[1:]} = nan: allowed is a finite number")
    parts = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, part in parts:
        _refuse_nan(part, f"{where}.{key}", source)


# A misspelt key is told before the key that it leaves missing.
_RANK = {"additionalProperties": 0, "required": 2, "oneOf": 3}


def _told(error: Any) -> str:
    """Return a schema error as one line that names the key, its value and what is allowed."""
    where = ".".join(str(part) for part in error.absolute_path)
    try:
        if error.validator == "additionalProperties":
            checks.known_keys(where, error.instance, list(error.schema["properties"]))
    except InputError as unknown:
        return str(unknown)
    if error.validator == "required":
        missing = [key for key in error.validator_value if key not in error.instance]
        return f"{where + '.' if where else ''}{missing[0]} is missing"
    allowed = error.schema.get("errorMessage")
    if error.validator == "oneOf":
        return f"{where}: {allowed}"
    if "propertyNames" in error.absolute_schema_path:
        return f"{where}.{error.instance}: allowed names have small letters, digits and hyphens"
    return f"{where or 'the file'} = {checks.shown(error.instance)}: {allowed or error.message}"


def _planned_run(name: str, run: Mapping[str, Any]) -> PlannedRun:
    planned = PlannedRun(
        run["scene"],
        tuple(run.get("presets", ("as_listed", "as_written"))),
        run["model"],
        run.get("scheme", "symplectic_euler"),
        int(run["steps"]),
        int(run.get("every", 1)),
    )
    if planned.every > planned.steps:
        raise InputError(f"runs.{name}.every = {planned.every}: allowed is a whole number <= steps = {planned.steps}")
    for preset in planned.presets:
        try:
            scenes.load(planned.scene, preset=preset)
        except InputError as error:
            raise error.within(f"runs.{name}") from None
    return planned


def _planned_figure(name: str, figure: Mapping[str, Any], data: Mapping[str, Any]) -> PlannedFigure:
    planned = PlannedFigure(figure["draw"], figure.get("run"), figure["title"])
    if planned.draw == "frontier":
        if "sweep" not in data:
            raise InputError(f"figures.{name}: frontier draws a sweep, and this study has none")
        if planned.run is not None:
            raise InputError(f"figures.{name}.run = {planned.run}: frontier draws the sweep; leave `run` out")
    elif planned.run not in data.get("runs", {}):
        allowed = " or ".join(data.get("runs", {})) or "none: this study has no runs"
        raise InputError(f"figures.{name}.run = {planned.run}: allowed is {allowed}")
    elif planned.draw.startswith(("cube", "animation")) and data["runs"][planned.run]["model"] != "tumbling":
        raise InputError(f"figures.{name}.run = {planned.run}: {planned.draw} needs a run of model tumbling")
    return planned


def _sweep(sweep: Mapping[str, Any]) -> Sweep:
    planned = Sweep(
        scenes.load(sweep["scene"], sweep.get("set", ())),
        sweep["model"],
        sweep.get("scheme", "symplectic_euler"),
        tuple(sweep["contact"]),
        sweep["stiffness"],
        sweep.get("steps"),
        sweep.get("omega_h"),
        int(sweep["members"]),
        int(sweep.get("seed", 0)),
        int(sweep.get("cells_per_shard", 500)),
    )
    for key in ("stiffness", "contact"):
        for override in sweep.get("set", ()):
            if override.split("=")[0].strip() == f"ground.{key}":
                raise InputError(f"sweep.set: {override}: the sweep sets this itself, from sweep.{key}")
    most = max(planned.step_range(planned.stiffness[end])[1] for end in ("from", "to"))
    if not most <= checks.LARGEST_COUNT:
        key = "steps" if planned.steps else "omega_h"
        raise InputError(f"sweep.{key}: asks for up to {most:.3g} steps; allowed are {checks.LARGEST_COUNT}")
    longest = min(planned.cells(), key=lambda cell: cell.steps)
    try:
        phased(planned.scene_of(longest), planned.model, longest.steps, planned.members)
    except InputError as error:
        raise error.within("sweep") from None
    return planned


def _geometric(span: Mapping[str, float]) -> list[float]:
    """Return `count` values from `from` to `to`, evenly spaced in their logarithm, the ends exact.

    Rounded to twelve digits: 1000, not 999.9999999999998, names a cell.
    """
    values = np.geomspace(span["from"], span["to"], int(span["count"]))
    return [float(f"{value:.12g}") for value in values]
