"""No more of a text is read than is allowed, whatever is in its place."""

from __future__ import annotations

import os

import pytest

from stiffdice.archive.compare import unlisted
from stiffdice.archive.verify import verify
from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.io.text_file import LARGEST_TABLE, beginning, rows_of, text_of
from stiffdice.study import job_log

SHARD = "shards/0123456789ab.h5"


def huge(path):
    """Ten gigabytes that take no room on the disk."""
    with path.open("wb") as file:
        file.write(b"begun\n")
        file.truncate(10**10)


IN_ITS_PLACE = {
    "huge": huge,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "pipe": os.mkfifo,
    "folder": lambda path: path.mkdir(),
    "missing": lambda path: None,
    "no text": lambda path: path.write_bytes(b"\xff"),
}


@pytest.fixture(params=IN_ITS_PLACE)
def strange(request, tmp_path):
    path = tmp_path / "shards.csv"
    IN_ITS_PLACE[request.param](path)
    return path


def test_a_text_is_read_up_to_a_length(tmp_path):
    path = tmp_path / "x.txt"
    path.write_text("ωh\n")
    assert text_of(path, 4) == "ωh\n"
    assert beginning(path, 2) == "ω".encode()
    with pytest.raises(InputError, match=f"^{path}: larger than 3 bytes$"):
        text_of(path, 3)


def test_a_pipe_that_is_written_to_is_read(tmp_path):
    """As `stiffdice run <(sed ... scene.yaml)`."""
    read, write = os.pipe()
    os.write(write, b"duration: 1\n")
    os.close(write)
    assert yaml_loader.load(f"/dev/fd/{read}") == {"duration": 1}
    os.close(read)


def test_every_reader_of_text_ends(strange):
    """Each says in one line what is wrong, or finds nothing."""
    for read in (yaml_loader.load, lambda path: text_of(path, LARGEST_TABLE), lambda path: list(rows_of(path))):
        with pytest.raises(InputError, match=f"^{strange}: "):
            read(strange)
    assert job_log.took(strange) is None
    told = job_log.read(strange)
    assert told is None or not told.asked
    assert {*unlisted(strange.parent, [SHARD])} <= {SHARD}


def test_verify_refuses_a_list_that_is_too_long(tmp_path):
    for name in ("manifest-sha256.txt", "ro-crate-metadata.json"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(20_000_001)
    report = verify(tmp_path)
    told = {problem.file: problem.reason for problem in report.problems}
    assert told["manifest-sha256.txt"] == told["ro-crate-metadata.json"] == "larger than 20000000 bytes"


def test_a_table_without_its_column_leaves_out_nothing(tmp_path):
    (tmp_path / "shards.csv").write_text("nonsense\n1\n")
    assert not [*unlisted(tmp_path, [SHARD])]
    (tmp_path / "shards.csv").write_text("shard\nba9876543210\n")
    assert [*unlisted(tmp_path, [SHARD])] == [SHARD]


def test_a_table_with_a_field_that_is_too_long_is_none(tmp_path):
    path = tmp_path / "shards.csv"
    path.write_text("shard\n" + "x" * 200_000)
    with pytest.raises(InputError, match="not a table"):
        list(rows_of(path))
