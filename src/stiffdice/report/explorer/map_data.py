"""What the stability map of the explorer shows: cells, edges, launches and exact paths of the stored sweeps."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TURNING, States, physics_of
from stiffdice.errors import InputError, RefusedError
from stiffdice.integrators import linear_stability
from stiffdice.io import schema
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.content_digest import CELL, cell_digests, runs_digest
from stiffdice.io.reader import open_file, parts
from stiffdice.io.text_file import rows_of
from stiffdice.report.explorer import exact_paths
from stiffdice.report.explorer.packing import Packer
from stiffdice.report.figures import style
from stiffdice.report.number_format import finite, ground_words
from stiffdice.scene import scene as scenes
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria import judge
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.initial_conditions import turned
from stiffdice.simulation.outcome import BLOW_UP, Verdict

# The studies whose maps are shown, and what makes them.
STUDIES = ("stability", "paper")
MADE_BY = "make stability, make paper"

SCHEME = "symplectic_euler"  # that the page computes again
_RUN_AGAIN = ("sliding", "tumbling")
# Of a cube that turns, each member has an exact path of its own; so many are published, the first ones. Their launches
# are spread evenly, however many they are.
PATHS = 8


def collect(results: Path, studies: Sequence[str] = STUDIES) -> dict[str, Any]:
    """Return all that the map shows of the sweeps of some studies, as JSON.

    results: the folder in which the studies' results lie. A sweep that has not been made, or not to its end, is left
    out, and so is one of a single stiffness, which is no map. `maps` is empty where there is none; `made_by` says which
    commands make them. Raises InputError, naming the file, for one that cannot be read, trusted, or used, RefusedError
    if runs and sweep are not of each other.
    """
    packer, paths = Packer(), _Paths()
    maps = [_map(folder, packer, paths) for study in studies for folder in _sweeps(results / study)]
    drawn = {"samples": exact_paths.INTERVALS, "place": exact_paths.PLACE, "energy": exact_paths.ENERGY}
    return {
        "made_by": MADE_BY,
        "maps": [found for found in maps if found is not None],
        "paths": paths.packed,
        "drawn": drawn | {"known": exact_paths.KNOWN},
        "blow_up": BLOW_UP,
        "looks": {"theory": style.THEORY["color"], "ink": style.INK},
        "laws": style.LAW_NAMES,
        "verdicts": [verdict.name.lower() for verdict in Verdict],
        "sentences": [verdict.sentence for verdict in Verdict],
        "block": packer.block(),
    }


def _sweeps(study: Path) -> Iterator[Path]:
    """Yield the folders of a study's sweeps that have been made to their end."""
    for path in sorted(study.glob("sweeps/*/frontier.h5")):
        if (path.parent / "sweep.h5").exists():
            yield path.parent


class _Paths:
    """The exact paths published: one for all sweeps that share a scene, a law, a stiffness and a launch."""

    def __init__(self) -> None:
        self.packed: list[dict[str, Any]] = []
        self._known: dict[tuple[Any, ...], int] = {}

    def number(self, packer: Packer, scene: Scene, model: str, launch: States, horizon: float | None) -> int:
        """Return the number of a path, computed unless it is known; arguments as of `exact_paths.packed`."""
        key = scene.digest, model, launch.tobytes(), horizon
        if key not in self._known:
            self._known[key] = len(self.packed)
            self.packed.append(exact_paths.packed(packer, scene, model, launch, horizon))
        return self._known[key]


def _map(folder: Path, packer: Packer, paths: _Paths) -> dict[str, Any] | None:
    """Return what one sweep gave; None if it is of a single stiffness."""
    sweep, frontier = _opened(folder / "sweep.h5", "sweep"), _opened(folder / "frontier.h5", "frontier")
    if frontier.attrs["runs_digest"] != sweep.attrs["runs_digest"]:
        raise RefusedError(f"{folder / 'frontier.h5'}: runs_digest is not that of sweep.h5; {_again(folder)}")
    if frontier.sizes["stiffness"] < 2:
        return None
    about, model = sweep.attrs, str(sweep.attrs["model"])
    scene, members = scenes.from_mapping(json.loads(about["scene"])), int(about["members"])
    horizon = float(about["horizon"]) if "horizon" in about else None
    launches = turned(scene, model, members)[: members if model in TURNING else 1]
    again = about["simulator"] == OURS and about["scheme"] == SCHEME and model in _RUN_AGAIN and not scene.cube.is_box
    shown = launches[:PATHS] if again else launches[:0]
    columns = list(_columns(sweep, frontier, scene, model))
    for column in columns:
        there = scene.with_ground(contact=column["law"], stiffness=column["stiffness"])
        column["paths"] = [paths.number(packer, there, model, shown[k : k + 1], horizon) for k in range(len(shown))]
    return {
        "name": f"{folder.parents[1].name}/{folder.name}",
        "model": model,
        "ground": ground_words(damping=scene.ground.damping, friction=scene.ground.friction),
        "members": members,
        "runs_again": again,
        "early_stop": bool(about["early_stop"]),
        "horizon": horizon,
        "hop_height": float(about["hop_height"]),
        "scene": scene.as_mapping(),
        "physics": _numbers(scene),
        "criteria": _criteria(sweep),
        "columns": columns,
        "cells": _cells(folder, sweep, packer),
        "launches": [_launch(launch) for launch in launches],
    }


def _opened(path: Path, kind: str) -> xr.Dataset:
    """Return the dataset in a file; raises RefusedError unless it is what a file of its kind has to be."""
    found = open_file(path)
    wrong = [] if found.attrs.get("kind") == kind else [f"kind = {found.attrs.get('kind')}: allowed here is {kind}"]
    for problem in wrong or schema.problems(found):
        raise RefusedError(f"{path}: {problem}")
    return found


