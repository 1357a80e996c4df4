"""The ledger of a scene's energy at a few numbers of steps: what went into damping, what the scheme made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.state import Array
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset, energy_budget

SCHEME = "symplectic_euler"

# Of a bounce, in this order.
_PARTS = {
    "damping_work": "work of damping on nodes below the ground",
    "drag_work": "work of the ungated law on nodes above the ground during the bounce",
    "friction_work": "work of friction on nodes below the ground",
    "scheme_work": "what the scheme itself made, or lost if negative",
}


def measure(
    scene: Scene,
    *,
    model: str = "sliding",
    steps: Sequence[float] = (1.0e4, 1.2e4, 2e4, 2.3e4, 1e5, 1e6),
    bounces: int = 5,
) -> xr.Dataset:
    """Return where the energy of the first bounces went, dimensions contact, steps and bounce.

    model: which motion. steps: numbers of time steps, a run each. bounces: how many of each run are told.
    Works [J] are NaN where a run has no such bounce; `flight_drag_work` is what the ungated law took in mid-air, and
    `miss` how far the parts are from adding up to the change of energy. Raises InputError for a number out of range.
    """
    counts = [validation.count("steps", part) for part in steps]
    kept = [
        [
            energy_budget.ledger(scene.with_ground(contact=law), model=model, scheme=SCHEME, steps=count)
            for count in counts
        ]
        for law in LAWS
    ]
    grid = ("contact", "steps", "bounce")
    described: dict[str, tuple[Any, Any, str]] = {
        name: (grid, _of_bounces(kept, name, bounces), text) for name, text in _PARTS.items()
    }
    described["energy_before"] = (grid, _of_bounces(kept, "energy_before", bounces), "energy before the bounce")
    described["flight_drag_work"] = (
        grid[:2],
        [[float(book["flight_drag_work"]) for book in row] for row in kept],
        "work of the ungated law in flight",
    )
    described["run_scheme_work"] = (
        grid[:2],
        [[float(book["scheme_work"]) for book in row] for row in kept],
        "what the scheme made in the whole run, or lost if negative",
    )
    described["miss"] = (
        grid[:2],
        [[abs(_miss(book)) for book in row] for row in kept],
        "how far all parts are from adding up to the change of energy of the run",
    )
    variables: dict[str, Any] = {
        name: (dims, values, {"long_name": text, "units": "J"}) for name, (dims, values, text) in described.items()
    }
    omega_h = [linear_theory.omega_h(scene, count) for count in counts]
    variables["omega_h"] = ("steps", omega_h, dataset.CELL_ATTRIBUTES["omega_h"])
    coordinates: dict[str, Any] = {
        "contact": ("contact", np.arange(len(LAWS), dtype=np.int8), dataset.CONTACT_ATTRIBUTES),
        "steps": ("steps", counts, dataset.CELL_ATTRIBUTES["steps"]),
        "bounce": ("bounce", np.arange(1, bounces + 1), {"long_name": "number of the bounce", "units": "1"}),
    }
    attributes = dataset.provenance_attributes(
        "Ledger of the energy of bounces", scene, model, SCHEME, "stiffdice.experiments.energy_budget"
    )
    attributes["scene_note"] = "contact law is the dimension's, not the scene's"
    return xr.Dataset(variables, coordinates, attributes)


def _miss(book: xr.Dataset) -> float:
    """Return how far the works are from the change of energy of a run [J]."""
    change = book["damping_work"] + book["drag_work"] + book["friction_work"] + book["scheme_work"]
    return float(change - (book["end_energy"] - book["launch_energy"]))


def _of_bounces(kept: Sequence[Sequence[xr.Dataset]], name: str, bounces: int) -> Array:
    return np.array([[_padded(book[f"bounce_{name}"].values, bounces) for book in row] for row in kept])


def _padded(values: Array, count: int) -> Array:
    """Return the first values, shape (count,), with NaN where there are none."""
    found = np.full(count, np.nan)
    found[: min(count, len(values))] = values[:count]
    return found
