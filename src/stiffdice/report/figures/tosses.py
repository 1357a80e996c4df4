"""Real tosses beside the simulator's: errors over steps, over time and over the ground; chaos; one toss in motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from stiffdice.dynamics.state import Array
from stiffdice.experiments.tosses.steps import near_floor
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.figures import style
from stiffdice.report.figures.registry import FRAMES_PER_SECOND, Animation
from stiffdice.report.number_format import readable
from stiffdice.report.tables.tosses import VARIANT_WORDS
from stiffdice.scene.cube import LINKS

# By criterion: the errors against reality, those of the steps alone, what they are, factor to the unit that is shown.
_CRITERIA = {
    "path": ("path", "path_numerical", "path error [% of the side]", 100.0),
    "orientation": ("orientation", "orientation_numerical", "orientation error [°]", 180 / np.pi),
    "face": ("wrong", "face_numerical", "wrong final faces [%]", 100.0),
}
# What is shown of each; a toss is 0.4 % of the faces.
_ENDS = {"path": (1e-2, 3e3), "orientation": (1e-2, 300.0), "face": (0.3, 150.0)}

_SOURCES = {
    "sample": ("first sample", style.VERMILION, "o"),
    "flight": ("fit to the flight", style.SKY, "s"),
}
_VARIANTS: dict[str, dict[str, Any]] = {
    "full": {"color": style.INK, "linewidth": 2.2, "zorder": 4},
    "flight_launch": {"color": style.SKY, "linewidth": 1.8, "zorder": 3},
    "lengths_as_stored": {"color": style.QUIET, "linestyle": ":"},
    "solid_inertia": {"color": style.GREEN, "marker": "s"},
    "corner_inertia": {"color": style.GREEN, "linestyle": "--", "marker": "P"},
    "no_friction": {"color": style.PURPLE, "marker": "v"},
    "ungated": {"color": style.LAW_COLORS["ungated"], "linestyle": "-.", "marker": "o"},
    "no_rotation": {"color": style.VERMILION, "marker": "D"},
    "no_ground": {"color": style.VERMILION, "linestyle": "--", "marker": "^"},
    "stays": {"color": style.QUIET, "linestyle": "--", "marker": "x"},
}
_SLOWER = 4  # the animation, than the toss


def steps(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return error against reality over steps a second, a panel for each criterion, a curve for each contact time."""
    (found,) = experiments.values()
    figure = style.new_figure(title, height=6.4)
    panels = figure.subplots(3, 1, sharex=True)
    times = found.contact_time.values
    colours = [look["color"] for look in style.ordered(len(times))]
    for panel, (criterion, (name, numerical, label, factor)) in zip(panels, _CRITERIA.items(), strict=True):
        lowest, highest = _ENDS[criterion]
        for colour, time in zip(colours, times[::-1], strict=True):
            here = found.sel(contact_time=time)
            rate = steps_per_second(here)
            curve, own = (factor * here[key].mean("toss").values for key in (name, numerical))
            panel.plot(rate, curve, color=colour, linewidth=1.6, zorder=3)
            panel.plot(rate, np.maximum(own, lowest / 2), color=colour, linestyle="--", linewidth=1)
            limit = float(here.contact_frequency / here.stability_limit)
            panel.axvline(limit, color=colour, linestyle=":", linewidth=1)
            _mark_left(panel, here, criterion, factor, colour)
        floor = factor * found.floor.mean("toss").values[:, list(_CRITERIA).index(criterion)]
        panel.axhspan(floor.min() * 0.99, floor.max() * 1.01, color=style.FAINT, zorder=0)
        told = " to ".join(dict.fromkeys(readable(float(end), 3) for end in (floor.min(), floor.max())))
        last = steps_per_second(found.sel(contact_time=times[0])).max()
        style.write_beside(panel, f"the model's floor: {told}", (last, floor.min()), (0, -12), ha="right")
        panel.set(xscale="log", yscale="log", ylabel=label, ylim=(lowest, highest))
    panels[0].set_title("← time steps matter")
    panels[0].set_title("only physics does →", loc="right")
    panels[-1].set_xlabel("time steps a second [1/s]")
    pairs = zip(colours, times[::-1], strict=True)
    handles = [style.line(f"contact time {1e3 * time:g} ms", color=colour) for colour, time in pairs]
    handles += [
        style.line("against reality", color=style.INK, linewidth=2),
        style.line("against the same model without steps", color=style.INK, linestyle="--", linewidth=1),
        style.mark("5 % off the floor, with its ωh", "o", color=style.INK, markerfacecolor=style.PAPER),
        style.line("fastest contact unstable, by theory", color=style.INK, linestyle=":", linewidth=1),
    ]
    style.add_legend(figure, handles)
    about = found.attrs
    style.add_note(
        figure,
        f"{found.sizes['toss']} tosses that the fit has not seen; tumbling, symplectic euler, gated; e = "
        f"{about['restitution']:g}, μ = {about['friction']:g}; launches: {_SOURCES[about['source']][0]}; means over "
        "time and tosses; without steps: the scheme event, of faces the shortest steps",
    )
    return figure


