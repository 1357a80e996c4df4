from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

ROOT = Path(__file__).parents[2]
SCENE = str(ROOT / "config" / "scenes" / "figure-09.yaml")


def test_run_stores_a_file_and_says_its_verdict(stiffdice):
    status, out, err, files = stiffdice("run", SCENE, "--model", "sliding", "-o", "out.h5")
    assert (status, files) == (0, ["out.h5"])
    assert err.startswith("stiffdice: note: 10,000 steps are beyond the limit of linear stability")
    assert out.startswith("out.h5: energy grew: the cube had more energy in the air than at the launch\n  energy ")
    assert f"accuracy  was not looked at; this does: stiffdice advise {SCENE} --error 1%\n" in out
    with xr.open_dataset("out.h5") as found:
        assert found.attrs["steps"] == 10_000
        assert found.sizes["time"] == 10_001


def test_every_option_is_heard(stiffdice):
    options = ["--model", "tumbling", "--scheme", "symplectic_euler", "--steps", "2e3", "--every", "4"]
    options += ["--preset", "as_written", "--set", "ground.stiffness=1e5", "--set", "cube.mass=0.5", "-o", "out.h5"]
    assert stiffdice("run", SCENE, *options)[0] == 0
    with xr.open_dataset("out.h5") as found:
        scene = json.loads(found.attrs["scene"])
        assert (found.attrs["steps"], found.sizes["time"]) == (2000, 501)
        assert (scene["ground"]["contact"], scene["ground"]["stiffness"], scene["cube"]["mass"]) == ("gated", 1e5, 0.5)


