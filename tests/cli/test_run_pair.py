"""`stiffdice run` of a scene of two cubes: the file, what is printed, what is refused."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import stiffdice as public
from stiffdice.dynamics.box_contact import law
from stiffdice.io import schema
from stiffdice.scene import pair
from stiffdice.simulation.pair.run import simulate_pair

SCENES = Path(__file__).parents[2] / "config" / "scenes"
TWO, STACK = str(SCENES / "two-cubes.yaml"), str(SCENES / "stacked-cubes.yaml")
SHORT = ["--set", "duration=0.255", "--steps", "1020", "-o", "out.h5"]  # they meet after 0.23 s, in the air


def test_a_run_is_stored_whole_and_told(stiffdice):
    status, out, err, files = stiffdice("run", TWO, *SHORT)
    assert (status, err, files) == (0, "", ["out.h5"])
    scene = pair.load(TWO, ["duration=0.255"])
    run = simulate_pair(scene, steps=1020, every=1)
    with xr.open_dataset("out.h5") as found:
        assert schema.problems(found) == []
        assert dict(found.sizes) == {"time": 1021, "cube": 2, "axis": 3, "node": 8}
        for number, body in enumerate("ab"):
            for name in ("position", "velocity", "angular_momentum", "node_offset"):
                np.testing.assert_array_equal(found[name].isel(cube=number), run.trajectory.state[body][name])
        np.testing.assert_array_equal(found.contact_energy, run.trajectory.contact_energy)
        assert found.deepest_contact == run.deepest[0] > 1e-3
        assert (int(found.meetings), int(found.verdict), int(found.steps_done)) == (1, 0, 1020)
        told = found.attrs
        assert (told["kind"], told["model"], told["scheme"]) == ("pair", "pair", "symplectic_euler")
        assert (told["steps"], told["step_size"]) == (1020, 0.255 / 1020)
        assert law.FORMULA in told["formula"]
        assert told["scene_digest"] == scene.digest
        assert pair.from_mapping(json.loads(told["scene"])) == scene
        parted = np.flatnonzero(np.diff(found.contact_energy > 0)).tolist()[1] + 1
        velocity = found.velocity.values[parted, 0]
    assert "cubes.0.cube.radius = 0.34641 m, from cube.side = 0.4 m" in out
    assert "\nout.h5: passed: " in out
    assert f"\n  contact   they met 1 time, {run.deepest[0]:.3g} m deep at most\n  parted    t = 0.248" in out
    assert f"cube 0: [{', '.join(f'{part:.3g}' for part in velocity)}] m/s, spin [" in out
    assert "\n  ended     t = 0.255 s   cube 0: [" in out


def test_momentum_is_the_same_before_and_after_they_meet(stiffdice):
    """The file's own numbers: in the air only the weight acts on both."""
    stiffdice("run", TWO, *SHORT)
    found = public.open_results("out.h5")
    total = found.velocity.values.sum(axis=1)  # of equal masses
    fallen = total[0] - 2 * 9.8 * np.outer(found.time, [0, 0, 1])
    np.testing.assert_allclose(total, fallen, atol=1e-12)
    turn = np.cross(found.position, found.velocity).sum(axis=1) + found.angular_momentum.values.sum(axis=1)
    np.testing.assert_allclose(turn[:, 2], turn[0, 2], atol=1e-12)  # about z, the weight has no torque


def test_the_stack_of_the_example_stays_and_sinks_in_by_its_weight(stiffdice):
    assert stiffdice("run", STACK, "--every", "10", "-o", "out.h5")[0] == 0
    found = public.open_results("out.h5")
    assert (found.velocity[-100:] ** 2).max() < 1e-6
    heights = found.position.sel(axis="z")[-1].values
    sag = 9.8 / (4 * 1e4)  # m g/(4 S)
    np.testing.assert_allclose(heights, [0.2 - 2 * sag, 0.6 - 3 * sag], atol=1e-6)
    assert float(found.deepest_contact) == pytest.approx(2 * sag, rel=0.01)  # let go with damping: nearly twice
    assert abs(found.position.sel(axis=["x", "y"])).max() < 1e-4


