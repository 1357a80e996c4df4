from __future__ import annotations

import os
import stat
import struct
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stiffdice.archive import extract
from stiffdice.archive.extract import AT_ONCE, unzip
from stiffdice.errors import InputError, OutputError, RefusedError

CONTENT = {"config/a.yaml": b"question: why?\n" * 40, "results/tiny/b.h5": bytes(range(256)) * 9, "README.md": b""}


def entry(name, mode=stat.S_IFREG | 0o644):
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


def packed(path, files=CONTENT, method=zipfile.ZIP_DEFLATED, mode=stat.S_IFREG | 0o644):
    """A zip file as a careful program writes it."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in files.items():
            archive.writestr(entry(name, mode), content, method)
    return path


def unpacked(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def untouched(folder):
    """Whether nothing was left of a refused archive: neither its folder nor a temporary one, nor anything beside."""
    return {path.name for path in folder.iterdir()} <= {"a.zip"}


def refused(path, words):
    """The one line that refuses it, with nothing left behind."""
    with pytest.raises(RefusedError, match=words) as caught:
        unzip(path, path.parent / "out")
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    assert untouched(path.parent)


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_unpacks_what_was_packed(tmp_path, method):
    unzip(packed(tmp_path / "a.zip", method=method), tmp_path / "out")
    assert unpacked(tmp_path / "out") == CONTENT


def test_unpacks_into_a_new_folder_and_no_other(tmp_path):
    path, folder = packed(tmp_path / "a.zip"), tmp_path / "out"
    unzip(path, folder)
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for there in (folder, tmp_path / "link"):
        with pytest.raises(OutputError, match="File exists"):
            unzip(path, there)
    assert unpacked(folder) == CONTENT and not (tmp_path / "elsewhere").exists()


def test_unpacks_what_others_pack(tmp_path):
    """Folders of their own, sizes after the data, 64-bit sizes, a name in UTF-8, and a file that is a program."""
    path = tmp_path / "a.zip"
    with path.open("wb") as file, zipfile.ZipFile(_Pipe(file), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.mkdir("läufe")
        with archive.open(entry("läufe/run", stat.S_IFREG | 0o4777), "w", force_zip64=True) as member:
            member.write(b"#!/bin/sh\n" * 9)
        archive.writestr("small", b"x")
    unzip(path, tmp_path / "out")
    assert unpacked(tmp_path / "out") == {"läufe/run": b"#!/bin/sh\n" * 9, "small": b"x"}
    assert not (tmp_path / "out" / "läufe" / "run").stat().st_mode & (stat.S_IXUSR | stat.S_ISUID)


class _Pipe:
    """A file that cannot be sought in, so that sizes come after the data."""

    def __init__(self, file):
        self._file = file

    def write(self, data):
        return self._file.write(data)

    def flush(self):
        self._file.flush()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../escaped", "climbs out"),
        ("a/../../escaped", "climbs out"),
        ("/etc/escaped", "absolute"),
        ("C:/escaped", "backslash or a colon"),
        ("a\\..\\escaped", "backslash or a colon"),
        ("a//b", "empty part"),
        ("./a", "take for another"),
        ("a/b. ", "take for another"),
        ("a\nb", "not printed"),
        ("a\x7fb", "not printed"),
        ("a\N{RIGHT-TO-LEFT OVERRIDE}b", "not printed"),
        ("x" * 300, "longer than 255"),
        ("x/" * 600 + "y", "601 parts in a name"),
    ],
)
def test_a_name_that_leads_elsewhere_is_refused(tmp_path, name, words):
    refused(packed(tmp_path / "a.zip", {"fine": b"1", name: b"2"}), words)


@pytest.mark.parametrize("name", [b"fine.txt\0.sh", b"\0ine.txt_.sh"])
def test_a_name_with_a_nul_is_refused(tmp_path, name):
    """Python's own writer and reader cut such a name."""
    path = packed(tmp_path / "a.zip", {"fine.txt_.sh": b"1"})
    path.write_bytes(path.read_bytes().replace(b"fine.txt_.sh", name))
    refused(path, "not printed")


