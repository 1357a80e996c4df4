"""The figure of two boxes in other engines: what threads complain of, ours and theirs side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffdice.report.figures import style
from stiffdice.report.tables.pair_peers import NAMES, POSE_NAMES, asked, at, changes

_SIZES = {"symplectic_euler": 4.5, "mujoco": 2.5, "mujoco_default": 5, "drake": 3.5, "drake_default": 5}
_LOOKS = {way: {**style.METHOD_LOOKS[way], "markersize": size} for way, size in _SIZES.items()}
_HIGHEST = 1e3  # energies above are drawn there
_POSES = [{"marker": "o"}, {"marker": "s"}, {"marker": "D"}]


def draw(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the energy after a throw, the speed out of depth, what a small turn changes, and the depths found."""
    (found,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 6.4)
    (energy, speed), (turn, depth) = figure.subplots(2, 2)
    _energies(energy, found)
    _speeds(speed, found)
    _turns(turn, found)
    _depths(depth, found)
    handles = [
        style.line(NAMES[way], **_LOOKS[way]) for way in asked(found) if at(found, way).energy_ratio.notnull().any()
    ]
    handles += [style.mark(name, color=style.INK, fillstyle="none", markersize=3.5, **look) for name, look in _poses()]
    style.add_legend(figure, handles)
    return figure


def _lines(panel: Any, found: xr.Dataset, x: xr.DataArray, name: str, reduced: tuple[str, ...] = ()) -> None:
    """Draw a line of each method that was asked; reduced: dimensions of which the largest value is drawn."""
    for way in (way for way in asked(found) if way in _LOOKS):
        values = at(found, way)[name].max(dim=reduced) if reduced else at(found, way)[name]
        if values.notnull().any():
            panel.plot(x, np.minimum(values, _HIGHEST), label=way, **_LOOKS[way])


def _poses() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield words and mark of each pose of a cube in another."""
    return zip(POSE_NAMES.values(), _POSES, strict=True)


def _energies(panel: Any, found: xr.Dataset) -> None:
    panel.axhline(1.0, **style.THEORY)
    _lines(panel, found, found.omega_h, "energy_ratio", ("phase",))
    panel.set(xscale="log", yscale="log", ylim=(0.4, 1.4 * _HIGHEST))
    panel.set_title("drake#18241: one cube thrown at another, steps of 1 ms")
    panel.set(xlabel="ωh of face on face [1]", ylabel="largest energy after over before [1]")


def _speeds(panel: Any, found: xr.Dataset) -> None:
    _lines(panel, found, found.depth, "exit_speed")
    panel.plot(found.depth, found.energy_speed, **style.THEORY, zorder=4)
    panel.axvspan(0.5, 1.0, color=style.QUIET, alpha=0.12, linewidth=0)
    style.write_in_corner(panel, 0.04, "dashed: all energy of the springs, √(2U/mᵣ)")
    panel.text(
        0.75, 0.25, "ours: verdict deep", transform=panel.get_xaxis_transform(), ha="center", fontsize=style.SMALL
    )
    panel.set(xlim=(0.0, 1.0), ylim=(0.0, 1.15 * float(found.energy_speed.max())))
    panel.set_title("mujoco#3476: a cube put deep in another")
    panel.set(xlabel="depth over the side [1]", ylabel="speed at which they part [m/s]")


def _turns(panel: Any, found: xr.Dataset) -> None:
    for way in (way for way in asked(found) if way in _LOOKS):
        for name, look in (("force_change", {"linestyle": "-"}), ("torque_change", {"linestyle": ":"})):
            angles, most = changes(at(found, way), name)
            if np.isfinite(most).any():
                panel.plot(angles, most, label=f"{way} {name}", **_LOOKS[way] | look)
    panel.set(xscale="log", yscale="log", ylim=(1e-9, 30.0))
    style.write_in_corner(panel, 0.04, "solid: force; dotted: torque")
    panel.set_title("mujoco#2471: boxes face on face, turned by next to nothing")
    panel.set(xlabel="turn, either way, twist or tilt [rad]", ylabel="largest change from no turn [1]")


def _depths(panel: Any, found: xr.Dataset) -> None:
    ways = [way for way in asked(found) if at(found, way).depth_ratio.notnull().any()]
    for k, (name, look) in enumerate(_poses()):
        ratios = [float(at(found, way).depth_ratio[k]) for way in ways]
        places = np.arange(len(ways)) + 0.22 * (k - 1)
        panel.plot(
            ratios, places, linestyle="none", color=style.INK, fillstyle="none", markersize=3.5, label=name, **look
        )
    panel.axvline(1.0, **style.THEORY)
    panel.axvline(3**0.5, color=style.QUIET, linestyle=":")
    panel.text(3**0.5, 0.03, " √3", transform=panel.get_xaxis_transform(), fontsize=style.SMALL)
    panel.set_yticks(range(len(ways)), [NAMES[way].replace(", ", ",\n") for way in ways])
    panel.set(xlim=(0.8, 2.6), ylim=(len(ways) - 0.4, -0.6))
    panel.set_title("fcl#545: how deep a cube is found")
    panel.set(xlabel="depth found over the depth [1]")
