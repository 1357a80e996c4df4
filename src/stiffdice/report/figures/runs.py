"""Figures of runs: the cube as a wireframe above its ground (1 to 3, and moving); position and energy (4 to 12)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from stiffdice.report.figures import style
from stiffdice.report.figures.registry import FRAMES_PER_SECOND, Animation
from stiffdice.report.number_format import describe, scene_of
from stiffdice.scene import die
from stiffdice.scene.cube import LINKS, SIGNS

# Where the viewer stands [degrees].
_ELEVATION, _AZIMUTH = 18, -70
# By face, its pips on a square from −1 to 1.
_CORNERS = ((-1, -1), (1, 1), (-1, 1), (1, -1))
_PIPS: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((0, 0),),
    2: _CORNERS[:2],
    3: ((0, 0), *_CORNERS[:2]),
    4: _CORNERS,
    5: ((0, 0), *_CORNERS),
    6: (*_CORNERS, (-1, 0), (1, 0)),
}
# Of one cube, and of the other.
_COLOURS = (style.BLUE, style.ORANGE)
# Seconds that an animation of a short run lasts.
_SHORTEST_ANIMATION = 6.0


def _at(runs: Mapping[str, xr.Dataset], title: str, moment: float) -> Figure:
    """Return the cube at a moment: 0 is the start of the run, 1 its end."""
    run = next(iter(runs.values()))
    index = round(moment * (run.sizes["time"] - 1))
    figure, show = _stage(run, f"{title}, t = {float(run.time[index]):.1f} s")
    show(index)
    return figure


start, middle, end = (partial(_at, moment=moment) for moment in (0.0, 0.5, 1.0))


def animation(runs: Mapping[str, xr.Dataset], title: str, *, pips: bool = False) -> Animation:
    """Return the whole run, in real time unless it would be over in less than some seconds."""
    run = next(iter(runs.values()))
    figure, show = _stage(run, title, pips)
    clock = figure.text(0.99, 0.97, "", ha="right", va="top")
    duration = float(run.time[-1])
    slower = max(1, math.ceil(_SHORTEST_ANIMATION / duration)) if duration < _SHORTEST_ANIMATION / 4 else 1
    digits = 1 if slower == 1 else 3
    told = "" if slower == 1 else f", slowed down {slower} times"
    count = max(2, round(slower * duration * FRAMES_PER_SECOND))
    indices = np.linspace(0, run.sizes["time"] - 1, count).round().astype(int)

    def frame(number: int) -> list[Any]:
        clock.set_text(f"t = {float(run.time[indices[number]]):4.{digits}f} s{told}")
        return [*show(int(indices[number])), clock]

    return Animation(figure, frame, count)


die_animation = partial(animation, pips=True)


def _stage(run: xr.Dataset, title: str, pips: bool = False) -> tuple[Figure, Callable[[int], list[Any]]]:
    """Return a figure with the ground in 3-D axes, equal in scale, and a function that shows the cubes at a sample."""
    figure = style.new_figure(title, style.PAGE, 3.2)
    figure.set_layout_engine("none")
    style.add_note(figure, describe(run, law=True))
    axes: Any = figure.add_axes((-0.26, -0.22, 1.44, 1.44), projection="3d", computed_zorder=False)
    # A box, on whole units, that holds the cube for the whole run; the unit is a metre for the cube of the paper.
    places, nodes = _motion(run)
    reach = float(np.linalg.norm(nodes[0] - places[0, :, None], axis=-1).max())
    unit = 10.0 ** math.floor(math.log10(reach / 0.5))
    low = np.floor((places.min(axis=(0, 1)) - reach) / unit) * unit
    high = np.ceil((places.max(axis=(0, 1)) + reach) / unit) * unit
    middle = (low[1] + high[1]) / 2
    low[1], high[1] = min(low[1], middle - 3 * unit), max(high[1], middle + 3 * unit)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(0.0, high[2]))
    sizes = high[0] - low[0], high[1] - low[1], high[2]
    axes.set_box_aspect(sizes, zoom=_zoom_to_fit(sizes))
    if "cube" in run.dims:
        axes.locator_params(axis="x", nbins=6)
    axes.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    # The plane n·x = 0 under the run, with a grid of two units.
    nx, ny, nz = scene_of(run)["ground"]["normal"]
    if nz != 0:  # a wall has no height over x and y
        lines = [np.arange(low[k] // (2 * unit) * 2 * unit + 2 * unit, high[k], 2 * unit) for k in (0, 1)]
        x, y = np.meshgrid(*([low[k], *lines[k], high[k]] for k in (0, 1)))
        z = -(nx * x + ny * y) / nz
        look: dict[str, Any] = {"color": style.EARTH, "edgecolor": style.FAINT, "linewidth": 0.6, "shade": False}
        axes.plot_surface(x, y, z, rstride=1, cstride=1, zorder=0, clip_on=False, **look)
        border = [0, 0, -1, -1, 0], [0, -1, -1, 0, 0]
        axes.plot(x[border], y[border], z[border], color=style.QUIET, linewidth=1.0, zorder=1, clip_on=False)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
    axes.grid(visible=False)
    axes.set_xlabel("x [m]", labelpad=10)
    axes.set_ylabel("y [m]", labelpad=2)
    axes.set_zlabel("z [m]", labelpad=-6)
    wide = 2 * unit if high[1] - low[1] < 10 * unit else 5 * unit
    axes.set_yticks(np.arange(np.ceil(low[1] / wide) * wide, high[1] + unit / 2, wide))
    axes.set_zticks([0, 2 * unit, 4 * unit] if high[2] < 8 * unit else np.arange(0, high[2] + unit / 2, 5 * unit))
    axes.tick_params(labelsize=style.SMALL, pad=-1)
    shown = [_body(axes, places[:, k], nodes[:, k], _COLOURS[k], pips) for k in range(places.shape[1])]
    return figure, lambda sample: [artist for show in shown for artist in show(sample)]


def _zoom_to_fit(sizes: tuple[float, float, float]) -> float:
    """Return the zoom at which a box with these sides, as tall as it is to the viewer, leaves room for its labels."""
    x, y, z = sizes
    elevation, azimuth = np.radians((_ELEVATION, _AZIMUTH))
    tall = z * np.cos(elevation) + (x * abs(np.cos(azimuth)) + y * abs(np.sin(azimuth))) * np.sin(elevation)
    return min(1.25, 0.46 * math.hypot(*sizes) / float(tall))


def _motion(run: xr.Dataset) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return places, shape (time, cube, 3), and nodes, shape (time, cube, 8, 3), of one cube or of two [m]."""
    places, offsets = run.position.values, run.node_offset.values
    if "cube" not in run.dims:
        places, offsets = places[:, None], offsets[:, None]
    return places, places[:, :, None] + offsets