def steps_per_second(found: xr.Dataset) -> Array:
    """Return the steps a second [1/s] of one contact time's scan in ωh."""
    return np.asarray(float(found.contact_frequency) / found.omega_h.values)


def _mark_left(panel: Any, found: xr.Dataset, criterion: str, factor: float, colour: str) -> None:
    """Mark where a curve has left its floor by 5 %."""
    k = list(_CRITERIA).index(criterion)
    left, floor = float(found.left[k]), float(found.floor.mean("toss")[k])
    if np.isfinite(left):
        place = float(found.contact_frequency) / left, factor * near_floor(criterion, floor)
        panel.plot(*place, "o", color=colour, markerfacecolor=style.PAPER, markersize=4, zorder=5)
        halo = [patheffects.withStroke(linewidth=2.5, foreground=style.PAPER)]
        style.write_beside(panel, f"{left:.2f}", place, (5, 6), color=colour, path_effects=halo, zorder=6)


def over_time(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return path and orientation error over time, a curve for each variant of the model."""
    (found,) = experiments.values()
    figure = style.new_figure(title, height=5.0)
    panels = figure.subplots(2, 1, sharex=True)
    # As long as a third of the tosses are measured: those that take longer are others.
    long = found.measured_tosses.values >= 0.33 * found.sizes["toss"]
    time = found.time.values[long]
    shown = (("path_over_time", 100.0, (0.05, 500)), ("orientation_over_time", 180 / np.pi, (0.1, 180)))
    for panel, (name, factor, ends) in zip(panels, shown, strict=True):
        for variant, values in zip(meanings_of(found.variant), found[name].values, strict=True):
            label, look = VARIANT_WORDS[variant], _VARIANTS[variant]
            panel.plot(time, factor * values[long], label=label, markersize=3, markevery=0.15, **look)
        panel.set(yscale="log", ylim=ends)
    panels[0].set_ylabel("path error [% of the side]")
    panels[1].set(ylabel="orientation error [°]", xlabel="time since the first sample [s]", xlim=(0, time[-1]))
    style.add_legend(figure, panels[0].get_legend_handles_labels()[0])
    about = found.attrs
    style.add_note(
        figure,
        f"means over those of {found.sizes['toss']} tosses that are still measured; e = {about['restitution']:g}, "
        f"μ = {about['friction']:g}, contact time {1e3 * about['contact_time']:g} ms in all variants",
    )
    return figure


def fit(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return the loss over restitution and friction, and what is left of the errors by contact time."""
    (found,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 4.0)
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.05, 1))
    left, right = halves
    panel: Any = left.subplots()
    middle = float(found.attrs["landscape_contact_time"])
    drawn = panel.contourf(
        found.friction_tried, found.restitution_tried, found.landscape, levels=20, cmap=style.LOSS, extend="both"
    )
    left.colorbar(drawn, ax=panel, label="mean loss of the fitted tosses [sides + rad]")
    best = found.isel(source=0).sel(contact_time=middle)
    ends = [
        [[float(best[name] - best[f"{name}_low"])], [float(best[f"{name}_high"] - best[name])]]
        for name in ("friction", "restitution")
    ]
    at = float(best.friction), float(best.restitution)
    panel.errorbar(
        *at, xerr=ends[0], yerr=ends[1], fmt="o", color=style.PAPER, markeredgecolor=style.INK, ecolor=style.PAPER
    )
    text = f"e = {at[1]:.2g}, μ = {at[0]:.2g}"
    style.write_beside(panel, text, at, (8, 8), fontweight="bold")
    panel.set(xlabel="friction coefficient μ [1]", ylabel="restitution e [1]")
    panel.set_title(f"first sample's launches, contact time {1e3 * middle:g} ms")
    panel.grid(visible=False)
    style.add_legend(figure, _floors(right.subplots(3, 1, sharex=True), found), "launches")
    style.add_note(
        figure,
        f"fitted on {int(found.attrs['fitted'])} random tosses, told on the other {found.sizes['toss']}; bars: 95 % by "
        "resampling tosses",
    )
    return figure


def _floors(panels: Any, found: xr.Dataset) -> list[Any]:
    """Draw the errors that stay by contact time, and return what a legend shows."""
    times = 1e3 * found.contact_time.values
    shown = (
        ("path", 100.0, "path error\n[% of the side]"),
        ("orientation", 180 / np.pi, "orientation\nerror [°]"),
        ("right", 100.0, "right final\nfaces [%]"),
    )
    for panel, (name, factor, label) in zip(panels, shown, strict=True):
        for source, row in zip(meanings_of(found.source), found[name].values, strict=True):
            words, colour, mark = _SOURCES[source]
            means, spread = factor * row.mean(axis=1), 1.96 * factor * row.std(axis=1) / np.sqrt(row.shape[1])
            panel.errorbar(times, means, spread, color=colour, marker=mark, markersize=4, label=words, capsize=2)
        panel.set(xscale="log", ylabel=label)
    kept = 100 * float(found.attrs["kept_face"])
    panels[2].axhline(kept, **style.THEORY)
    style.write_beside(panels[2], "face kept from the start", (times[0], kept), (0, 3))
    panels[2].set(ylim=(30, 100), xlabel="contact time of a flat landing [ms]")
    panels[2].set_xticks(times, [f"{time:g}" for time in times])
    panels[2].minorticks_off()
    panels[0].set_title("what is left, e and μ fitted at each contact time")
    return panels[0].get_legend_handles_labels()[0]


