"""The ledger of a scene's energy at a few numbers of steps: what went into damping, what the scheme made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.experiments.measuring import coordinates, mapped, result
from stiffdice.scene import validation
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset, energy_budget

SCHEME = "symplectic_euler"

# Of each bounce of a ledger, and of its run.
_WORKS = {
    "damping_work": ("work of damping on nodes below the ground", "J", "bounce"),
    "drag_work": ("work of the ungated law on nodes above the ground during the bounce", "J", "bounce"),
    "friction_work": ("work of friction on nodes below the ground", "J", "bounce"),
    "scheme_work": ("what the scheme itself made, or lost if negative", "J", "bounce"),
    "flight_drag_work": ("work of the ungated law in flight", "J"),
}


def measure(
    scene: Scene,
    *,
    model: str = "sliding",
    steps: Sequence[float] = (1.0e4, 1.2e4, 2e4, 2.3e4, 1e5, 1e6),
    bounces: int = 5,
) -> xr.Dataset:
    """Return where the energy of the first bounces went [J], dimensions contact, steps and bounce.

    model: which motion. steps: numbers of time steps, a run each. bounces: how many of each run; works are NaN where it
    has fewer. Raises InputError for a number out of range.
    """
    taken = [validation.count("steps", value) for value in steps]
    missing = np.full(validation.count("bounces", bounces), np.nan)

    def works(law: str, count: int) -> list[Any]:
        ledger = energy_budget.ledger(scene.with_ground(contact=law), model=model, scheme=SCHEME, steps=count).data_vars
        of_bounces = [name for name, (_, _, *bounce) in _WORKS.items() if bounce]
        found = [np.append(ledger[f"bounce_{name}"].values, missing)[:bounces] for name in of_bounces]
        return [*found, float(ledger["flight_drag_work"].values)]

    found = mapped(works, _WORKS, contact=CONTACT_LAWS, steps=taken) | coordinates(bounce=range(1, bounces + 1))
    omega_h = [linear_theory.omega_h(scene, count) for count in taken]
    found["omega_h"] = "steps", omega_h, dataset.CELL_ATTRIBUTES["omega_h"]
    note = "contact law is the dimension's, not the scene's"
    return result(found, "Ledger of the energy of bounces", scene, model, SCHEME, __name__, scene_note=note)
