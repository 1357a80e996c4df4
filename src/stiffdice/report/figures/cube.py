"""Figures 1 to 3 and the animation: the cube as a wireframe above its ground."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from stiffdice.dynamics.state import Array
from stiffdice.report.figures import style
from stiffdice.report.figures.registry import FRAMES_PER_SECOND, Animation
from stiffdice.report.number_format import describe, scene_of
from stiffdice.scene.cube import LINKS


def _at(runs: Mapping[str, xr.Dataset], title: str, moment: float) -> Figure:
    """Return the cube at a moment: 0 is the start of the run, 1 its end."""
    run = next(iter(runs.values()))
    index = round(moment * (run.sizes["time"] - 1))
    figure, axes = _room(run, f"{title}, t = {float(run.time[index]):.1f} s")
    _edges(axes).set_segments(_links(run, index))
    _path(axes, run, index)
    style.add_note(figure, describe(run, law=True))
    return figure


start, middle, end = (partial(_at, moment=moment) for moment in (0.0, 0.5, 1.0))


def animation(runs: Mapping[str, xr.Dataset], title: str) -> Animation:
    """Return the whole run in real time."""
    run = next(iter(runs.values()))
    figure, axes = _room(run, title)
    style.add_note(figure, describe(run, law=True))
    edges, trace = _edges(axes), _path(axes, run, 0)
    clock = figure.text(0.99, 0.97, "", ha="right", va="top")
    count = max(2, round(float(run.time[-1]) * FRAMES_PER_SECOND))
    indices = np.linspace(0, run.sizes["time"] - 1, count).round().astype(int)

    def show(frame: int) -> list[Any]:
        index = int(indices[frame])
        edges.set_segments(_links(run, index))
        position = run.position.values[: index + 1]
        trace.set_data_3d(position[:, 0], position[:, 1], position[:, 2])
        clock.set_text(f"t = {float(run.time[index]):4.1f} s")
        return [edges, trace, clock]

    return Animation(figure, show, count)


def _links(run: xr.Dataset, index: int) -> Array:
    """Return the ends of the twelve links [m], shape (12, 2, 3)."""
    nodes = run.position.values[index] + run.node_offset.values[index]
    return np.asarray(nodes[np.array(LINKS)])


def _edges(axes: Any) -> Line3DCollection:
    return axes.add_collection3d(
        Line3DCollection(np.zeros((1, 2, 3)), colors=style.BLUE, linewidths=1.3, zorder=4, clip_on=False)
    )


def _path(axes: Any, run: xr.Dataset, index: int) -> Any:
    (line,) = axes.plot(*run.position.values[: index + 1].T, color=style.QUIET, linewidth=0.8, zorder=3, clip_on=False)
    return line


def _room(run: xr.Dataset, title: str) -> tuple[Figure, Any]:
    """Return a figure with 3-D axes, equal in scale, that hold the whole run, and the ground drawn in."""
    figure = style.new_figure(title, height=3.2)
    figure.set_layout_engine("none")
    axes: Any = figure.add_axes((-0.26, -0.22, 1.44, 1.44), projection="3d", computed_zorder=False)
    low, high = _limits(run)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(0.0, high[2]))
    axes.set_box_aspect((high[0] - low[0], high[1] - low[1], high[2]), zoom=1.25)
    axes.view_init(elev=18, azim=-70)
    _draw_ground(axes, run, low, high)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
    axes.grid(visible=False)
    axes.set_xlabel("x [m]", labelpad=10)
    axes.set_ylabel("y [m]", labelpad=2)
    axes.set_zlabel("z [m]", labelpad=-6)
    axes.set_yticks(np.arange(np.ceil(low[1] / 2) * 2, high[1] + 1, 2))
    axes.set_zticks([0, 2, 4])
    axes.tick_params(labelsize=7.5, pad=-1)
    return figure, axes


def _limits(run: xr.Dataset) -> tuple[Array, Array]:
    """Return the corners of a box, on whole metres, that holds the cube for the whole run."""
    reach = float(np.linalg.norm(run.node_offset.values[0], axis=-1).max())
    low = np.floor(run.position.values.min(axis=0) - reach)
    high = np.ceil(run.position.values.max(axis=0) + reach)
    middle = (low[1] + high[1]) / 2
    low[1], high[1] = min(low[1], middle - 3), max(high[1], middle + 3)
    return low, high


def _draw_ground(axes: Any, run: xr.Dataset, low: Array, high: Array) -> None:
    """Draw the plane n·x = 0 under the run, with a grid of two metres."""
    nx, ny, nz = scene_of(run)["ground"]["normal"]
    if nz == 0:
        return  # a wall has no height over x and y

    def lifted(x: float, y: float) -> tuple[float, float, float]:
        return x, y, -(nx * x + ny * y) / nz

    corners = [lifted(x, y) for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    axes.add_collection3d(
        Poly3DCollection([corners], facecolors="#f3eee4", edgecolors=style.QUIET, zorder=0, clip_on=False)
    )
    lines = [(lifted(x, low[1]), lifted(x, high[1])) for x in np.arange(np.ceil(low[0] / 2) * 2, high[0], 2)]
    lines += [(lifted(low[0], y), lifted(high[0], y)) for y in np.arange(np.ceil(low[1] / 2) * 2, high[1], 2)]
    axes.add_collection3d(Line3DCollection(lines, colors=style.FAINT, linewidths=0.6, zorder=1, clip_on=False))
