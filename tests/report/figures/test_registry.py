from __future__ import annotations

import re
import struct
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from tests.report.figures.drawing import check_equal_files, check_units, drawn, lines_of

from stiffdice import __version__
from stiffdice.report.figures import registry as figures
from stiffdice.report.figures import runs, style
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.study.catalogue import DRAWINGS
from stiffdice.sweep import stability_limits


def dataset(model, preset, **keys):
    scene = from_mapping(keys, preset=preset)
    return run_dataset(simulate(scene, model=model, steps=3000, every=10))


@pytest.fixture(scope="module")
def data(collected):
    presets = ("as_listed", "as_written")
    spin = {"angular_momentum": {"seed": 1}}
    throw = {preset: dataset("tumbling", preset, launch=spin, duration=2) for preset in presets}
    slide = {preset: dataset("sliding", preset, ground={"stiffness": 1e5}) for preset in presets}
    return {"cube": throw, "posi": slide, "ener": slide, "fron": {"steps-needed": stability_limits.find(collected)}}


# Those of experiments and other sweeps are tested where they are defined.
@pytest.mark.parametrize(
    "drawing",
    [name for name, entry in DRAWINGS.items() if entry.given == "runs" and name != "animation"] + ["frontier"],
)
@pytest.mark.long
def test_each_drawing_has_units_on_its_axes_and_gives_equal_files(data, tmp_path, drawing):
    given = data[drawing[:4]]
    check_units(drawn(drawing, given))
    check_equal_files(drawing, given, tmp_path)
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")
    width, height = struct.unpack(">II", (tmp_path / "a.png").read_bytes()[16:24])
    assert min(width, height) > 200
    assert np.asarray(Image.open(tmp_path / "a.png").convert("L")).std() > 5  # not blank


def test_the_animation_runs_in_real_time(data, tmp_path):
    path = tmp_path / "throw.gif"
    figures.draw("animation", data["cube"], "The throw", 80, [str(path)])
    with Image.open(path) as gif:
        times, cubes = [], set()
        for frame in range(gif.n_frames):
            gif.seek(frame)
            times.append(gif.info["duration"])
            red, _, blue = np.moveaxis(np.asarray(gif.convert("RGB"), np.int64), -1, 0)
            cubes.add(tuple(np.argwhere(blue - red > 100).mean(axis=0).round(1)))  # where it is
    assert len(cubes) > 0.9 * len(times)
    assert sum(times) == pytest.approx(2000, abs=100)  # ms, of a throw of 2 s


def test_the_animation_shows_the_cube_where_it_is(data):
    run = data["cube"]["as_listed"]
    with style.applied():
        animation = runs.animation(data["cube"], "The throw")
        edges, trace, clock = animation.show(39)
    assert clock.get_text() == "t =  2.0 s"
    assert trace.get_data_3d()[2][-1] == run.position[-1, 2]
    corners = np.asarray(edges._segments3d).reshape(-1, 3)
    centre = run.position.values[-1]
    np.testing.assert_allclose(corners.mean(axis=0), centre, atol=1e-12)


def test_a_die_shows_the_pips_of_the_faces_in_sight_and_no_hidden_edge(data):
    run = {"throw": data["cube"]["as_listed"].isel(time=slice(0, 3))}
    with style.applied():
        animation = runs.die_animation(run, "A die")
        edges, _, dots, clock = animation.show(0)
    assert "slowed down" in clock.get_text()
    assert len(edges._segments3d) in (4, 7, 9)  # of one face, two or three
    places = np.stack(dots.get_data_3d(), axis=1) - run["throw"].position.values[0]
    half = run["throw"].node_offset.values[0].T @ SIGNS / 8
    along = places @ np.linalg.inv(half).T
    np.testing.assert_allclose(np.abs(along).max(axis=1), 1, atol=1e-9)  # each on a face
    assert len(along) in (6, 7, 9, 10, 11, 14, 15) or len(along) <= 6