def test_another_simulator_makes_the_same_file(stiffdice):
    for simulator, target in (("stiffdice", "ours.h5"), ("numpy", "theirs.h5")):
        options = ["--model", "sliding", "--steps", "2000", "--simulator", simulator, "-o", target]
        assert stiffdice("run", SCENE, *options)[0] == 0
    with xr.open_dataset("ours.h5") as ours, xr.open_dataset("theirs.h5") as theirs:
        # What follows from our force is not told of another's.
        xr.testing.assert_allclose(theirs, ours.drop_vars("mechanical_energy"), rtol=1e-9)
        assert {key for key in ours.attrs if str(ours.attrs[key]) != str(theirs.attrs[key])} == {
            *("simulator", "simulator_version", "code_digest", "config", "config_digest"),
        }
        assert theirs.attrs["simulator_version"] == f"numpy {np.__version__}"
        assert ours.attrs["simulator_version"] == f"stiffdice {ours.attrs['stiffdice_version']}"


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (["--set", "ground.stiffness=0"], "sank"),
        (["--set", "ground.stiffness=1e16", "--steps", "10"], "blew up"),
        (["--set", "ground.stiffness=1e308", "--set", "cube.mass=1e-9", "--steps", "10"], "left the numeric range"),
    ],
)
def test_a_run_that_fails_is_a_result(stiffdice, change, verdict):
    status, out, _, files = stiffdice("run", SCENE, *change, "-o", "out.h5")
    assert (status, files) == (0, ["out.h5"])
    assert out.startswith(f"out.h5: {verdict}")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "nowhere.yaml", "-o", "out.h5"], "nowhere.yaml: No such file"),
        (["run", SCENE, "-o", "nowhere/out.h5"], "the folder nowhere does not exist"),
        (["run", SCENE, "-o", "."], "is a folder"),
        (["run", SCENE, "-o", "/dev/null"], "not a regular file"),
        (["run", SCENE, "-o", SCENE], "is the input itself"),
        (["run", SCENE, "-o", "out.h5", "--set", "cube=[1"], "--set cube=[1: line 1: not valid YAML"),
        (["run", SCENE], "required: -o"),
        (["run", SCENE, "-o", "out.h5", "--simulator", "dice"], "simulator = dice: allowed is stiffdice or mujoco"),
        (["run", SCENE, "-o", "out.h5", "--simulator", "numpy", "--scheme", "rk4"], "allowed is symplectic_euler"),
        (["run", SCENE, "-o", "out.h5", "--simulator", "numpy", "--ledger"], "--ledger: simulator = numpy: allowed is"),
        (["run", SCENE, "-o", "out.h5", "--steps", "0"], "--steps = 0: allowed is a whole number from 1"),
        (["run", SCENE, "-o", "out.h5", "--steps", "-5"], "--steps = -5: allowed"),
        (["run", SCENE, "-o", "out.h5", "--steps", "ten"], "--steps = ten: allowed"),
        (["run", SCENE, "-o", "out.h5", "--steps", "nan"], "--steps = nan: allowed"),
        (["run", SCENE, "-o", "out.h5", "--steps", "1.5"], "--steps = 1.5: allowed"),
        (["run", SCENE, "-o", "out.h5", "--steps", "1e400"], "--steps = inf: allowed"),
        (["run", SCENE, "-o", "out.h5", "--every", "0"], "--every = 0: allowed"),
        (["run", SCENE, "-o", "out.h5", "--every", "10001"], "every = 10001: allowed"),
        (["run", SCENE, "-o", "out.h5", "--model", "falling"], "model = falling: allowed is vertical or sliding or"),
        (["run", SCENE, "-o", "out.h5", "--model", "flying"], "model = flying: allowed for scenes in which the ground"),
        (
            ["run", SCENE, "-o", "out.h5", "--model", "vertical", "--set", "ground.normal=[1, 0, 2]"],
            "level ground, [0, 0,",
        ),
        (["run", SCENE, "-o", "out.h5", "--scheme", "magic"], "scheme = magic: allowed is symplectic_euler"),
        (["run", SCENE, "-o", "out.h5", "--preset", "wrong"], "preset = wrong: allowed is as_listed or"),
        (["run", SCENE, "-o", "out.h5", "--set", "ground.stifness=1"], "did you mean stiffness?"),
        (["run", SCENE, "-o", "out.h5", "--set", "cube.mass=-1"], "cube.mass = -1: allowed is a finite number > 0"),
        (["run", SCENE, "-o", "out.h5", "--hastily"], "run: unrecognized arguments: --hastily (see stiffdice run"),
        (["run", SCENE, "-o", "out.h5", "--stpes", "5"], "unrecognized arguments: --stpes; did you mean --steps?"),
        (["run", SCENE, "--outptu=out.h5"], "unrecognized arguments: --outptu=out.h5; did you mean --output?"),
        (["--verzion"], "stiffdice: unrecognized arguments: --verzion; did you mean --version?"),
        (["fly"], "stiffdice: fly: no such command; allowed is run, advise"),
        (["run", SCENE, "--\x1b[2J\u202e\nx"], r"unrecognized arguments: --\x1b[2J\u202e\nx (see stiffdice run"),
        (["run", SCENE, "--set", "a\x1b\nb c"], r"argument --set: a\x1b\nb c: write"),
        (["rnu", SCENE], "did you mean run?"),
        (
            ["run", SCENE, "--set", "ground.stiffness", "1e6", "-o", "out.h5"],
            "argument --set: ground.stiffness: write --set ground.stiffness=VALUE, no blank about the =",
        ),
        (["run", SCENE, "--set", "ground.stiffness=", "1e6", "-o", "out.h5"], "write --set ground.stiffness=VALUE"),
        (["run", SCENE, "--set", "cube.mass=0,5", "-o", "out.h5"], "cube.mass = 0,5: a decimal comma is not read; "),
        (["run", SCENE, "--steps", "10,000", "-o", "out.h5"], "--steps = 10,000: allowed is a whole number from 1"),
        (["run", SCENE, "--dt", "0,1", "-o", "out.h5"], "--dt = 0,1: a decimal comma is not read; write 0.1; allowed"),
        (["run", SCENE, "--dt", "5 mm", "-o", "out.h5"], "--dt = 5 mm: mm is no unit of [s]; allowed is a finite"),
        (["run", SCENE, "--dt", "0", "-o", "out.h5"], "--dt = 0: allowed is a finite number > 0 [s]"),
        (["run", SCENE, "--dt", "1e-99", "-o", "out.h5"], "--dt = 1e-99: asks for 1e+100 steps; allowed are"),
        (["run", SCENE, "--dt", "1", "--steps", "5", "-o", "out.h5"], "--steps: not allowed with argument --dt"),
        (["advise", "--damping", "1", "--restitution", "0.5"], "--restitution: not allowed with argument --damping"),
        (["advise", "--error", "0,1%"], "--error = 0,1%: a decimal comma is not read; write 0.1%"),
        (["advise", "--horizon", "5 g"], "--horizon = 5 g: g is no unit of [s]"),
        ([], "stiffdice: a command is missing; allowed is run, advise"),
        (["inspect", "nowhere.h5"], "nowhere.h5: No such file"),
        (["inspect", SCENE], "not a readable HDF5 file"),
    ],
)
def test_bad_input_is_one_line_status_2_and_nothing_written(stiffdice, arguments, told):
    status, out, err, files = stiffdice(*arguments)
    assert status == 2
    assert told in err
    assert (err.count("\n"), out, files) == (1, "", [])


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["advise", "--help"], ["inspect", "--help"]])
def test_help_has_examples_that_name_the_command(stiffdice, arguments):
    status, out, _, _ = stiffdice(*arguments)
    assert status == 0
    assert "examples:\n  stiffdice " in out


