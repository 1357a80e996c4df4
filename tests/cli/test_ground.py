"""`stiffdice ground`: numbers with units in, a ground out, and what is wrong in one line."""

from __future__ import annotations

import json

import pytest
import yaml

from stiffdice.cli.main import main
from stiffdice.scene.scene import from_mapping

DIE = ["--mass", "4 g", "--side", "16 mm"]
ASKED = ["ground", "--restitution", "0.5", *DIE, "--drop", "30 cm", "--depth", "0.1 mm"]


def told(capsys, *arguments):
    assert main(list(arguments)) == 0
    return capsys.readouterr().out


def test_the_block_that_is_printed_is_the_ground_of_a_scene(capsys):
    out = told(capsys, *ASKED, "--quick")
    (line,) = (line for line in out.splitlines() if line.startswith("ground: "))
    scene = from_mapping({"cube": {"side": "16 mm", "mass": "4 g"}, **yaml.safe_load(line)})
    assert scene.ground.contact == "gated"
    assert scene.ground.stiffness == pytest.approx(294000, rel=1e-6)  # (2.42487 m/s · 0.70711/0.1 mm)² m/4
    assert "e = 0.5 without weight" in out
    assert "100 µm deep" in out


def test_and_back(capsys):
    data = json.loads(told(capsys, *ASKED, "--quick", "--json"))
    ground = ["--stiffness", repr(data["stiffness_kg_per_s2"]), "--damping", repr(data["damping_kg_per_s"])]
    back = json.loads(told(capsys, "ground", *ground, *DIE, "--drop", "0.3", "--quick", "--json"))
    assert back["restitution"] == pytest.approx(0.5, rel=1e-12)
    assert back["depth_m"] == pytest.approx(1e-4, rel=1e-12)


@pytest.mark.long
def test_longest_steps_are_those_of_all_schemes(capsys):
    data = json.loads(told(capsys, *ASKED, "--json"))
    steps = data["longest_steps_s"]
    assert set(steps) == {"symplectic_euler", "forward_euler", "velocity_verlet", "rk4", "implicit_euler"}
    assert steps["implicit_euler"]["linear"] is None
    assert steps["symplectic_euler"]["restitution_1"] < steps["symplectic_euler"]["restitution_5"]
    out = told(capsys, *ASKED)
    assert "event, exact      none" in out


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "drake"])
@pytest.mark.long
def test_an_engine_is_told(engine, capsys):
    asked = [*ASKED, "--quick", "--engine", engine, "--dt", "10 us"]
    data = json.loads(told(capsys, *asked, "--json"))
    assert data["parameters"]["paste"] in told(capsys, *asked)
    assert any(column["kind"] == "predicted" for column in data["engine"]["columns"])


def test_a_material_is_a_restitution_with_a_source(capsys):
    table = told(capsys, "ground", "--material")
    assert "Icarus 211, 849" in table
    data = json.loads(told(capsys, "ground", "--material", "--json"))
    assert all(row["source"] and 0 < row["restitution"] <= 1 for row in data.values())
    given = ["--material", "granite", *DIE, "--speed", "1", "--depth", "0.1 mm", "--quick", "--json"]
    assert json.loads(told(capsys, "ground", *given))["restitution"] == 0.83


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*DIE, "--speed", "1"], "none given: needed is one of --restitution or --damping"),
        (["--restitution", "0.5", "--depth", "1 mm", "--speed", "1", "--side", "1 cm"], "--mass: is needed"),
        (["--restitution", "0.5", "--depth", "1 mm", *DIE], "--speed and --drop: needed is one of them"),
        ([*ASKED[1:], "--speed", "1"], "--speed and --drop: needed is one of them"),
        ([*ASKED[1:], "--contact", "ungated"], "--drop: allowed with --contact gated"),
        ([*ASKED[1:], "--gravity", "0"], "--gravity = 0: allowed beside --drop"),
        ([*ASKED[1:], "--engine", "mujoko"], "--engine = mujoko: allowed is mujoco or pybullet or drake; did you mean"),
        ([*ASKED[1:], "--dt", "1e-5"], "--dt: allowed is beside --engine only"),
        ([*ASKED[1:], "--material", "granite"], "--material: is a restitution; give no other"),
        (
            [*DIE, "--stiffness", "2e5", "--damping", "1e300", "--speed", "1"],
            "restitution = 0: allowed where steps are",
        ),
        (
            [*DIE, "--restitution", "0.5", "--depth", "1e-20", "--speed", "1"],
            "depth = 1e-20 m: allowed where steps are",
        ),
        (["--material", "granit", *DIE, "--speed", "1", "--depth", "1 mm"], "--material = granit: allowed is granite"),
        ([*DIE, "--restitution", "0.5", "--depth", "1 kg", "--speed", "1"], "--depth = 1 kg: kg is no unit of [m]"),
    ],
)
def test_what_is_wrong_is_one_line(arguments, message, capsys):
    assert main(["ground", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize("ground", [["2e5", "1e300"], ["1e-300", "1"], ["2e5", "0"]])
def test_any_ground_has_its_numbers(ground, capsys):
    stiffness, damping = ground
    asked = [*DIE, "--stiffness", stiffness, "--damping", damping, "--speed", "2", "--quick"]
    assert "ground: {stiffness: " in told(capsys, "ground", *asked)


def test_a_soft_ground_is_warned_of(capsys):
    soft = [*DIE, "--restitution", "0.5", "--speed", "1", "--quick", "--depth"]
    assert "deeper than the cube is high" in told(capsys, "ground", *soft, "2 cm")
    assert "50% of the side deep" in told(capsys, "ground", *soft, "8 mm")
    weak = ["--restitution", "0.05", "--stiffness", "20", "--speed", "1", "--quick"]
    assert "the cube stays on the ground" in told(capsys, "ground", *DIE, *weak)