def chaos(experiments: Mapping[str, xr.Dataset], title: str) -> Figure:
    """Return shares of final faces over the size of the launch's error, in units of the tracker's."""
    (found,) = experiments.values()
    figure = style.new_figure(title, style.PAGE, 3.2)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    sizes = found["size"].values
    curves = (
        ("likeliest", "right at best, were the model exact", "-"),
        ("right", "right, launches perturbed", "--"),
        ("changed", "face changed", ":"),
    )
    for panel, (k, source) in zip(panels, enumerate(meanings_of(found.source)), strict=True):
        words, colour, _ = _SOURCES[source]
        for name, _, dashes in curves:
            panel.plot(sizes, 100 * found[name][k].mean("toss"), color=colour, linestyle=dashes)
        alone = 100 * float(found.unperturbed[k].mean())
        panel.axhline(alone, color=style.INK, linewidth=0.8)
        style.write_beside(panel, f"right, as launched: {alone:.0f} %", (sizes[0], alone), (0, 3))
        panel.axvline(1, color=style.QUIET, linewidth=0.8)
        panel.set(xscale="log", ylim=(0, 101), xlabel="launch's error over the tracker's [1]")
        panel.set_title(f"launches: {words}")
    panels[0].set_ylabel("share of tosses [%]")
    handles = [style.line(label, color=style.INK, linestyle=dashes) for _, label, dashes in curves]
    style.add_legend(figure, handles)
    about = found.attrs
    place, turn = 1e3 * about["tracker_position"], np.degrees(about["tracker_orientation"])
    speed, spin = 1e3 * about["tracker_velocity"], about["tracker_angular_velocity"]
    note = (
        f"{found.sizes['toss']} tosses, {int(about['draws'])} draws each; tracker: {place:.2g} mm and {turn:.2g}° a "
        f"sample; first sample's velocity: {speed:.2g} mm/s and {spin:.2g} rad/s along each axis"
    )
    style.add_note(figure, note)
    return figure


def animation(experiments: Mapping[str, xr.Dataset], title: str) -> Animation:
    """Return one toss beside its simulation, four times slower than it was."""
    (found,) = experiments.values()
    nodes = [found[f"{name}_nodes"].values for name in ("measured", "simulated")]
    figure = style.new_figure(title, 6.4, 3.6)
    figure.set_layout_engine("none")
    axes: Any = figure.add_axes((-0.12, -0.18, 1.24, 1.3), projection="3d", computed_zorder=False)
    every = np.concatenate(nodes)
    low, high = every.min(axis=(0, 1)) - 0.03, every.max(axis=(0, 1)) + 0.03
    low[2] = 0.0
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.15)
    axes.view_init(elev=16, azim=_azimuth(found))
    x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
    axes.plot_surface(
        x, y, 0 * x, color=style.EARTH, edgecolor=style.QUIET, linewidth=0.6, shade=False, zorder=0, clip_on=False
    )
    axes.set_axis_off()
    looks = (("measured", style.INK, 1.8), ("simulated", style.VERMILION, 1.3))
    edges, traces = [], []
    for _, colour, width in looks:
        collection = Line3DCollection(np.zeros((1, 2, 3)), colors=colour, linewidths=width, zorder=4, clip_on=False)
        edges.append(axes.add_collection3d(collection))
        traces.append(axes.plot([], [], [], color=colour, linewidth=0.8, zorder=3, clip_on=False)[0])
    figure.legend(
        handles=[style.line(name, color=colour, linewidth=width) for name, colour, width in looks],
        loc="upper right", bbox_to_anchor=(0.99, 0.92),
    )  # fmt: skip
    clock = figure.text(0.01, 0.03, "")
    # Half a second more at rest.
    count = round(float(found.time[-1]) * FRAMES_PER_SECOND * _SLOWER) + FRAMES_PER_SECOND // 2
    last = found.sizes["time"] - 1
    samples = np.minimum(np.arange(count) / (FRAMES_PER_SECOND * _SLOWER) / float(found.time[1]), last).astype(int)
    places = [found[f"{name}_position"].values for name in ("measured", "simulated")]

    def frame(number: int) -> list[Any]:
        sample = int(samples[number])
        for k in range(2):
            edges[k].set_segments(nodes[k][sample][np.array(LINKS)])
            traces[k].set_data_3d(*places[k][: sample + 1].T)
        clock.set_text(f"t = {float(found.time[sample]):.2f} s, {_SLOWER} times slower")
        return [*traces, *edges, clock]

    return Animation(figure, frame, count)


def _azimuth(found: xr.Dataset) -> float:
    """Return where to look from [°]: across the way of the toss."""
    way = found.measured_position.values[-1] - found.measured_position.values[0]
    return float(np.degrees(np.arctan2(way[1], way[0]))) - 75.0
