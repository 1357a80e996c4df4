from __future__ import annotations

import json

import pytest

from stiffdice.cli.main import main
from stiffdice.scene.scene import from_mapping


def called(capsys, *arguments):
    try:
        status = main(["advise", *map(str, arguments)])
    except SystemExit as end:
        status = end.code
    return status, *capsys.readouterr()


NUMBERS = ["--contact", "gated", "--spin", "0.3,0.5,0.2", "--duration", "3", "--scheme", "event"]


def test_numbers_in_place_of_a_file_and_the_answer_for_people(capsys):
    status, out, err = called(capsys, "--stiffness", "1e6", "--mass", "0.5", *NUMBERS, "--error", "0.1%")
    assert status == 0
    assert all(line.startswith("advise: trying") for line in err.splitlines())  # of a slow machine
    for words in ("model     tumbling: the cube spins", "scheme    event, tolerance 1e-0", "0.001 asked", "root mean"):
        assert words in out
    for words in ("run time  about", "margin    none needed", "evidence  measured: "):
        assert words in out


def test_run_does_it_checks_it_and_stores_it(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("ground: {contact: gated}\nlaunch: {angular_momentum: [0.3, 0.5, 0.2]}\n")
    status, out, _ = called(capsys, "a.yaml", *NUMBERS[4:], "--run", "-o", "out.h5", "--json")
    content = json.loads(out)
    assert (status, content["check"]["kept"]) == (0, True)
    assert content["check"]["found_radii"] <= content["check"]["promised_radii"] == content["asked_radii"] == 0.01
    assert (tmp_path / "out.h5").exists()
    # The command that is shown makes the same run.
    _, told, _ = called(capsys, "a.yaml", *NUMBERS[4:])
    (line,) = (line.split() for line in told.splitlines() if line.startswith("  stiffdice run "))
    assert main([*line[1:-1], "again.h5"]) == 0
    assert (tmp_path / "out.h5").read_bytes() == (tmp_path / "again.h5").read_bytes()


def test_json_has_units_in_its_keys_and_every_option(capsys):
    status, out, _ = called(capsys, *NUMBERS, "--json")
    content = json.loads(out)
    assert status == 0
    assert set(content) == {
        *("scene", "asked_radii", "duration_s", "horizon_s", "cut", "model", "model_reason", "advised", "options"),
        *("floor_radii", "landings", "growth", "growth_per_landing", "fastest_contact", "samples", "outside", "check"),
    }
    assert set(content["advised"]) == {
        *("scheme", "steps", "tolerance", "error_radii", "keeps", "basis", "evidence", "evaluations", "run_time_s"),
        *("omega_h", "stability_limit", "margin"),
    }
    assert from_mapping(content["scene"]).duration == 3
    assert content["options"] == [content["advised"]]


def test_an_error_nothing_keeps_is_status_1(capsys):
    status, out, _ = called(capsys, *NUMBERS, "--error", "1e-17", "--run")
    assert status == 1
    assert "scheme    none found" in out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--error", "lots"], "--error = lots: allowed is a part of the radius above 0"),
        (["--error", "200%"], "--error = 200%: allowed"),
        (["--horizon", "11"], "horizon = 11: allowed is up to the scene's duration, 10 s"),
        (["--horizon", "0"], "horizon = 0.0: allowed is a finite number > 0 [s]"),
        (["--scheme", "magic"], "scheme = magic: allowed is symplectic_euler"),
        (["--scheme", "exact", "--spin", "1,0,0"], "scheme = exact, model = tumbling: allowed"),
        (["--mass", "-1"], "cube.mass = -1: allowed is a finite number > 0 [kg]"),
        (["--velocity", "5"], "launch.velocity = [5]: allowed are three"),
        (["nowhere.yaml"], "nowhere.yaml: No such file"),
        (["-o", "out.h5"], "-o: a file is written with --run only"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, arguments, told):
    status, out, err = called(capsys, "--contact", "gated", *arguments)
    assert (status, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1
