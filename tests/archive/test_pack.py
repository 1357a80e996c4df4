"""An archive holds a study and all that made it, in the same bytes every time, or there is none."""

from __future__ import annotations

import hashlib
import json
import os
import re
import resource
import shutil
import stat
import subprocess
import zipfile
from pathlib import Path

import pytest
from tests.archive import packing

from stiffdice.archive import crate, manifest
from stiffdice.archive.pack import pack
from stiffdice.cli.main import main
from stiffdice.errors import InputError, OutputError, RefusedError
from stiffdice.io.reader import open_file
from stiffdice.study import outputs

FORMATS = packing.ROOT / "tests" / "reference" / "formats"

# What may differ between two rebuilds: what was said and measured while jobs ran, and what tells of it.
DATA = re.compile(r"results/tiny/(runs|sweeps)/")
TELLS_TIMES = re.compile(
    r"results/tiny/(logs/.*|benchmarks/.*|report\.html)|ro-crate-(metadata\.json|preview\.html)|manifest-sha256\.txt"
)


@pytest.fixture
def own(finished, tmp_path):
    """A copy of that project for one test to spoil."""
    shutil.copytree(finished[0], tmp_path / "own", symlinks=True)
    return tmp_path / "own", finished[1]


@pytest.fixture(scope="module")
def packed(finished, tmp_path_factory):
    return pack(finished[1], finished[0], tmp_path_factory.mktemp("packed") / "tiny.crate.zip")


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist() if not info.is_dir()}


def test_all_that_a_study_is_made_of_is_in_it(finished, packed):
    found = contents(packed.path).keys()
    planned = finished[1]
    expected = {f"results/tiny/{file}" for result in outputs.of(planned) for file in result.files}
    expected |= {f"results/tiny/{side}" for result in outputs.of(planned) for side in (result.log, result.benchmark)}
    expected |= {"results/tiny/report.html", "config/tiny.yaml", "my-scene.yaml", "config/scenes/figure-09.yaml"}
    expected |= {"LICENSE", "CITATION.cff", "README.md", "Makefile", "Snakefile", "pyproject.toml", "workflow/run.py"}
    expected |= {"requirements/requirements.lock", "workflow/schemas/study.schema.yaml", "src/stiffdice/io/reader.py"}
    assert expected <= found


def test_nothing_else_is_in_it(own, packed, tmp_path):
    folder, planned = own
    shards = folder / "results/tiny/sweeps/steps/shards"
    shutil.copy(next(shards.iterdir()), shards / "0123456789ab.h5")  # of an earlier grid
    for name in (
        "results/other/runs/a.h5",
        "results/tiny/runs/fall.as_listed.h5.damaged",
        "results/tiny/runs/.fall.h5.7.part",
        "src/stiffdice/__pycache__/a.pyc",
        "src/stiffdice.egg-info/PKG-INFO",
        "config/my-secret.yaml",
        ".venv/pyvenv.cfg",
        "workflow/old.zip",
        "notes.txt",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x")
    pack(planned, folder, tmp_path / "again.zip")
    assert contents(tmp_path / "again.zip").keys() == contents(packed.path).keys()


def test_the_same_results_are_packed_in_the_same_bytes(finished, packed, tmp_path):
    shutil.copytree(finished[0], tmp_path / "moved", symlinks=True)
    again = pack(finished[1], tmp_path / "moved", tmp_path / "again.zip")
    assert again.path.read_bytes() == packed.path.read_bytes()


@pytest.mark.long
def test_two_rebuilds_differ_only_in_what_tells_times(packed, tmp_path, monkeypatch):
    folder = packing.project(tmp_path / "other")
    monkeypatch.chdir(folder)
    planned = packing.plan(folder)
    packing.make(planned, folder, packing.AN_HOUR + 86400)
    pack(planned, folder, tmp_path / "other.zip")
    one, other = contents(packed.path), contents(tmp_path / "other.zip")
    assert one.keys() == other.keys()
    assert {name for name in one if one[name] != other[name] and not TELLS_TIMES.fullmatch(name)} == set()
    assert one["results/tiny/report.html"] != other["results/tiny/report.html"]


def test_the_manifest_lists_every_file_with_its_digest(packed):
    found = contents(packed.path)
    told = manifest.parse(found.pop(manifest.NAME).decode())
    assert told == {name: hashlib.sha256(data).hexdigest() for name, data in found.items()}


@pytest.mark.skipif(not (shutil.which("unzip") and shutil.which("sha256sum")), reason="needs unzip and sha256sum")
def test_tools_that_every_system_has_unpack_and_check_it(packed, tmp_path):
    subprocess.run(["unzip", "-tq", packed.path], check=True, capture_output=True)
    subprocess.run(["unzip", "-q", packed.path, "-d", tmp_path], check=True, capture_output=True)
    subprocess.run(["sha256sum", "--check", "--strict", "--quiet", manifest.NAME], cwd=tmp_path, check=True)
    assert os.access(tmp_path / "requirements/install", os.X_OK)
    open_file(tmp_path / "results/tiny/sweeps/steps/sweep.h5")


def test_it_holds_plain_files_and_folders_with_nothing_of_this_machine(finished, packed):
    with zipfile.ZipFile(packed.path) as archive:
        for info in archive.infolist():
            mode = info.external_attr >> 16
            assert stat.S_ISDIR(mode) if info.is_dir() else stat.S_ISREG(mode)
            assert info.date_time == (1980, 1, 1, 0, 0, 0)
            assert not info.filename.startswith("/")
            assert ".." not in info.filename.split("/")
        folders = [name for name in archive.namelist() if name.endswith("/")]
        files = [name for name in archive.namelist() if not name.endswith("/")]
        assert archive.namelist() == [*sorted(folders), *sorted(files[:-3]), crate.PREVIEW, crate.NAME, manifest.NAME]
    for data in contents(packed.path).values():
        assert str(finished[0]).encode() not in data
        assert str(packing.ROOT).encode() not in data


def test_every_file_is_deflated(packed):
    with zipfile.ZipFile(packed.path) as archive:
        files = [info for info in archive.infolist() if not info.is_dir()]
    assert {info.compress_type for info in files} == {zipfile.ZIP_DEFLATED}
    assert all(info.compress_size <= 1.01 * info.file_size + 16 for info in files)


def test_a_stale_result_is_told(own, tmp_path):
    folder, planned = own
    scene = folder / "config/scenes/figure-09.yaml"
    scene.write_text(scene.read_text().replace("damping: 0.2", "damping: 0.3"))
    told = "results/tiny/runs/fall.as_listed.h5: made from other scene, as 2 of [0-9]+ results of this study"
    with pytest.raises(InputError, match=told):
        pack(planned, folder, tmp_path / "x.zip")
    assert not list(tmp_path.glob("*.zip"))


def test_a_missing_result_is_told(own, tmp_path):
    folder, planned = own
    for path in (folder / "results/tiny/figures").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"^results/tiny/figures/position\.svg: not there, as 2 of 11 .*STUDY=tiny"):
        pack(planned, folder, tmp_path / "a.zip")
    assert not (tmp_path / "a.zip").exists()