def _body(
    axes: Any, places: npt.NDArray[np.float64], nodes: npt.NDArray[np.float64], colour: str, pips: bool
) -> Callable[[int], list[Any]]:
    """Return a function that shows a cube at a sample, its pips if asked, and the way that it has come."""
    look = {"colors": colour, "linewidths": 1.3, "zorder": 4, "clip_on": False}
    edges = axes.add_collection3d(Line3DCollection(np.zeros((1, 2, 3)), **look))
    (dots,) = axes.plot(*places[:1].T, color=style.INK, marker="o", markersize=1.4, linestyle="none", zorder=5)
    dots.set_visible(pips)
    (trace,) = axes.plot(*places[:1].T, color=style.QUIET, linewidth=0.8, zorder=3, clip_on=False)

    def show(sample: int) -> list[Any]:
        seen = _faces_in_sight(nodes[sample])
        links = [link for link in LINKS if not pips or any(_on(face, *link) for face in seen)]
        edges.set_segments(nodes[sample][np.array(links)])
        trace.set_data_3d(*places[: sample + 1].T)
        dots.set_data_3d(*_pips_on(seen, nodes[sample]).T)
        return [edges, trace, *([dots] if pips else [])]

    return show


def _faces_in_sight(nodes: npt.NDArray[np.float64]) -> list[int]:
    """Return the faces that the viewer sees of a box with these nodes, shape (8, 3)."""
    edges = SIGNS.T @ nodes
    elevation, azimuth = np.radians((_ELEVATION, _AZIMUTH))
    towards = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    facing = die.NORMALS @ edges @ towards
    return [face for face, sign in zip(die.FACES, facing, strict=True) if sign > 0]


