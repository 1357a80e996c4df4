"""The table of two boxes in other engines, and what its figure takes from the dataset, too."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import readable

NAMES = {
    "symplectic_euler": "stiffdice",
    "mujoco": "MuJoCo, our springs",
    "mujoco_default": "MuJoCo, its default contact",
    "mujoco_mesh": "MuJoCo, convex meshes",
    "drake": "Drake, springs alone",
    "drake_default": "Drake, its default dashpot",
    "drake_convex": "Drake, convex shapes (FCL)",
}
POSE_NAMES = {
    "face_to_face": "face to face, 20 µm",
    "corner": "corner in corner",
    "corner_deep": "small cube all inside",
}
# More energy than this, over that at the launch, is too much.
_TOO_MUCH = 1.05

_COLUMNS = [
    "method",
    "energy within 5 % up to ωh [1]",
    "most energy after over before [1]",
    "speed out of 10 % over √(2U/mᵣ) [1]",
    "out of the deepest [1]",
    "jump of the force [1]",
    "jump of the torque [1]",
    "height at rest changes by [µm]",
    "contact lost and found at rest [1]",
    "depth over the depth, at most [1]",
]


def asked(found: xr.Dataset) -> list[str]:
    """Return the methods of a dataset, and how each was asked."""
    return meanings_of(found.method)


def at(found: xr.Dataset, way: str) -> xr.Dataset:
    """Return what was found by a method."""
    return found.isel(method=asked(found).index(way))


def changes(part: xr.Dataset, name: str) -> tuple[Array, Array]:
    """Return sizes of turns [rad], ascending, and the largest change at each, of turns of any kind either way."""
    largest = part[name].max(dim="turn").values
    angles = part.angle.values
    sizes = np.unique(angles[angles > 0])
    return sizes, np.array([largest[np.abs(angles) == size].max() for size in sizes])


def table(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method and how it was asked."""
    (found,) = experiments.values()
    rows = [[NAMES[way], *_row(found, at(found, way))] for way in asked(found)]
    least = readable(float(changes(at(found, asked(found)[0]), "force_change")[0][0]))
    step, fine = (f"{found.attrs[name] * 1e3:g} ms" for name in ("step", "fine_step"))
    note = (
        f"Steps of {step}, out of depth of {fine}. A jump is the largest change at a turn by {least} rad, over the "
        "force, or over that times half of the box's length; heights change with the twist. An empty cell was not "
        f"asked. Engines: {found.attrs.get('engine_versions', 'none')}."
    )
    return rendered(title, _COLUMNS, rows, note)


def _row(found: xr.Dataset, part: xr.Dataset) -> list[str]:
    energy = part.energy_ratio.max(dim="phase", skipna=False).values
    speeds = part.exit_speed.values / found.energy_speed.values
    known = np.flatnonzero(np.isfinite(speeds))
    near = int(np.abs(found.depth.values - 0.1).argmin())
    height = part.rest_height.values
    numbers = [
        _longest(found.omega_h.values, energy),
        float(part.energy_ratio.max()),
        float(speeds[near]),
        float(speeds[known[-1]]) if known.size else np.nan,
        float(changes(part, "force_change")[1][0]),
        float(changes(part, "torque_change")[1][0]),
        float(np.abs(height - height[0]).max()) * 1e6,
        float(part.switches.sum(skipna=False)),
        float(part.depth_ratio.max()),
    ]
    return [readable(number, 3) if np.isfinite(number) else "" for number in numbers]


def _longest(omega_h: Array, energy: Array) -> float:
    """Return the last ωh before energy grows too much; not-a-number where nothing was asked."""
    if np.isnan(energy).all():
        return np.nan
    good = energy <= _TOO_MUCH
    return float(omega_h[-1] if good.all() else omega_h[max(0, int((~good).argmax()) - 1)])
