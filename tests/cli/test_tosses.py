"""`stiffdice tosses`: a page, a picture, and what is wrong in one line."""

from __future__ import annotations

import json

import pytest
from tests import toss_files

from stiffdice.cli.main import main


def called(capsys, *arguments):
    try:
        status = main(["tosses", *map(str, arguments)])
    except SystemExit as end:
        status = end.code
    return status, *capsys.readouterr()


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    return toss_files.stored(toss_files.some(6), tmp_path_factory.mktemp("tosses") / "few.h5")


@pytest.mark.long
def test_people_and_programs_are_told_and_a_toss_is_drawn(capsys, few, tmp_path):
    status, out, _ = called(capsys, few, "--contact-time", "8 ms", "--animate", tmp_path / "a.gif", "--toss", 2)
    assert status == 0
    assert "contact time 8 ms" in out
    assert "right final face" in out
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF8")
    status, out, _ = called(capsys, few, "--json", "--seed", "3")
    found = json.loads(out)
    assert (status, found["tosses"], found["fitted"], found["contact_time_s"]) == (0, 6, 2, 0.005)


def test_a_file_with_a_gap_is_one_line_and_status_2(capsys, tmp_path):
    variables, attributes = toss_files.contents(toss_files.some(2))
    variables["position"][40] = float("nan")
    path = toss_files.write(tmp_path / "gap.h5", variables, attributes)
    status, out, err = called(capsys, path)
    told = f"stiffdice: {path}: position: toss 0, sample 40: no number; allowed are tosses without gaps\n"
    assert (status, out, err) == (2, "", told)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--contact-time", "0"], "--contact-time = 0: allowed is a finite number > 0 [s]"),
        (["--contact-time", "5 kg"], "--contact-time = "),
        (["--seed", "1.5"], "--seed = 1.5: allowed is a whole number"),
        (["--gravity", "-1"], "--gravity = -1"),
        (["--toss", "1"], "--toss: says which toss to draw, with --animate only"),
        (["--animate", "a.png"], "--animate = a.png: allowed is the name of a file that ends in .gif"),
        (["--animate", "nowhere/a.gif"], "nowhere/a.gif: the folder nowhere does not exist"),
        (["--animate", "a.gif", "--toss", "7"], "--toss = 7: allowed is a whole number from 1 to 6"),
    ],
)
def test_bad_options_are_one_line_and_status_2(capsys, few, tmp_path, monkeypatch, options, told):
    monkeypatch.chdir(tmp_path)
    status, out, err = called(capsys, few, *options)
    assert (status, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1
    assert not [*tmp_path.iterdir()]


def test_what_is_there_is_kept(capsys, few, tmp_path):
    path = tmp_path / "a.gif"
    path.write_text("mine")
    status, _, err = called(capsys, few, "--animate", path)
    assert status == 2
    assert "is there already" in err
    assert path.read_text() == "mine"
