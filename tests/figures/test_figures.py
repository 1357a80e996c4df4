from __future__ import annotations

import struct

import numpy as np
import pytest
from matplotlib.animation import FuncAnimation
from PIL import Image
from tests.test_sweep import plan  # noqa: F401

from stiffdice import figures, frontier, sweep
from stiffdice.figures import captions, style
from stiffdice.io.layout import run_dataset
from stiffdice.scene import from_mapping
from stiffdice.simulate import simulate


def dataset(model, preset, **keys):
    scene = from_mapping(keys, preset=preset)
    return run_dataset(simulate(scene, model=model, steps=3000, every=10))


@pytest.fixture(scope="module")
def data(plan):  # noqa: F811
    presets = ("as_listed", "as_written")
    spin = {"angular_momentum": {"seed": 1}}
    throw = {preset: dataset("tumbling", preset, launch=spin, duration=2) for preset in presets}
    slide = {preset: dataset("sliding", preset, ground={"stiffness": 1e5}) for preset in presets}
    collected = sweep.collect([sweep.compute(plan, cells) for cells in plan.shards().values()])
    both = {"frontier": frontier.find(collected, {})}
    return {"cube": throw, "anim": throw, "posi": slide, "ener": slide, "fron": both}


@pytest.mark.parametrize("drawing", [name for name in figures.DRAWINGS if name != "animation"])
def test_each_drawing_has_units_on_its_axes_and_gives_equal_files(data, tmp_path, drawing):
    given = data[drawing[:4]]
    with style.applied():
        figure = figures.DRAWINGS[drawing](given, "A title")
        for axes in figure.axes:
            outer = axes.get_subplotspec() is None or axes.get_subplotspec().is_last_row()
            assert not outer or "[" in axes.get_xlabel(), axes
            first = axes.get_subplotspec() is None or axes.get_subplotspec().is_first_col()
            assert not first or "[" in axes.get_ylabel(), axes
    for name in "ab":
        figures.draw(drawing, given, "A title", 80, [str(tmp_path / f"{name}.{kind}") for kind in ("svg", "png")])
    for kind in ("svg", "png"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    width, height = struct.unpack(">II", (tmp_path / "a.png").read_bytes()[16:24])
    assert min(width, height) > 200
    assert np.asarray(Image.open(tmp_path / "a.png").convert("L")).std() > 5  # not blank


def test_the_animation_runs_in_real_time(data, tmp_path):
    path = tmp_path / "throw.gif"
    figures.draw("animation", data["cube"], "The throw", 80, [str(path)])
    with Image.open(path) as gif:
        times = []
        for frame in range(gif.n_frames):
            gif.seek(frame)
            times.append(gif.info["duration"])
    assert sum(times) == pytest.approx(2000, abs=100)  # ms, of a throw of 2 s


def test_the_animation_shows_the_cube_where_it_is(data):
    run = data["cube"]["as_listed"]
    with style.applied():
        animation = figures.cube.animation(data["cube"], "The throw")
        assert isinstance(animation, FuncAnimation)
        edges, trace, clock = animation._func(39)
    assert clock.get_text() == "t =  2.0 s"
    assert trace.get_data_3d()[2][-1] == run.position[-1, 2]
    corners = np.asarray(edges._segments3d).reshape(-1, 3)
    centre = run.position.values[-1]
    np.testing.assert_allclose(corners.mean(axis=0), centre, atol=1e-12)
    animation._draw_was_started = True  # it is not to be played


def test_a_tilted_ground_is_drawn_where_it_is(data):
    tilted = {"normal": [0.3, 0.1, 1.0]}
    run = {"as_listed": dataset("tumbling", "as_listed", ground=tilted, launch={"position": [0, 0, 4]}, duration=1)}
    with style.applied():
        figure = figures.DRAWINGS["cube-end"](run, "Slope")
        ground = figure.axes[0].collections[1] if len(figure.axes[0].collections) > 1 else figure.axes[0].collections[0]
    assert ground is not None


@pytest.mark.parametrize(
    ("value", "text"),
    [(1e6, "10⁶"), (2.5e4, "2.5×10⁴"), (0.075, "0.075"), (0, "0"), (1e-6, "10⁻⁶"), (9999, "9999"), (1e-3, "0.001")],
)
def test_numbers_are_written_as_people_do(value, text):
    assert captions.readable(value) == text


def test_an_energy_that_rises_is_seen(data):
    """The axis holds all of both energies: nothing is cropped."""
    with style.applied():
        figure = figures.DRAWINGS["energy"](data["posi"], "Energy")
    for axes, run in zip(figure.axes, data["posi"].values(), strict=True):
        low, high = axes.get_ylim()
        full = run.energy_paper + run.elastic_energy
        assert low <= float(run.energy_paper.min())
        assert high >= float(full.max())
