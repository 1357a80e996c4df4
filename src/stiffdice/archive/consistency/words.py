"""Whether the words of a file are those of the registries: a number alone does not say that it means `passed`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics.contact import LAWS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.simulation import energy_budget
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.dataset import AXES
from stiffdice.simulation.outcome import Verdict
from stiffdice.sweep import stability_limits

_VERDICTS = tuple(verdict.name.lower() for verdict in Verdict)
_REGISTRIES: dict[str, Sequence[str]] = {
    "contact": tuple(LAWS),
    "cell_contact": tuple(LAWS),
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
    """Return a line for every enum whose words are not its registry's, and for a text that says another verdict.

    Registries grow at their end: the words of an older file are the first of a registry, those of a later file begin
    with all of it. A sweep holds the criteria that were asked, in the registry's order.
    """
    found = [line for name in _REGISTRIES if name in dataset for line in _of_enum(dataset, name)]
    return found or [*_of_criteria(dataset), *_of_text(dataset)]


def _of_enum(dataset: xr.Dataset, name: str) -> Iterator[str]:
    variable, known = dataset[name], list(_REGISTRIES[name])
    if "flag_meanings" not in variable.attrs:
        yield f"{name}: has no flag_meanings; allowed are {' '.join(known)}"
        return
    words = meanings_of(variable)
    if name == "criterion" and "decided" not in dataset:  # not a shard's, which tells of all
        known = [word for word in known if word in words]
    if any(word != right for word, right in zip(words, known, strict=False)) or not known:
        yield f"{name}: flag_meanings = {' '.join(words)}: allowed are {' '.join(_REGISTRIES[name])}, in this order"
    elif name in _COUNTED and variable.dims == (name,) and variable.values.tolist() != list(range(len(words))):
        yield f"{name} = {variable.values.tolist()}: allowed are 0 to {len(words) - 1}, in this order"


def _of_criteria(dataset: xr.Dataset) -> Iterator[str]:
    """A judged sweep holds the worst measure of each of its criteria."""
    if "verdicts" not in dataset or "criterion" not in dataset:
        return
    words = meanings_of(dataset["criterion"])
    there = [name for name, part in CRITERIA.items() if f"largest_{part.MEASURE}" in dataset]
    if words != there:
        yield f"criterion: flag_meanings = {' '.join(words)}: allowed are {' '.join(there)}, whose measures are there"


def _of_text(dataset: xr.Dataset) -> Iterator[str]:
    """Runs before format 1.3 said their verdict in words, too; readers now make the sentence from the verdict."""
    if "verdict_text" not in dataset.attrs or "verdict" not in dataset or dataset["verdict"].ndim:
        return
    text, verdict = str(dataset.attrs["verdict_text"]), int(np.asarray(dataset["verdict"]))
    sentence = Verdict(verdict).sentence if 0 <= verdict < len(Verdict) else ""
    if text.partition(":")[0].split()[:1] != sentence.partition(":")[0].split()[:1]:
        yield f"attribute verdict_text = {text}: allowed is what verdict says, {sentence or verdict}"