def test_a_result_of_an_earlier_format_is_told_and_not_packed(own, tmp_path):
    folder, planned = own
    (run,) = (folder / "results" / "tiny" / "runs").glob("*.as_listed.h5")
    shutil.copy(FORMATS / "1.1" / "run.h5", run)
    with pytest.raises(InputError, match=rf"{run.name}: its .h5 is not what its job made"):
        pack(planned, folder, tmp_path / "x.zip")
    assert not (tmp_path / "x.zip").exists()


def test_a_damaged_result_is_told_and_not_packed(own, tmp_path):
    folder, planned = own
    shard = next((folder / "results/tiny/sweeps/steps/shards").iterdir())
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 1
    shard.write_bytes(data)
    with pytest.raises(RefusedError, match=rf"{shard.name}: damaged"):
        pack(planned, folder, tmp_path / "a.zip")
    shard.write_bytes(b"")
    with pytest.raises(InputError, match=rf"{shard.name}: its .h5 is not what its job made"):
        pack(planned, folder, tmp_path / "a.zip")
    assert list(tmp_path.glob("*.zip")) == list(tmp_path.glob(".*.part")) == []


@pytest.mark.parametrize(
    ("scene", "told"),
    [("/etc/scene.yaml", "/etc/scene.yaml"), ("config/../../elsewhere.yaml", "elsewhere.yaml")],
)
def test_a_scene_outside_of_the_project_cannot_be_packed(own, tmp_path, scene, told):
    folder, planned = own
    path = folder / "config/tiny.yaml"
    path.write_text(path.read_text().replace("my-scene.yaml", scene))
    with pytest.raises(
        InputError, match=rf"config/tiny.yaml: sweeps.steps.scene = .*{told}: allowed .* of the project"
    ):
        pack(planned, folder, tmp_path / "a.zip")


@pytest.mark.parametrize("link", ["config/more.yaml", "src/stiffdice/other"])
def test_a_link_cannot_be_packed(own, tmp_path, link):
    folder, planned = own
    (folder / link).symlink_to(folder / "docs")
    with pytest.raises(InputError, match=f"^{link}: a link"):
        pack(planned, folder, tmp_path / "a.zip")


@pytest.mark.parametrize(
    ("name", "told"),
    [("a:b.md", "a:b.md: a name with a backslash or a colon"), ("reference/format.md", "some systems take for")],
)
def test_a_name_that_other_systems_do_not_take_cannot_be_packed(own, tmp_path, name, told):
    folder, planned = own
    (folder / "docs" / name).write_text("x")
    with pytest.raises(InputError, match=told):
        pack(planned, folder, tmp_path / "a.zip")