@pytest.mark.parametrize(
    "names",
    [
        ("a", "A"),
        ("é", "e\u0301"),
        ("straße", "STRASSE"),
        ("A/x", "a/y"),
        ("a", "a/b"),
        ("a", "A/b"),
    ],
)
def test_two_names_that_some_system_takes_for_one_are_refused(tmp_path, names):
    refused(packed(tmp_path / "a.zip", dict.fromkeys(names, b"1")), "some systems|file and a folder")


def test_a_name_that_is_there_twice_is_refused(tmp_path):
    path = packed(tmp_path / "a.zip", {"aa": b"1", "ab": b"2"})
    path.write_bytes(path.read_bytes().replace(b"ab", b"aa"))
    refused(path, "aa: is there twice")


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFDIR])
def test_what_is_no_file_is_refused(tmp_path, kind):
    path = packed(tmp_path / "a.zip", {"it": b"/etc/passwd"}, mode=kind | 0o777)
    refused(path, "it: is a link or a special file")


@pytest.mark.parametrize(
    ("method", "words"), [(zipfile.ZIP_BZIP2, "compression 12"), (zipfile.ZIP_LZMA, "compression 14")]
)
def test_another_compression_is_refused(tmp_path, method, words):
    refused(packed(tmp_path / "a.zip", method=method), words)


def in_list(path, name, offset, value, form="<H"):
    """Change a number in the entry that the list of members has of one."""
    data = bytearray(path.read_bytes())
    at = data.rindex(name.encode()) - 46
    assert data[at : at + 4] == b"PK\1\2"
    struct.pack_into(form, data, at + offset, value)
    path.write_bytes(data)


def in_both(path, name, offset, value, form="<H"):
    """Change a number in a member's own header, where it is 2 bytes earlier, too."""
    in_list(path, name, offset, value, form)
    data = bytearray(path.read_bytes())
    at = data.index(name.encode()) - 30
    assert data[at : at + 4] == b"PK\3\4"
    struct.pack_into(form, data, at + offset - 2, value)
    path.write_bytes(data)


def test_an_encrypted_member_is_refused(tmp_path):
    path = packed(tmp_path / "a.zip")
    in_both(path, "config/a.yaml", 8, 1)
    refused(path, "config/a.yaml: is encrypted")


@pytest.mark.parametrize("more", [-1, 1])
def test_a_member_of_another_size_than_it_says_is_refused(tmp_path, more):
    path = packed(tmp_path / "a.zip")
    in_both(path, "config/a.yaml", 24, len(CONTENT["config/a.yaml"]) + more, "<L")
    refused(path, "config/a.yaml: damaged: (Bad CRC-32|600 bytes instead of 601)")


def test_a_member_of_another_name_than_listed_is_refused(tmp_path):
    path = packed(tmp_path / "a.zip")
    in_list(path, "config/a.yaml", 46, ord("C"), "<B")
    refused(path, "Config/a.yaml: damaged: .* differ")


def test_members_that_share_their_bytes_are_refused(tmp_path):
    """A zip bomb without any nesting: many names for one block of data."""
    path = packed(tmp_path / "a.zip", {"aa": bytes(900), "bb": bytes(900)})
    data = path.read_bytes()
    in_list(path, "bb", 42, data.index(b"PK\3\4"), "<L")
    refused(path, "aa: overlaps|bb: overlaps")


