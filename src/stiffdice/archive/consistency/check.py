"""Whether the numbers of a file can be those of what it says it is: physics and bookkeeping, computed once more.

And whether its words are those of the registries: a number alone does not say that it means `passed`.

Nothing here runs a simulation. Every check follows from an equation that the file's own numbers must fulfil, and every
bound from counting the roundings between the two sides of it; none is fitted to files.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.archive.consistency import equations, pairs
from stiffdice.errors import InputError
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation import energy_budget
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.dataset import AXES
from stiffdice.simulation.outcome import Verdict
from stiffdice.sweep import stability_limits

# What of a file the checks here do not see, by its kind.
NOT_SEEN = {
    "run": "motion of runs from state to state, touch-down phases and measures (a rebuild computes them again)",
    "pair": "motion of two cubes from state to state, and how they met (another run computes them again)",
    "shard": "numbers of shards apart from their sweep",
    "sweep": "numbers of sweeps and surveys apart from their shards",
    "frontier": "numbers of frontiers apart from their sweep",
    "experiment": "numbers of experiments and timings (no other file has them)",
}

# By what a file must hold to be one; the first that fits.
_KINDS = {
    "pair": ({"time", "position", "contact_energy"}, pairs.of_pair),
    "run": ({"time", "position", "kinetic_energy"}, equations.of_run),
    "shard": ({"cell", "member", "verdict", "steps_done"}, equations.of_shard),
    "sweep": ({"cell", "failing", "verdicts"}, equations.of_cells),
    "frontier": ({"edge", "first_pass", "limit"}, lambda dataset: []),  # its sweep says all of it
    "experiment": (set[str](), lambda dataset: []),
}

_VERDICTS = tuple(verdict.name.lower() for verdict in Verdict)
_REGISTRIES: dict[str, Sequence[str]] = {
    "contact": tuple(CONTACT_LAWS),
    "cell_contact": tuple(CONTACT_LAWS),
    "verdict": _VERDICTS,
    "ending": _VERDICTS,
    "criterion": tuple(CRITERIA),
    "axis": AXES,
    "edge": tuple(stability_limits.EDGES),
    "bounce_ended": energy_budget.ENDED,
}
# Dimensions that count all words of their enum.
_COUNTED = ("criterion", "verdict", "axis", "edge")


def kind_of(dataset: xr.Dataset) -> str:
    """Return `run`, `pair`, `shard`, `sweep` or `frontier`; `experiment` for any other."""
    there = {*dataset.variables, *dataset.sizes}
    return next(kind for kind, (names, _) in _KINDS.items() if names <= there)


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a file that cannot be so: variable, place, value, and what is allowed.

    Checked are, of a run of one cube or two: counts, energies, rigid bodies, the verdict, the ledger of the energy; of
    shards and sweeps: counts and verdicts.
    """
    kind = kind_of(dataset)
    try:
        with np.errstate(all="ignore"):  # a run that blew up holds infinities
            return _KINDS[kind][1](dataset)
    except InputError as error:
        return [str(error)]
    except Exception as error:  # whatever a file that is not ours makes of what looks at it
        return [f"cannot be checked as a {kind}: {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"]


def word_problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for every enum whose words are not its registry's.

    Registries grow at their end: the words of an older file are the first of a registry, those of a later file begin
    with all of it. A sweep holds the criteria that were asked, in the registry's order, and their worst measures.
    """
    found = []
    for name, registry in _REGISTRIES.items():
        if name not in dataset:
            continue
        variable, known = dataset[name], list(registry)
        words = str(variable.attrs.get("flag_meanings", "")).split()
        if name == "criterion" and "verdicts" in dataset:
            known = [word for word in known if f"largest_{CRITERIA[word].MEASURE}" in dataset]
        elif name == "criterion" and "decided" not in dataset:  # of a frontier; a shard tells of all
            known = [word for word in known if word in words]
        if not words or not known or any(word != right for word, right in zip(words, known, strict=False)):
            found.append(f"{name}: flag_meanings = {' '.join(words)}: allowed are {' '.join(known)}, in this order")
        elif name in _COUNTED and variable.dims == (name,) and variable.values.tolist() != list(range(len(words))):
            found.append(f"{name} = {variable.values.tolist()}: allowed are 0 to {len(words) - 1}, in this order")
    return found