def test_the_cube_is_drawn_turned_as_it_is(data):
    run = data["cube"]["as_listed"]
    for drawing, moment in (("cube-start", 0.0), ("cube-middle", 0.5), ("cube-end", 1.0)):
        axes = drawn(drawing, data["cube"]).axes[0]
        index = round(moment * (run.sizes["time"] - 1))
        (cube,) = (part for part in axes.collections if len(getattr(part, "_segments3d", ())) == 12)
        corners = np.unique(np.asarray(cube._segments3d).reshape(-1, 3).round(9), axis=0)
        expected = np.unique((run.position.values[index] + run.node_offset.values[index]).round(9), axis=0)
        np.testing.assert_allclose(corners, expected, atol=1e-8)


def test_a_tilted_ground_is_drawn_where_it_is(data):
    tilted = {"normal": [0.3, 0.1, 1.0]}
    run = {"as_listed": dataset("tumbling", "as_listed", ground=tilted, launch={"position": [0, 0, 4]}, duration=1)}
    axes = drawn("cube-end", run).axes[0]
    (ground,) = (part for part in axes.collections if hasattr(part, "_faces"))
    np.testing.assert_allclose(np.asarray(ground._faces).reshape(-1, 3) @ tilted["normal"], 0, atol=1e-9)


def test_position_is_drawn_for_both_readings(data):
    figure = drawn("position", data["cube"])
    for k, axes in enumerate(figure.axes):
        for preset, label in (("as_listed", "as listed"), ("as_written", "as written")):
            run = data["cube"][preset]
            np.testing.assert_array_equal(lines_of(axes)[label], np.stack([run.time, run.position[:, k]], axis=1))


def test_energy_is_drawn_with_and_without_the_springs(data):
    figure = drawn("energy", data["ener"])
    for axes, run in zip(figure.axes, data["ener"].values(), strict=True):
        lines = lines_of(axes)
        np.testing.assert_array_equal(lines["paper's: kinetic + m g z"][:, 1], run.energy_paper)
        np.testing.assert_array_equal(lines["mechanical: with the springs"][:, 1], run.mechanical_energy)
        # The launch's velocity counts as half a step old, as every later one: 54.4 J less m g h/2 times 5 m/s.
        late = 9.8 * run.attrs["step_size"] / 2 * (5 - 9.8 * run.attrs["step_size"] / 4)
        np.testing.assert_allclose(lines["energy at launch"][:, 1], 54.4 - late, rtol=1e-13)


CRITERIA = ["energy", "apex"]
LAST_FAIL = 1


def test_the_frontier_is_drawn_where_it_is(data):
    found = data["fron"]["steps-needed"]
    figure = drawn("frontier", data["fron"])
    upper, lower = figure.axes[1], figure.axes[3]  # the gated column
    lines = [np.asarray(line.get_xydata()) for line in upper.get_lines()]
    wanted = [found.limit.values]
    for c in range(len(CRITERIA)):
        wanted += [found.last_fail.values[1, c], found.first_pass.values[1, c]]
        factor, exponent = (found[name].values[1, c, LAST_FAIL] for name in ("factor", "exponent"))
        wanted += [factor * found.stiffness.values**exponent]
    assert len(lines) == len(wanted)
    for line, values in zip(lines, wanted, strict=True):
        np.testing.assert_allclose(line, np.stack([found.stiffness, values], axis=1))
    full = [line for line in upper.get_lines() if line.get_markerfacecolor() != "none" and line.get_marker() != "None"]
    assert len(full) == len(CRITERIA)  # last fail is the full mark
    below = [np.asarray(line.get_xydata())[:, 1] for line in lower.get_lines()]
    assert set(below[0]) == {2.0}
    np.testing.assert_allclose(below[1], np.sqrt(4 * found.stiffness) * 10 / found.last_fail.values[1, 0])
    dots = lower.collections[0]
    inside = found.cell_contact.values == 1
    np.testing.assert_allclose(dots.get_offsets()[:, 1], found.cell_omega_h.values[inside])
    np.testing.assert_allclose(dots.get_array(), 1 - found.pass_fraction.values[:, inside].min(axis=0))