def _again(folder: Path) -> str:
    return f"make study STUDY={folder.parents[1].name} makes it again"


def _columns(sweep: xr.Dataset, frontier: xr.Dataset, scene: Scene, model: str) -> Iterator[dict[str, Any]]:
    """Yield for each contact law and stiffness its cells, theory, and edges by criterion; cells are sorted alike."""
    laws, names = meanings_of(sweep.contact), meanings_of(frontier.criterion)
    cells = np.stack([sweep.contact.values, sweep.stiffness.values])
    starts = np.flatnonzero(np.any(np.diff(cells, axis=1, prepend=np.nan) != 0, axis=0))
    of_laws = {meanings_of(frontier.contact)[number]: k for k, number in enumerate(frontier.contact.values)}
    for start, end in zip(starts, [*starts[1:], cells.shape[1]], strict=True):
        law, stiffness = laws[int(cells[0, start])], float(cells[1, start])
        here = scene.with_ground(contact=law, stiffness=stiffness)
        at = frontier.isel(contact=of_laws[law], stiffness=int(np.searchsorted(frontier.stiffness.values, stiffness)))
        yield {
            "law": law,
            "stiffness": stiffness,
            "first": int(start),
            "count": int(end - start),
            "onset": finite(CONTACT_LAWS[law].onset),
            "approach_damping": CONTACT_LAWS[law].approach_damping,
            "radians": linear_theory.omega_h(here, 1),
            "limit": finite(float(at.limit)),
            "first_pass": {name: finite(float(at.first_pass[k])) for k, name in enumerate(names)},
            "last_fail": {name: finite(float(at.last_fail[k])) for k, name in enumerate(names)},
            "fewest": [finite(part) for part in linear_stability.fewest_steps(here, model, SCHEME)],
        }


def _numbers(scene: Scene) -> dict[str, float]:
    """Return the numbers of a scene as a kernel takes them, but for those that each column has of its own."""
    own = {"stiffness", "onset", "approach_damping"}
    numbers = physics_of(scene)._asdict()
    return {key: value for key, value in numbers.items() if isinstance(value, float | int) and key not in own}


def _criteria(sweep: xr.Dataset) -> list[dict[str, Any]]:
    """Return what each criterion asks, in words, by its largest measure, and how its edges are drawn."""
    hop = float(sweep.attrs["hop_height"])
    return [
        {
            "name": name,
            "words": style.criterion_words(name, tolerance, hop),
            "measure": CRITERIA[name].MEASURE,
            "long_name": CRITERIA[name].LONG_NAME,
            "limit": CRITERIA[name].BASE + tolerance,
            "failure": int(CRITERIA[name].FAILURE),
            "color": style.CRITERION_LOOKS[name]["color"],
        }
        for name, tolerance in zip(meanings_of(sweep.criterion), sweep.tolerance.values.tolist(), strict=True)
    ]


def _cells(folder: Path, sweep: xr.Dataset, packer: Packer) -> dict[str, Any]:
    """Return where the numbers of all cells are stored; by criterion what members pass, and the worst measure."""
    names = meanings_of(sweep.criterion)
    passes = _passes(folder, sweep, dict(zip(names, sweep.tolerance.values.tolist(), strict=True)))
    if not np.array_equal((~passes).sum(axis=-1), sweep.failing.values):
        raise RefusedError(f"{folder / 'sweep.h5'}: failing is not what its shards give; {_again(folder)}")
    worst = np.stack([sweep[f"largest_{CRITERIA[name].MEASURE}"].values for name in names])
    return {
        "steps": packer.put(sweep.steps.values, "i4"),
        "verdicts": packer.put(sweep.verdicts.values, "u2"),
        "worst": packer.put(worst, "f8"),
        "passes": packer.put(np.packbits(passes, axis=-1, bitorder="little"), "u1"),
    }


def _passes(folder: Path, sweep: xr.Dataset, tolerances: Mapping[str, float]) -> npt.NDArray[np.bool_]:
    """Return which members pass which criterion, shape (criterion, cell, member), cells in the order of the sweep's."""
    found, cells, digests = [], [], []
    measures = [CRITERIA[name].MEASURE for name in tolerances]
    for path in _shards(folder):
        for part in parts(path):
            for problem in schema.problems(part):
                raise RefusedError(f"{path}: {problem}")
            values = {name: part[name].values for name in measures}
            found.append(judge.passes(tolerances, values, part["ending"].values))
            cells.append([part[name].values for name in reversed(CELL)])
            digests.append(cell_digests(part))
    if runs_digest(digests) != sweep.attrs["runs_digest"]:
        raise RefusedError(f"{folder / 'shards'}: are not those that sweep.h5 was collected from; {_again(folder)}")
    keys = [np.concatenate(part) for part in zip(*cells, strict=True)]
    order = np.lexsort(keys)
    if not all(np.array_equal(key[order], sweep[name].values) for key, name in zip(reversed(keys), CELL, strict=True)):
        raise RefusedError(f"{folder / 'sweep.h5'}: its cells are not those of its shards, sorted; {_again(folder)}")
    return np.concatenate(found, axis=1)[:, order]


def _shards(folder: Path) -> list[Path]:
    """Return the files of a sweep's runs, as its table names them; raises InputError if there is no table."""
    table = folder / "shards.csv"
    names = [row.get("shard") or "" for row in rows_of(table)]
    if not names or not all(name.isalnum() for name in names):
        raise InputError(f"{table}: names no shards; {_again(folder)}")
    return [folder / "shards" / f"{name}.h5" for name in names]


def _launch(launch: Any) -> dict[str, list[Any]]:
    """Return a STATE record as plain numbers."""
    return {name: launch[name].tolist() for name in launch.dtype.names}