def test_inspect_tells_verdict_scene_and_units(stiffdice):
    stiffdice("run", SCENE, "-o", "out.h5", "--model", "sliding")
    status, out, err, _ = stiffdice("inspect", "out.h5")
    assert (status, err) == (0, "")
    for words in ("energy grew", "energy_ratio = 1.84467", "stiffness: 1000000.0", "[m s-1]", "omega_h: 2.0"):
        assert words in out, words
    for words in (
        "apex_ratio = 6.74948",
        "restitution_error = ",
        "touchdown_phase = 0.11157",
        "apex: apex_ratio <= 1.02",
    ):
        assert words in out, words
    assert "trajectory_error" not in out  # it was not compared with anything


@pytest.mark.long
def test_auto_says_which_model_and_why_and_stores_it(stiffdice):
    options = ["--model", "auto", "--set", "launch.velocity=[0, 0, 5]", "--steps", "20000", "--ledger", "-o", "out.h5"]
    status, out, err, _ = stiffdice("run", SCENE, *options)
    reason = "vertical: the cube lands flat without spin and nothing moves it sideways"
    assert (status, err) == (0, "")
    assert out.startswith(f"{reason}\nout.h5: ")
    with xr.open_dataset("out.h5") as found:
        assert (found.attrs["model"], found.attrs["model_reason"]) == ("vertical", reason)
        assert (found.position[:, :2] == 0).all()
        assert abs(float(found.friction_work)) == 0
    told = stiffdice("inspect", "out.h5")[1]
    assert "  model: vertical\n" in told
    assert f"  model_reason: {reason}\n" in told


def test_a_users_own_file_is_replaced_only_if_asked(stiffdice, tmp_path):
    run = ["run", SCENE, "--model", "sliding", "--steps", "100", "-o"]
    for name, content in (("notes.txt", "mine"), ("theirs.h5", "\x89HDF"), ("quick.zip", "PK")):
        (tmp_path / name).write_text(content)
        commands = (run, ["advise", SCENE, "--run", "-o"]) if name != "quick.zip" else (run,)
        for command in commands:
            status, out, err, _ = stiffdice(*command, name)
            assert (status, out) == (2, "")
            assert err.startswith(
                f"stiffdice: {name}: is there already, and no such file of stiffdice; name another, or"
            )
            assert (tmp_path / name).read_text() == content
    assert stiffdice(*run, "notes.txt", "--force")[0] == 0
    assert stiffdice(*run, "notes.txt")[0] == 0, "a file of stiffdice is replaced"
    (tmp_path / "empty").touch()
    assert stiffdice(*run, "empty")[0] == 0, "there is nothing to lose"
    assert "is the input itself" in stiffdice(*run, SCENE, "--force")[2]


@pytest.mark.parametrize(
    ("dt", "steps", "told"),
    [
        ("1e-3", 10_000, []),
        ("1 ms", 10_000, []),
        ("0.7", 15, ["15 steps of 0.666666667 s: 0.7 s does not divide the duration, 10 s"]),
        ("3 ms", 3334, ["3334 steps of 0.00299940012 s: 0.003 s does not divide the duration, 10 s"]),
        ("99", 1, ["1 step of 10 s: 99 s does not divide the duration, 10 s"]),
    ],
)
def test_a_step_size_stands_for_the_fewest_steps_no_longer(stiffdice, dt, steps, told):
    status, out, _, _ = stiffdice("run", SCENE, "--model", "sliding", "--dt", dt, "-o", "out.h5")
    assert status == 0
    assert out.partition("out.h5: ")[0].splitlines() == told
    with xr.open_dataset("out.h5") as found:
        assert found.attrs["steps"] == steps