def test_the_band_about_a_law_is_drawn(data):
    found = data["fron"]["steps-needed"]
    upper = drawn("frontier", data["fron"]).axes[1]
    fits = {name: float(found[name].values[1, 1, LAST_FAIL]) for name in stability_limits.FIT}
    low, high = stability_limits.band(fits, found.stiffness.values)
    outlines = [path.vertices for part in upper.collections for path in part.get_paths()]
    for edge in (low, high):
        points = np.stack([found.stiffness.values, edge], axis=1)
        assert any(all(np.isclose(outline, point).all(axis=1).any() for point in points) for outline in outlines)


def test_each_sweep_has_its_columns_and_each_criterion_its_look(data):
    one = data["fron"]["steps-needed"]
    figure = drawn("frontier", {"a": one, "b": one.assign_attrs(model="tumbling").isel(contact=[1])})
    titles = [axes.get_title(loc="left") for axes in figure.axes[:3]]
    assert titles == [
        "a cube that slides, as listed (ungated)",
        "a cube that slides, as written (gated)",
        "a cube that tumbles, as written (gated)",
    ]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    for words in ("airborne energy ≤ 1.05 E₀", "apex ≤ 1.02 × the one before, from 0.1 m on"):
        assert f"first pass: {words}" in labels
        assert f"last fail: {words}" in labels


def test_an_energy_that_rises_is_seen(data):
    """The axis holds all of both energies: nothing is cropped."""
    figure = drawn("energy", data["posi"])
    for axes, run in zip(figure.axes, data["posi"].values(), strict=True):
        low, high = axes.get_ylim()
        full = run.energy_paper + run.elastic_energy
        assert low <= float(run.energy_paper.min())
        assert high >= float(full.max())


@pytest.mark.parametrize("kind", figures.FORMATS)
def test_a_file_says_what_it_is_made_from(data, kind, tmp_path):
    """In each format, where its readers look for it; and as bytes, where anything finds it."""
    run, path = data["cube"]["as_listed"], tmp_path / f"a.{kind}"
    made_from = {"study": "mine", "file as_listed": "0123abcd"}
    figures.draw("cube-end", {"as_listed": run}, "Heights, in µm", 50, [str(path)], made_from)
    told = figures.provenance({"as_listed": run}, {"drawing": "cube-end", **made_from})
    assert told.startswith(
        f"stiffdice {__version__}; drawing cube-end; study mine; file as_listed 0123abcd; as_listed: "
    )
    assert f"scene {run.attrs['scene_digest'][:16]}" in told
    assert f"code {run.attrs['code_digest'][:16]}" in told
    content = path.read_bytes()
    assert re.search(rb"stiffdice [0-9.]+; [ -(*-;=-~]*;", content)[0] == told.encode()
    if kind == "png":
        with Image.open(path) as image:
            assert image.text == {
                "Title": "Heights, in µm",
                "Description": told,
                "Software": f"stiffdice {__version__}",
            }
    elif kind == "svg":
        work = ElementTree.parse(path).find(".//{http://creativecommons.org/ns#}Work")
        assert work.findtext("{http://purl.org/dc/elements/1.1/}title") == "Heights, in µm"
        assert work.findtext("{http://purl.org/dc/elements/1.1/}description") == told
        assert work.find("{http://purl.org/dc/elements/1.1/}date") is None
    else:
        assert b"/Subject (" + told.encode() in content
        assert b"Date" not in content


def test_an_animation_says_what_it_is_made_from(data, tmp_path):
    short = {"as_listed": data["cube"]["as_listed"].isel(time=slice(0, 5))}
    figures.draw("animation", short, "The throw", 40, [str(tmp_path / "a.gif")], {"study": "mine"})
    with Image.open(tmp_path / "a.gif") as image:
        assert image.info["comment"].startswith(
            f"stiffdice {__version__}; drawing animation; study mine; as_listed".encode()
        )


@pytest.mark.parametrize("title", ["$$", r"$\frac{1}{$ and $5", "a\x1b[2J\u202eb", "two\nlines"])
def test_a_title_is_text_in_its_figure(title, tmp_path):
    """Neither a formula, which may be none, nor a character that no SVG may hold."""
    path = tmp_path / "x.svg"
    figure = style.new_figure(title)
    figure.savefig(path)
    ElementTree.parse(path)
    assert figure.get_suptitle() == title.replace("\n", " ").replace("\x1b", r"\x1b").replace("\u202e", r"\u202e")
