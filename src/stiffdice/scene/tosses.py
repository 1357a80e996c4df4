"""Measured tosses of a cube, from a netCDF-4 file of contiguous ragged arrays (config/measurements/README.md).

A file may come from anywhere. It is looked at as one of our own is (`io.structure_check`): plain numbers that lie in
the file, at its top. What it says is checked before anything is computed from it: no toss has a gap, every quaternion
turns and does not stretch, and the cube is never in the board.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import numpy.typing as npt

from stiffdice.errors import InputError
from stiffdice.io import isolation
from stiffdice.io.structure_check import check_size, length_of, plain_datasets, shown, told
from stiffdice.scene import die, validation
from stiffdice.scene.rotation import matrices

Array = npt.NDArray[np.float64]

# Of a variable: unit and length of its axes; None is one length for all variables that have the axis.
_VARIABLES: dict[str, tuple[str, tuple[str, ...]]] = {
    "position": ("m", ("sample", "axis")),
    "orientation": ("1", ("sample", "quaternion")),
    "row_size": ("1", ("toss",)),
    "velocity": ("m s-1", ("toss", "axis")),
    "angular_velocity": ("rad s-1", ("toss", "axis")),
}
_LENGTHS = {"axis": 3, "quaternion": 4}
_ATTRIBUTES = {"sampling_rate": "Hz", "half_width": "m", "mass": "kg", "moment_of_inertia": "kg m2"}

# A flight and a landing are known by some samples; more samples than these are hours.
_FEWEST, _MOST = 10, 10_000_000
# The length of a quaternion is one within this, as are units of length: rounding and tracking.
_STRETCH = 1e-3
# How far below the board a node may be tracked, in half widths.
_SUNK = 0.25
# How much longer than its neighbours the way from one sample to the next may be, relative and in half widths: the real
# tosses take a third of the latter.
_FARTHER, _JITTER = 1.5, 0.015


class Tosses(NamedTuple):
    """Measured tosses, one after the other; SI units.

    rate [Hz]: of the samples. half_width [m], mass [kg], moment_of_inertia [kg m²]: of the cube. counts: samples of
    each toss, shape (toss,). position [m]: of the centre, shape (sample, 3). orientation: matrices from body to world,
    shape (sample, 3, 3). velocity [m/s], angular_velocity [rad/s]: at each first sample, along the axes of the world,
    shape (toss, 3).
    """

    rate: float
    half_width: float
    mass: float
    moment_of_inertia: float
    counts: npt.NDArray[np.int64]
    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array

    @property
    def side(self) -> float:
        """The side of the cube [m]."""
        return 2 * self.half_width

    @property
    def first(self) -> npt.NDArray[np.int64]:
        """The first sample of each toss, shape (toss,)."""
        return np.cumsum(self.counts) - self.counts

    @property
    def last(self) -> npt.NDArray[np.int64]:
        """The last sample of each toss, shape (toss,)."""
        return np.cumsum(self.counts) - 1

    @property
    def time(self) -> Array:
        """Time since the first sample of its toss [s], shape (sample,)."""
        return (np.arange(len(self.position)) - np.repeat(self.first, self.counts)) / self.rate

    @property
    def clearance(self) -> Array:
        """How far the lowest node is above the board [m], shape (sample,)."""
        return np.asarray(self.position[:, 2] - self.half_width * np.abs(self.orientation[:, 2]).sum(axis=1))

    @property
    def faces(self) -> npt.NDArray[np.int8]:
        """The face that is nearest to up at each sample, 1 to 6, shape (sample,)."""
        return faces_up(self.orientation)

    def slices(self) -> list[slice]:
        """Return the samples of each toss."""
        return [slice(first, first + count) for first, count in zip(self.first, self.counts, strict=True)]

    def chosen(self, tosses: npt.NDArray[np.int64]) -> Tosses:
        """Return some of the tosses, by their numbers from 0 on."""
        slices = self.slices()
        rows = np.concatenate([np.arange(slices[k].start, slices[k].stop) for k in tosses])
        one_each = {name: getattr(self, name)[tosses] for name in ("counts", "velocity", "angular_velocity")}
        return self._replace(position=self.position[rows], orientation=self.orientation[rows], **one_each)

    def in_units_of(self, length: float) -> Tosses:
        """Return the tosses with lengths that were stored in another unit [m]; those of the cube stay."""
        return self._replace(position=self.position * length, velocity=self.velocity * length)


def faces_up(orientation: Array) -> npt.NDArray[np.int8]:
    """Return the face nearest to up, 1 to 6, of cubes turned by matrices from body to world, shape (..., 3, 3)."""
    return np.asarray((orientation[..., 2, :] @ die.NORMALS.T).argmax(axis=-1) + 1, np.int8)


def load(path: str | Path) -> Tosses:
    """Return the tosses in a file; raises InputError, naming the file, for one that is not of this form or has gaps."""
    with told(path):
        length = length_of(Path(path))
        with h5py.File(path, "r") as file:
            return _read(file, length)


def _read(file: h5py.File, length: int) -> Tosses:
    stored = dict(plain_datasets(file))
    check_size(8 * sum(int(stored[name].size) for name in _VARIABLES if name in stored), length)
    for name in _VARIABLES:
        if name not in stored:
            raise InputError(f"has no variable {name}; a file of tosses has {', '.join(_VARIABLES)}")
    _check_shapes(stored)
    numbers = {name: _attribute(file, name, unit) for name, unit in _ATTRIBUTES.items()}
    values = {name: _values(stored[name], name, unit) for name, (unit, _) in _VARIABLES.items()}
    return _checked(numbers, values)


def admitted(path: str | Path) -> Tosses:
    """Return the tosses in a file from elsewhere, tried in another process before; raises InputError as `load` does."""
    isolation.admit(path, module=__name__)
    return load(path)


def _check_shapes(stored: dict[str, h5py.Dataset]) -> None:
    lengths = dict(_LENGTHS)
    for name, (_, axes) in _VARIABLES.items():
        shape = stored[name].shape
        for axis, length in zip(axes, shape, strict=False):
            lengths.setdefault(axis, length)
        wanted = tuple(lengths[axis] for axis in axes if axis in lengths)
        if shape != wanted:
            raise InputError(f"{name}: has shape {list(shape)}: allowed is ({', '.join(axes)}) = {list(wanted)}")
    if not lengths["toss"] <= lengths["sample"] <= _MOST:
        raise InputError(f"position: has {lengths['sample']} samples: allowed are at most {_MOST}")


def _attribute(file: h5py.File, name: str, unit: str) -> float:
    """Return a number that the file has as an attribute."""
    if name not in file.attrs:
        raise InputError(f"has no attribute {name}: allowed is a number > 0 [{unit}]")
    _check_unit(name, file.attrs.get(f"{name}_units"), unit)
    return _number(name, file.attrs[name], unit)


def _number(name: str, value: Any, unit: str) -> float:
    plain = np.asarray(value)
    single = plain.item() if plain.size == 1 and plain.dtype.kind in "fiu" else shown(value)
    return validation.number(name, single, unit, above=0)


def _check_unit(name: str, found: Any, unit: str) -> None:
    text = found.decode("utf-8", "replace") if isinstance(found, bytes) else found
    if not isinstance(text, str) or text != unit:
        raise InputError(f"{name}: has the unit {shown(text)}: allowed is {unit}")


def _values(stored: h5py.Dataset, name: str, unit: str) -> Array:
    """Return a variable's values, unpacked; what netCDF calls missing is not a number."""
    _check_unit(name, stored.attrs.get("units"), unit)
    raw = np.asarray(stored[()])
    values = raw.astype(np.float64)
    for key in ("_FillValue", "missing_value"):
        if key in stored.attrs:
            values[raw == np.asarray(stored.attrs[key]).reshape(-1)[0]] = math.nan
    if "scale_factor" in stored.attrs:
        values *= _number(f"{name}: scale_factor", stored.attrs["scale_factor"], "1")
    if "add_offset" in stored.attrs:
        values += float(np.asarray(stored.attrs["add_offset"]).reshape(-1)[0])
    return values