def test_a_bomb_is_refused_before_anything_is_unpacked(tmp_path, monkeypatch):
    path = packed(tmp_path / "a.zip", {"zeros": bytes(2_000_000)})
    refused(path, "zeros: 2000000 bytes out of")
    packed(path)
    for name, most, words in (
        ("MOST_BYTES", 1000, "more than 1000 bytes"),
        ("MOST_FOLDERS", 2, "more than 2 folders"),  # config, results, results/tiny
        ("MOST_PARTS", 2, "results/tiny/b.h5: 3 parts in a name; allowed are 2"),
        ("MOST_MEMBERS", 2, "3 members; allowed are 2"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(extract, name, most)
            refused(path, words)


def test_a_bomb_that_says_little_of_itself_is_stopped_at_what_it_says(tmp_path):
    path = packed(tmp_path / "a.zip", {"zeros": bytes(50 * AT_ONCE)})
    in_both(path, "zeros", 24, 1000, "<L")
    refused(path, "zeros: damaged: Bad CRC-32")


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_damage_is_named_and_the_rest_can_be_had(tmp_path, method):
    """Every byte of a member's data is covered by its checksum."""
    path = packed(tmp_path / "a.zip", method=method)
    found = zipfile.ZipFile(path).getinfo("results/tiny/b.h5")
    data = bytearray(path.read_bytes())
    data[found.header_offset + 30 + len(found.filename) + found.compress_size // 2] ^= 1
    path.write_bytes(data)
    refused(path, "results/tiny/b.h5: damaged")
    damaged: dict[str, str] = {}
    unzip(path, tmp_path / "out", damaged)
    assert list(damaged) == ["results/tiny/b.h5"]
    rest = {name: content for name, content in CONTENT.items() if name not in damaged}
    assert unpacked(tmp_path / "out") == rest


def test_large_members_come_out_block_by_block(tmp_path):
    content = np.random.default_rng(1).integers(0, 16, 3 * AT_ONCE + 7, np.uint8).tobytes()
    unzip(packed(tmp_path / "a.zip", {"large": content}), tmp_path / "out")
    assert unpacked(tmp_path / "out") == {"large": content}


def test_no_room_is_told_before_anything_is_written(tmp_path, monkeypatch):
    path = packed(tmp_path / "a.zip")
    monkeypatch.setattr("shutil.disk_usage", lambda folder: type("Usage", (), {"free": 100}))
    with pytest.raises(OutputError, match="needs 2904 bytes of disk, 100 are free"):
        unzip(path, tmp_path / "out")
    assert untouched(tmp_path)


def test_interrupted_it_leaves_nothing(tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("shutil.copyfileobj", stop)
    with pytest.raises(KeyboardInterrupt):
        unzip(packed(tmp_path / "a.zip"), tmp_path / "out")
    assert untouched(tmp_path)


def test_what_cannot_be_read_is_told(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        unzip(tmp_path / "none.zip", tmp_path / "out")
    with pytest.raises(InputError, match="directory"):
        unzip(tmp_path, tmp_path / "out")


# Of a run by default, and of a long one.
CASES = int(os.environ.get("STIFFDICE_FUZZ_CASES", "300"))
NAMES = st.sampled_from(
    ["a", "a/b", "../a", "/a", "A", "a/", "..", "c:x", "é", "e\u0301", "x\\y", "\N{ZERO WIDTH SPACE}"]
)


@settings(max_examples=CASES, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    files=st.dictionaries(NAMES, st.binary(max_size=60), min_size=1, max_size=4),
    deflated=st.booleans(),
    changes=st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 255)), max_size=6),
    cut=st.integers(0, 3),
)
@pytest.mark.long
def test_no_change_to_a_zip_file_makes_a_file_elsewhere_or_a_crash(tmp_path_factory, files, deflated, changes, cut):
    """What comes out, if anything does, is in the folder, as large as it says, and has the checksum it says."""
    top = tmp_path_factory.mktemp("fuzz")
    path = packed(top / "a.zip", files, zipfile.ZIP_DEFLATED if deflated else zipfile.ZIP_STORED)
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[place % len(data)] = value
    path.write_bytes(data[: len(data) - cut] if cut > 1 else data)
    try:
        unzip(path, top / "out")
    except InputError as error:
        assert "\n" not in str(error)
        assert untouched(top)
        return
    assert {place.name for place in top.iterdir()} == {"a.zip", "out"}
    with zipfile.ZipFile(path) as archive:
        told = {info.filename: (info.file_size, info.CRC) for info in archive.infolist() if not info.is_dir()}
    assert told == {name: (len(content), zlib.crc32(content)) for name, content in unpacked(top / "out").items()}
    assert not any(place.is_symlink() for place in (top / "out").rglob("*"))


@pytest.mark.long
def test_names_that_are_nothing_but_folders_are_refused_at_once(tmp_path):
    """500 names of 505 parts stand for 250,000 folders; 10,001 flat ones are too many, too."""
    deep = {f"{number}/{'a/' * 503}x": b"" for number in range(500)}
    refused(packed(tmp_path / "a.zip", deep), "505 parts in a name; allowed are 20")
    refused(packed(tmp_path / "a.zip", {f"{number}/x": b"" for number in range(10_001)}), "more than 10000 folders")
