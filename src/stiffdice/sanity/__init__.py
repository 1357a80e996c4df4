"""Whether the numbers of a file can be those of what it says it is: physics and bookkeeping, computed once more.

Nothing here runs a simulation. Every check follows from an equation that the file's own numbers must fulfil, and every
bound from counting the roundings between the two sides of it; none is fitted to files.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.sanity import runs, sweeps, values

# By what a file must hold to be one; the first that fits.
_KINDS = {
    "run": ({"time", "position", "kinetic_energy"}, runs.problems),
    "shard": ({"cell", "member", "verdict", "steps_done"}, sweeps.of_runs),
    "sweep": ({"cell", "failing", "verdicts"}, sweeps.of_cells),
    "frontier": ({"edge", "first_pass", "limit"}, sweeps.of_edges),
}


def kind_of(dataset: xr.Dataset) -> str:
    """Return `run`, `shard`, `sweep` or `frontier`; `experiment` for any other."""
    there = set(map(str, [*dataset.variables, *dataset.sizes]))
    return next((kind for kind, (names, _) in _KINDS.items() if names <= there), "experiment")


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a file that cannot be so: variable, place, value, and what is allowed.

    Checked are, of a run: times, energies, the rigid body, free flight, the launch, the verdict, the ledger of the
    energy; of shards, sweeps and frontiers: grids, counts, verdicts; of all: labels and enums.
    """
    kind = kind_of(dataset)
    try:
        found = values.problems(dataset)
    except Exception as error:  # whatever a file that is not ours makes of what looks at it
        return [f"its labels and enums cannot be checked: {type(error).__name__}"]
    if kind == "experiment":
        return found
    try:
        with np.errstate(all="ignore"):  # a run that blew up holds infinities
            return found + _KINDS[kind][1](dataset)
    except InputError as error:
        return [*found, str(error)]
    except Exception as error:  # whatever a file that is not ours makes of what looks at it
        reason = str(error).splitlines()[0] if str(error) else "nothing more is known"
        return [*found, f"cannot be checked as a {kind}: {type(error).__name__}: {reason}"]