def test_a_file_that_changes_while_it_is_packed_ends_it(own, tmp_path, monkeypatch):
    from stiffdice.archive import contents as module

    folder, planned = own

    def late(files):
        (folder / "results/tiny/tables/answers.md").write_text("other")
        return read(files)

    read = module.read
    monkeypatch.setattr(module, "read", late)
    with pytest.raises(InputError, match=r"answers\.md: was changed while it was packed"):
        pack(planned, folder, tmp_path / "a.zip")
    assert list(tmp_path.glob("*.zip")) == list(tmp_path.glob(".*.part")) == []


def test_a_full_disk_leaves_what_was_there(finished, tmp_path):
    target = tmp_path / "a.zip"
    target.write_bytes(b"before")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))  # Python ignores the signal, so writing fails
    try:
        with pytest.raises(OutputError, match=r"a\.zip: File too large; nothing was stored"):
            pack(finished[1], finished[0], target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert target.read_bytes() == b"before"
    assert [path.name for path in tmp_path.iterdir()] == ["a.zip"]


def test_the_command_packs_and_says_what_a_run_takes(finished, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(finished[0])
    assert main(["archive", "tiny", "-o", str(tmp_path / "a.zip"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    shards = list(Path("results/tiny/sweeps/steps/shards").iterdir())
    datasets = [open_file(path) for path in shards]
    runs = sum(dataset.sizes["cell"] * dataset.sizes["member"] for dataset in datasets)
    assert told["runs"] == runs >= 3 * 5 * 4
    assert told["bytes_per_run"] == pytest.approx(sum(path.stat().st_size for path in shards) / runs)
    assert told["bytes"] == (tmp_path / "a.zip").stat().st_size
    own = ("ro-crate-metadata.json", "ro-crate-preview.html", manifest.NAME)
    sizes = {name: len(data) for name, data in contents(tmp_path / "a.zip").items() if name not in own}
    everything = told["kinds"].pop("all")
    for size, right in (("bytes", sum(sizes.values())), ("files", len(sizes))):
        assert sum(kind[size] for kind in told["kinds"].values()) == everything[size] == right
    data = [len(packed) for name, packed in contents(tmp_path / "a.zip").items() if DATA.match(name)]
    assert told["kinds"]["data"]["bytes"] == sum(data)


@pytest.mark.long
def test_an_archive_lies_where_no_study_does_unless_one_says_otherwise(own, monkeypatch, capsys):
    monkeypatch.chdir(own[0])
    assert main(["archive", "tiny"]) == 0
    from stiffdice import __version__

    path = Path(f"results/archives/tiny-{__version__}.crate.zip")
    assert capsys.readouterr().out.splitlines()[-1].startswith(f"{path}: ")
    first = path.read_bytes()
    assert main(["archive", "tiny"]) == 0
    assert path.read_bytes() == first


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["../tiny"], r"STUDY = \.\./tiny: allowed is the name"),
        (["none"], r"config/none.yaml: there is no study none; those in config/ are .*tiny"),
        (
            ["tiny", "-o", "config/tiny.yaml"],
            r"config/tiny.yaml: is there already, and no such file of stiffdice; name",
        ),
        (["tiny", "-o", "nowhere/a.zip"], r"the folder nowhere does not exist"),
    ],
)
def test_bad_arguments_are_told_in_one_line(finished, monkeypatch, capsys, arguments, told):
    monkeypatch.chdir(finished[0])
    assert main(["archive", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(told, line)


@pytest.mark.long
def test_an_archive_replaces_an_archive_and_another_zip_only_by_force(finished, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(finished[0])
    target = tmp_path / "a.zip"
    with zipfile.ZipFile(target, "w") as other:
        other.writestr("notes.txt", "mine")
    before = target.read_bytes()
    assert main(["archive", "tiny", "-o", str(target)]) == 2
    assert target.read_bytes() == before
    assert main(["archive", "tiny", "-o", str(target), "--force"]) == 0
    assert main(["archive", "tiny", "-o", str(target)]) == 0


def test_out_of_the_project_the_command_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["archive", "tiny"]) == 2
    assert "in the project's folder" in capsys.readouterr().err


def test_an_archive_larger_than_zip_once_could_be_is_written(tmp_path, monkeypatch):
    from stiffdice.archive import contents as module
    from stiffdice.archive import pack as packing_module

    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 10)  # as if a few bytes were two gigabytes
    (tmp_path / "source").write_bytes(b"0123456789" * 5)
    file = module.File("b/c", "data", tmp_path / "source")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        packing_module._add(archive, file, manifest.digest_of(file.source))
    assert contents(tmp_path / "a.zip") == {"b/c": b"0123456789" * 5}