def _on(face: int, *nodes: int) -> bool:
    """Return whether all of these nodes are on a face."""
    return bool((SIGNS[list(nodes)] @ die.NORMALS[face - 1] > 0).all())


def _pips_on(faces: Sequence[int], nodes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return where the pips of some faces are, shape (pip, 3), on a box with these nodes, shape (8, 3)."""
    edges, centre, found = SIGNS.T @ nodes / len(SIGNS), nodes.mean(axis=0), []
    for face in faces:
        normal = die.NORMALS[face - 1]
        axis = int(np.abs(normal).argmax())
        across, along = edges[(axis + 1) % 3] / 2, edges[(axis + 2) % 3] / 2
        found += [centre + normal @ edges + u * across + v * along for u, v in _PIPS[face]]
    return np.array(found)


def position(runs: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return x, y and z of the centre of mass against time; y only where the cube leaves the plane y = 0."""
    leaves_plane = any(np.abs(run.position[:, 1]).max() > 1e-9 for run in runs.values())
    shown = (0, 1, 2) if leaves_plane else (0, 2)
    figure = style.new_figure(title, height=1.1 + 0.85 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for panel, k in zip(panels, shown, strict=True):
        for preset, run in runs.items():
            panel.plot(run.time, run.position[:, k], **style.PRESET_LOOKS[preset])
        panel.set_ylabel(f"{'xyz'[k]} [m]")
    panels[-1].axhline(0, color=style.INK, linewidth=0.8, linestyle=":")
    panels[-1].annotate(
        "ground", (0.005, 0), xycoords=("axes fraction", "data"), ha="left", va="bottom", fontsize=style.SMALL
    )
    style.add_legend(figure, panels[0].get_legend_handles_labels()[0])
    return _finish(figure, panels[-1], runs)


def energy(runs: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the paper's energy and the mechanical one against time, a panel for each preset.

    The mechanical one takes the velocity at the time of the place; files of before format 1.3 lack it, and get the sum
    of the stored energies.
    """
    figure = style.new_figure(title, height=1.2 + 1.0 * len(runs))
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, (preset, run) in zip(panels, runs.items(), strict=True):
        look = style.PRESET_LOOKS[preset]
        full = run.get("mechanical_energy", run.energy_paper + run.elastic_energy)
        panel.axhline(float(full[0]), color=style.INK, linewidth=0.8, linestyle=":", label="energy at launch")
        panel.plot(run.time, full, color=style.INK, linewidth=2.0, label="mechanical: with the springs")
        panel.plot(run.time, run.energy_paper, color=look["color"], label="paper's: kinetic + m g z", zorder=3)
        panel.set_title(look["label"])
        panel.set_ylabel("energy [J]")
    handles = panels[0].get_legend_handles_labels()[0][:2]
    looks = [style.PRESET_LOOKS[preset] for preset in runs]
    handles += [style.line(f"paper's, {look['label']}: kinetic + m g z", color=look["color"]) for look in looks]
    style.add_legend(figure, handles)
    lowest = min(0.0, *(float(run.energy_paper.min()) for run in runs.values()))
    panels[0].set_ylim(bottom=lowest)  # after all is drawn: it ends the automatic scaling
    return _finish(figure, panels[-1], runs)


def _finish(figure: Figure, lowest: Any, runs: Mapping[str, xr.Dataset]) -> Figure:
    lowest.set_xlabel("time [s]")
    lowest.margins(x=0.01)
    style.add_note(figure, describe(next(iter(runs.values()))))
    return figure