def test_the_cubes_of_the_example_meet_in_the_air_and_come_to_rest(stiffdice):
    assert stiffdice("run", TWO, "-o", "out.h5")[0] == 0
    found = public.open_results("out.h5")
    first = int((found.contact_energy.values > 0).argmax())
    lowest = (found.position + found.node_offset).sel(axis="z").min("node")
    assert (lowest[: first + 1] > 0.5).all()
    assert float(found.elastic_energy[: first + 1].max()) == 0
    assert (found.velocity[-1] ** 2).max() < 1e-4
    np.testing.assert_allclose(found.position.sel(axis="z")[-1], 0.2 - 9.8 / 4e4, atol=1e-4)


def test_every_option_is_heard(stiffdice):
    changes = ["--set", "cubes.0.launch.velocity=[3, 0, 1]", "--set", "ground.stiffness=2e4"]
    options = [
        "--model",
        "pair",
        "--scheme",
        "velocity_verlet",
        "--dt",
        "0.3 ms",
        "--every",
        "10",
        "--set",
        "duration=0.3",
    ]
    status, out, _, _ = stiffdice("run", TWO, *changes, *options, "-o", "out.h5")
    assert status == 0
    with xr.open_dataset("out.h5") as found:
        scene = json.loads(found.attrs["scene"])
        assert (found.attrs["scheme"], found.attrs["steps"], found.sizes["time"]) == ("velocity_verlet", 1000, 101)
        assert (scene["cubes"][0]["launch"]["velocity"], scene["ground"]["stiffness"]) == ([3, 0, 1], 2e4)
        assert json.loads(found.attrs["config"])["every"] == 10
    assert "(velocity_verlet; two stacked" in out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--simulator", "mujoco"], "--simulator = mujoco: allowed is stiffdice for two cubes"),
        (["--preset", "as_written"], "--preset = as_written: allowed is none for two cubes, whose contact is gated"),
        (["--budget", "5"], "--budget = 5: allowed is none for two cubes, .*; --steps says how many"),
        (["--tolerance", "1e-3"], "--tolerance = 1e-3: allowed is none for two cubes, .*; --steps makes them shorter"),
        (["--scheme", "event"], "scheme = event: allowed is .*rk4 for two cubes; event follows .* most accurate"),
        (["--scheme", "evnt"], "scheme = evnt: allowed is .*; did you mean event"),
        (["--model", "tumbling"], "--model = tumbling: allowed is pair for two cubes, or nothing"),
        (["--ledger", "--scheme", "rk4"], "--ledger: scheme = rk4: allowed is symplectic_euler"),
        (["--animate", "two.mp4"], r"--animate = two.mp4: allowed is the name of a file that ends in \.gif"),
        (["--animate", "no/two.gif"], "the folder no does not exist"),
        (["--every", "20000"], "every = 20000: allowed is a whole number from 1 to 10000"),
        (["--set", "cubes.1.launch.velocity=[1, 0]"], r"two-cubes\.yaml: cubes\.1\.launch\.velocity = \[1, 0\]: allow"),
        (["--set", "cubes.1.cube.mass=1 m"], r"two-cubes\.yaml: cubes\.1\.cube\.mass = 1 m: m is no unit of \[kg\]"),
        (["--set", "cube.mass=1"], r"two-cubes\.yaml: cube: unknown key; .* did you mean cubes"),
    ],
)
def test_what_does_not_apply_is_told_in_one_line_with_what_does(stiffdice, options, told):
    status, out, err, files = stiffdice("run", TWO, *options, "-o", "out.h5")
    assert (status, out, err.count("\n"), files) == (2, "", 1, [])
    assert re.search(told, err), err


@pytest.mark.parametrize("command", ["advise", "throw"])
def test_commands_of_one_cube_say_what_takes_two(stiffdice, command):
    status, _, err, _ = stiffdice(command, TWO)
    assert status == 2
    assert err.endswith("two-cubes.yaml: cubes: allowed here is a scene of one cube; stiffdice run takes two\n")


def test_what_speaks_against_a_run_is_told_before_it(stiffdice):
    _, _, err, _ = stiffdice("run", STACK, "--steps", "400", "-o", "out.h5")
    assert "note: 400 steps are beyond the limit of linear stability: symplectic_euler needs 470 or more\n" in err
    inside = ["--set", "cubes.1.launch.position=[0, 0, 0.55]", "--set", "duration=0.01"]
    _, _, err, _ = stiffdice("run", STACK, *inside, "-o", "out.h5")
    stored = 0.5 * 1e4 * 4 * 0.05**2  # S/2 Σ w d², Σ w = 4 of two faces
    assert f"note: the cubes start in each other; the springs between them hold {stored:.3g} J and throw them" in err
    below = ["--set", "cubes.0.launch.position=[0, 0, 0.1]", "--set", "duration=0.01"]
    _, _, err, _ = stiffdice("run", STACK, *below, "-o", "out.h5")
    assert "note: cubes.0.launch.position: the cube starts in the ground, its lowest node 0.1 m deep" in err


