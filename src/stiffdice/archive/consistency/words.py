"""Whether the words of a file are those of the registries: a number alone does not say that it means `passed`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import xarray as xr

from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.simulation import energy_budget
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.dataset import AXES
from stiffdice.simulation.outcome import Verdict
from stiffdice.sweep import stability_limits

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


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for every enum whose words are not its registry's.

    Registries grow at their end: the words of an older file are the first of a registry, those of a later file begin
    with all of it. A sweep holds the criteria that were asked, in the registry's order, and their worst measures.
    """
    return [line for name in _REGISTRIES if name in dataset for line in _of_enum(dataset, name)]


def _of_enum(dataset: xr.Dataset, name: str) -> Iterator[str]:
    variable, known = dataset[name], list(_REGISTRIES[name])
    words = str(variable.attrs.get("flag_meanings", "")).split()
    if name == "criterion" and "verdicts" in dataset:
        known = [word for word in known if f"largest_{CRITERIA[word].MEASURE}" in dataset]
    elif name == "criterion" and "decided" not in dataset:  # of a frontier; a shard tells of all
        known = [word for word in known if word in words]
    if not words or not known or any(word != right for word, right in zip(words, known, strict=False)):
        yield f"{name}: flag_meanings = {' '.join(words)}: allowed are {' '.join(known)}, in this order"
    elif name in _COUNTED and variable.dims == (name,) and variable.values.tolist() != list(range(len(words))):
        yield f"{name} = {variable.values.tolist()}: allowed are 0 to {len(words) - 1}, in this order"
