"""The ledger of a scene's energy at a few numbers of steps: what went into damping, what the scheme made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.state import Array
from stiffdice.experiments import options
from stiffdice.experiments.layout import CONTACT, of_cells, quantity
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset, energy_budget

SCHEME = "symplectic_euler"

# Of a ledger's bounces.
_OF_BOUNCES = {
    "damping_work": "work of damping on nodes below the ground",
    "drag_work": "work of the ungated law on nodes above the ground during the bounce",
    "friction_work": "work of friction on nodes below the ground",
    "scheme_work": "what the scheme itself made, or lost if negative",
    "energy_before": "energy before the bounce",
}
# Of its run, by the ledger's name.
_OF_RUNS = {
    "flight_drag_work": ("flight_drag_work", "work of the ungated law in flight"),
    "scheme_work": ("run_scheme_work", "what the scheme made in the whole run, or lost if negative"),
}


def measure(
    scene: Scene,
    *,
    model: str = "sliding",
    steps: Sequence[float] = (1.0e4, 1.2e4, 2e4, 2.3e4, 1e5, 1e6),
    bounces: int = 5,
) -> xr.Dataset:
    """Return where the energy of the first bounces went, dimensions contact, steps and bounce.

    model: which motion. steps: numbers of time steps, a run each. bounces: how many of each run.
    Works [J] are NaN where a run has no such bounce; `flight_drag_work` is what the ungated law took in mid-air, and
    `miss` how far the parts are from adding up to the change of energy. Raises InputError for a number out of range.
    """
    counts = options.counts("steps", steps)
    ledgers = [
        [energy_budget.ledger(scene.with_ground(contact=law), model=model, scheme=SCHEME, steps=n) for n in counts]
        for law in LAWS
    ]
    grid = ("contact", "steps", "bounce")
    variables = {"omega_h": of_cells("omega_h", [linear_theory.omega_h(scene, count) for count in counts], "steps")}
    for name, text in _OF_BOUNCES.items():
        found = [[_padded(ledger[f"bounce_{name}"].values, bounces) for ledger in row] for row in ledgers]
        variables[name] = quantity(grid, found, text, "J")
    for name, (stored, text) in _OF_RUNS.items():
        variables[stored] = quantity(grid[:2], [[float(ledger[name]) for ledger in row] for row in ledgers], text, "J")
    miss = [[_miss(ledger) for ledger in row] for row in ledgers]
    text = "how far all parts are from adding up to the change of energy of the run"
    variables["miss"] = quantity(grid[:2], miss, text, "J")
    coordinates = {
        "contact": CONTACT,
        "steps": of_cells("steps", counts),
        "bounce": quantity("bounce", np.arange(1, bounces + 1), "number of the bounce"),
    }
    attributes = dataset.provenance_attributes("Ledger of the energy of bounces", scene, model, SCHEME, __name__)
    attributes["scene_note"] = "contact law is the dimension's, not the scene's"
    return xr.Dataset(variables, coordinates, attributes)


def _miss(ledger: xr.Dataset) -> float:
    """Return how far the works are from the change of energy of a run [J]."""
    change = ledger["damping_work"] + ledger["drag_work"] + ledger["friction_work"] + ledger["scheme_work"]
    return abs(float(change - (ledger["end_energy"] - ledger["launch_energy"])))


def _padded(values: Array, count: int) -> Array:
    """Return the first values, shape (count,), with NaN where there are none."""
    found = np.full(count, np.nan)
    found[: min(count, len(values))] = values[:count]
    return found