def test_inspect_tells_verdict_scene_and_ledger(stiffdice):
    stiffdice("run", TWO, *SHORT, "--ledger")
    status, out, err, _ = stiffdice("inspect", "out.h5")
    assert (status, err) == (0, "")
    for words in (
        "  passed: ",
        "deepest_contact = 0.01",
        " m: deepest contact",
        "meetings = 1:",
        "cubes:",
        "[kg m2 s-1]",
    ):
        assert words in out, words
    rows = dict(re.findall(r"^  (\w+) +\S+ +(\S+)$", out.partition("energy of each cube")[2], re.MULTILINE))
    works = [float(value) for name, value in rows.items() if name != "kinetic_energy"]
    assert sum(works) == pytest.approx(float(rows["kinetic_energy"]), abs=1e-4)
    status, out, _, _ = stiffdice("inspect", "out.h5", "--json")
    assert json.loads(out)["attributes"]["scene"]["cubes"][1]["cube"]["mass"] == 1.0


def test_diff_tells_what_differs_between_two_runs(stiffdice):
    stiffdice("run", TWO, *SHORT)
    stiffdice("run", TWO, *SHORT[:-1], "same.h5")
    assert stiffdice("diff", "out.h5", "same.h5")[0] == 0
    stiffdice("run", TWO, *SHORT[:-1], "other.h5", "--set", "cubes.1.launch.velocity=[0.4, 0, 1.3]")
    status, out, _, _ = stiffdice("diff", "out.h5", "other.h5")
    assert status == 1
    assert "scene.cubes" in out
    assert "cube = 1" in out


def test_a_file_that_was_changed_is_refused(stiffdice, tmp_path):
    stiffdice("run", TWO, *SHORT)
    data = bytearray((tmp_path / "out.h5").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "out.h5").write_bytes(data)
    status, _, err, _ = stiffdice("inspect", "out.h5")
    assert (status, err.count("\n")) == (2, 1)


@pytest.mark.long
def test_a_run_is_drawn_with_both_cubes(stiffdice, tmp_path):
    status, _, _, files = stiffdice(
        "run", TWO, "--set", "duration=1", "--steps", "2500", "--animate", "two.gif", "-o", "out.h5"
    )
    assert (status, files) == (0, ["out.h5", "two.gif"])
    assert (tmp_path / "two.gif").stat().st_size < 1_500_000
    with Image.open(tmp_path / "two.gif") as drawn:
        assert drawn.n_frames > 20
        for frame in (0, drawn.n_frames - 1):
            drawn.seek(frame)
            colours = {colour for _, colour in drawn.convert("RGB").getcolors()}
            for red, green, blue in ((0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)):
                assert any(abs(r - red) + abs(g - green) + abs(b - blue) < 30 for r, g, b in colours)


@pytest.mark.long
def test_a_run_of_one_cube_is_drawn_too_if_it_turns(stiffdice):
    scene = str(SCENES / "figure-04.yaml")
    assert stiffdice("run", scene, "--set", "duration=2", "--animate", "one.gif", "-o", "out.h5")[::3] == (
        0,
        ["one.gif", "out.h5"],
    )
    status, _, err, _ = stiffdice("run", scene, "--model", "sliding", "--animate", "one.gif", "-o", "out.h5")
    assert status == 2
    assert "allowed" in err


@pytest.mark.parametrize("scene", [TWO, str(SCENES / "figure-09.yaml")])
def test_a_scene_may_come_through_a_pipe(scene, stiffdice):
    """It can be read once only."""
    reading, writing = os.pipe()
    os.write(writing, Path(scene).read_bytes())
    os.close(writing)
    status, _, err, files = stiffdice(
        "run", f"/dev/fd/{reading}", "--steps", 1000, "--set", "duration=0.01", "-o", "out.h5"
    )
    os.close(reading)
    assert (status, files) == (0, ["out.h5"]), err