def _checked(numbers: dict[str, float], values: dict[str, Array]) -> Tosses:
    """Return the tosses, once each is known to be whole."""
    counts = _counts(values["row_size"], len(values["position"]))
    ends = np.cumsum(counts)
    for name, found in values.items():
        if (wrong := np.flatnonzero(~np.isfinite(found.reshape(len(found), -1)).all(axis=1))).size:
            where = _place(int(wrong[0]), ends) if name in ("position", "orientation") else f"toss {wrong[0]}"
            raise InputError(f"{name}: {where}: no number; allowed are tosses without gaps")
    lengths = np.linalg.norm(values["orientation"], axis=1)
    if (wrong := np.flatnonzero(np.abs(lengths - 1) > _STRETCH)).size:
        length = lengths[wrong[0]]
        raise InputError(
            f"orientation: {_place(int(wrong[0]), ends)}: length {length:.4g}: allowed is 1 ± {_STRETCH:g}"
        )
    orientation = matrices(values["orientation"] / lengths[:, None])
    spin = np.einsum("kij,kj->ki", orientation[ends - counts], values["angular_velocity"])
    tosses = Tosses(
        rate=numbers["sampling_rate"],
        half_width=numbers["half_width"],
        mass=numbers["mass"],
        moment_of_inertia=numbers["moment_of_inertia"],
        counts=counts,
        position=values["position"],
        orientation=orientation,
        velocity=values["velocity"],
        angular_velocity=spin,
    )
    _check_places(tosses)
    return tosses


