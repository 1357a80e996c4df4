"""Whether the numbers of a file can be those of what it says it is: physics and bookkeeping, computed once more.

Nothing here runs a simulation. Every check follows from an equation that the file's own numbers must fulfil, and every
bound from counting the roundings between the two sides of it; none is fitted to files.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.archive.consistency import runs, sweeps
from stiffdice.errors import InputError

# What of a file the checks here do not see, by its kind.
NOT_SEEN = {
    "run": "motion of runs from state to state, touch-down phases and measures (a rebuild computes them again)",
    "shard": "numbers of shards apart from their sweep",
    "sweep": "numbers of sweeps and surveys apart from their shards",
    "frontier": "numbers of frontiers apart from their sweep",
    "experiment": "numbers of experiments and timings (no other file has them)",
}

# By what a file must hold to be one; the first that fits.
_KINDS = {
    "run": ({"time", "position", "kinetic_energy"}, runs.problems),
    "shard": ({"cell", "member", "verdict", "steps_done"}, sweeps.of_runs),
    "sweep": ({"cell", "failing", "verdicts"}, sweeps.of_cells),
    "frontier": ({"edge", "first_pass", "limit"}, lambda dataset: []),  # its sweep says all of it
}


def kind_of(dataset: xr.Dataset) -> str:
    """Return `run`, `shard`, `sweep` or `frontier`; `experiment` for any other."""
    there = set(map(str, [*dataset.variables, *dataset.sizes]))
    return next((kind for kind, (names, _) in _KINDS.items() if names <= there), "experiment")


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a file that cannot be so: variable, place, value, and what is allowed.

    Checked are, of a run: counts, energies, the rigid body, the verdict, the ledger of the energy; of shards and
    sweeps: counts and verdicts.
    """
    kind = kind_of(dataset)
    if kind == "experiment":
        return []
    try:
        with np.errstate(all="ignore"):  # a run that blew up holds infinities
            return _KINDS[kind][1](dataset)
    except InputError as error:
        return [str(error)]
    except Exception as error:  # whatever a file that is not ours makes of what looks at it
        return [f"cannot be checked as a {kind}: {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"]