def test_what_was_derived_is_told_and_stored(stiffdice):
    changes = ["cube.side=16 mm", "cube.mass=5 g", "ground.restitution=0.5", "ground.contact_time=0.2 ms"]
    given = [word for change in changes for word in ("--set", change)]
    status, out, err, _ = stiffdice("run", SCENE, *given, "--model", "sliding", "--dt", "0.1 ms", "-o", "out.h5")
    assert (status, err) == (0, "")
    lines = out.splitlines()[:3]
    assert [line.partition(" = ")[0] for line in lines] == ["cube.radius", "ground.stiffness", "ground.damping"]
    with xr.open_dataset("out.h5") as found:
        assert found.attrs["scene_derived"] == "; ".join(lines)
        assert json.loads(found.attrs["scene"])["cube"]["radius"] == pytest.approx(0.008 * 3**0.5, rel=1e-15)
    assert "scene_derived: cube.radius = 0.0138564 m" in stiffdice("inspect", "out.h5")[1]


def test_advise_takes_a_restitution_units_and_an_error_as_a_length(stiffdice):
    words = ["--preset", "as_written", "--side", "16 mm", "--mass", "5 g", "--contact-time", "1 ms"]
    words += ["--position", "0,0,20 mm", "--velocity", "0,0,0", "--duration", "50 ms", "--error", "0.1 mm"]
    status, out, _, _ = stiffdice("advise", *words, "--restitution", "0.5", "--scheme", "event")
    assert status == 0
    assert out.startswith("cube.radius = 0.0138564 m, from cube.side = 0.016 m by the exact geometry\nground.stiffness")
    assert "ground.damping = " in out
    assert "0.00722 asked" in out  # 0.1 mm of 8√3 mm


def test_the_command_that_advice_gives_is_quoted_for_the_shell(stiffdice):
    out = stiffdice("advise", SCENE, "--stiffness", "10 kN/m", "--horizon", "1", "--scheme", "event")[1]
    assert "--set 'ground.stiffness=10 kN/m'" in out


def test_inspect_json_is_for_programs(stiffdice):
    stiffdice("run", SCENE, "-o", "out.h5", "--model", "sliding")
    content = json.loads(stiffdice("inspect", "out.h5", "--json")[1])
    assert content["verdicts"] == {"energy_grew": 1}
    assert content["attributes"]["scene"]["ground"]["stiffness"] == 1e6
    assert content["variables"]["position"] == {"dimensions": ["time", "axis"], "units": "m"}


def command(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "stiffdice.cli", *arguments], capture_output=True, text=True, check=False, **options
    )


@pytest.mark.long
def test_the_same_command_gives_the_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        assert command("run", SCENE, "-o", name, "--steps", "2000", cwd=tmp_path).returncode == 0
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@pytest.mark.long
def test_a_disk_that_fills_up_is_one_line_and_no_file(tmp_path):
    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    done = command("run", SCENE, "--steps", "20000", "-o", "out.h5", cwd=tmp_path, preexec_fn=small_files)
    assert done.returncode == 2
    assert done.stderr == "stiffdice: out.h5: File too large; nothing was stored\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.broad
def test_a_disk_with_no_room_for_the_compiled_kernel_is_one_line(tmp_path):
    def tiny_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))

    place = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    given = ("--model", "vertical", "--steps", "20000", "-o", "out.h5")
    done = command("run", SCENE, *given, cwd=tmp_path, preexec_fn=tiny_files, env=place)
    assert done.returncode == 2
    assert re.fullmatch(r"(compiling .*\n)?stiffdice: .*File too large.*\n", done.stderr)
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.long
def test_a_long_run_tells_its_progress(tmp_path):
    done = command("run", SCENE, "-o", "out.h5", "--model", "sliding", "--steps", "2e7", cwd=tmp_path)
    assert done.returncode == 0
    assert "% done, about " in done.stderr


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from stiffdice.cli import main; "
        "print([m for m in ('numpy', 'numba', 'xarray') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_file_holds_what_the_simulator_says(stiffdice):
    """What `run` stores is what `simulate` returns."""
    from stiffdice.scene.scene import load
    from stiffdice.simulation.run import simulate

    stiffdice("run", SCENE, "-o", "out.h5", "--model", "sliding", "--every", "100")
    run = simulate(load(SCENE), model="sliding", steps=10_000, every=100)
    with xr.open_dataset("out.h5") as found:
        np.testing.assert_array_equal(found.position, run.trajectory.state["position"])