def _counts(stored: Array, samples: int) -> npt.NDArray[np.int64]:
    """Return how many samples each toss has; raises InputError unless all samples are one toss's."""
    whole = np.isfinite(stored) & (stored == np.round(stored)) & (stored >= _FEWEST) & (stored <= samples)
    if not len(stored):
        raise InputError("row_size: has no toss")
    if not whole.all():
        wrong = int(np.flatnonzero(~whole)[0])
        allowed = f"allowed is a whole number from {_FEWEST} to {samples}"
        raise InputError(f"row_size: toss {wrong}: {stored[wrong]:g} samples: {allowed}")
    if stored.sum() != samples:
        raise InputError(f"row_size: comes to {stored.sum():.0f} samples: position has {samples}")
    return stored.astype(np.int64)


def _place(sample: int, ends: npt.NDArray[np.int64]) -> str:
    toss = int(np.searchsorted(ends, sample, side="right"))
    return f"toss {toss}, sample {sample - (ends[toss - 1] if toss else 0)}"


def _check_places(found: Tosses) -> None:
    """Raise InputError for a cube that is in the board, and for one that moves as if samples were missing.

    A blow changes a velocity once: the way between two samples is then some of the way before and some of that after.
    So no way is longer than both its neighbours, but for what gravity adds.
    """
    ends, clearance = found.last + 1, found.clearance
    if (wrong := np.flatnonzero(clearance < -_SUNK * found.half_width)).size:
        depth = -clearance[wrong[0]]
        where = _place(int(wrong[0]), ends)
        raise InputError(f"position: {where}: a node {depth:.3g} m below the board: allowed are tosses above it")
    for part in found.slices():
        ways = np.linalg.norm(np.diff(found.position[part], axis=0), axis=1)
        before, after = np.append(0.0, ways[:-1]), np.append(ways[1:], 0.0)
        most = _FARTHER * np.maximum(before, after) + _JITTER * found.half_width
        if (wrong := np.flatnonzero(ways > most)).size:
            far, where = ways[wrong[0]], _place(part.start + int(wrong[0]), ends)
            told = f"its neighbours allow {most[wrong[0]]:.3g} m; is there a gap?"
            raise InputError(f"position: {where}: {far:.3g} m to the next sample: {told}")


if __name__ == "__main__":
    isolation.serve(load)
