from __future__ import annotations

import dataclasses
import hashlib
import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from tests import rounds
from tests.conftest import ROOT

from stiffdice.archive import manifest
from stiffdice.archive.verify import CRATE, Report, _check_measurements, verify
from stiffdice.cli.main import main
from stiffdice.errors import InputError, RefusedError
from stiffdice.io.reader import open_file, parts
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.study import job_log
from stiffdice.study.job_log import digest_of
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect

RUN = "results/tiny/runs/fall.h5"
SWEEP = "results/tiny/sweeps/steps"
SCENE = from_mapping({"ground": {"contact": "gated", "stiffness": 2e3}, "duration": 2.0})


def sealed(folder):
    """Write the crate's description and the manifest of what is in a folder, as a packer would, or a forger."""
    for name in (CRATE, manifest.NAME):
        (folder / name).unlink(missing_ok=True)
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    entities = [{"@id": "./", "@type": "Dataset"}, {"@id": CRATE, "@type": "CreativeWork"}]
    for name, content in files.items():
        told = {"contentSize": str(len(content)), "sha256": hashlib.sha256(content).hexdigest()}
        entities.append({"@id": name.replace(" ", "%20"), "@type": ["File", "SoftwareSourceCode"], **told})
    (folder / CRATE).write_text(json.dumps({"@graph": entities}))
    files[CRATE] = (folder / CRATE).read_bytes()
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    (folder / manifest.NAME).write_text(manifest.text_of(digests))
    return folder


def zipped(folder, path):
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, file.relative_to(folder))
    return path


# What single runs do not tell.


@pytest.fixture(scope="module")
def made(plan, tmp_path_factory):
    """An unpacked archive: a run, a sweep of two shards, its frontier, and code that must never run."""
    folder = tmp_path_factory.mktemp("made") / "archive"
    (folder / SWEEP / "shards").mkdir(parents=True)
    (folder / "results/tiny/runs").mkdir()
    write_dataset(run_dataset(simulate(SCENE, model="sliding", steps=500, every=1)), folder / RUN)
    spans = {"stiffness": {"from": 1e2, "to": 1e4, "count": 3}, "omega_h": {"from": 2.5, "to": 0.3, "count": 4}}
    small = rounds.in_parts(dataclasses.replace(plan, **spans, members=4, refine=0), 2)
    paths = rounds.compute(small, folder / SWEEP / "shards")
    (folder / SWEEP / "shards.csv").write_text("".join(f"{n},x\n" for n in ["shard", *(p.stem for p in paths)]))
    collected = collect((part for path in paths for part in parts(path, 64)), small.criteria)
    write_dataset(collected, folder / SWEEP / "sweep.h5")
    write_dataset(stability_limits.find(collected), folder / SWEEP / "frontier.h5")
    (folder / "src").mkdir()
    (folder / "src" / "sitecustomize.py").write_text("raise SystemExit('executed')")
    (folder / "read me.txt").write_text("hello\n")
    return sealed(folder)


@pytest.fixture
def folder(made, tmp_path):
    """A copy of it to tamper with."""
    return shutil.copytree(made, tmp_path / "copy")


@pytest.fixture
def light(made, tmp_path):
    """A copy without the sweep, which takes longest to check."""
    return sealed(shutil.copytree(made, tmp_path / "light", ignore=shutil.ignore_patterns("sweeps")))


MOTION = "motion of runs from state to state, touch-down phases and measures (a rebuild computes them again)"
NO_LOGS = "whether 5 .h5 files are what their jobs made (no log says it)"
NO_SEAL = "numbers in files of format {} (they have no seal, so no change of them is seen)"
FORMATS = Path(__file__).parents[1] / "reference" / "formats"


def failing(report):
    return {problem.file for problem in report.problems}


def changed(path, name, place, change):
    """Change one value in a file and seal it again."""
    dataset = open_file(path)
    values = dataset[name].values.copy()
    values[place] = change(values[place])
    other = {name: (dataset[name].dims, values, dataset[name].attrs)}
    write_dataset(dataset.assign_coords(other) if name in dataset.coords else dataset.assign(other), path)


def shard_of(folder):
    return sorted((folder / SWEEP / "shards").iterdir())[0]


@pytest.mark.long
def test_what_is_as_it_was_made_passes(made, tmp_path):
    for path, kind in ((zipped(made, tmp_path / "a.zip"), "archive"), (made, "unpacked archive")):
        report = verify(path)
        assert report.ok and report.kind == kind, report.problems
        assert report.checked["digests"] == 9 and report.checked["hdf5_files"] == 5
        assert report.checked["runs"] == 1 + 2 * 3 * 4 * 4  # laws, stiffnesses, steps, members
        assert report.lines()[-1] == f"nothing fails; not checked: {NO_LOGS}, {MOTION}"


@pytest.mark.long
def test_a_folder_of_results_is_checked_as_far_as_it_can_be(folder):
    report = verify(folder / "results")
    assert report.ok and report.kind == "folder of results" and report.checked["hdf5_files"] == 5
    assert any("digests" in note for note in report.not_checked)
    (folder / SWEEP / ".sweep.h5.17.part").write_bytes(b"of a run that was killed")
    assert verify(folder / "results/tiny").ok
    changed(folder / RUN, "kinetic_energy", 9, lambda energy: energy * (1 + 1e-9))
    assert failing(verify(folder / "results/tiny")) == {"runs/fall.h5"}
    assert failing(verify(folder / RUN)) == {"fall.h5"}


@pytest.mark.long
def test_a_changed_a_missing_and_an_additional_file_are_named(light):
    (light / "read me.txt").write_text("Hello\n")
    (light / "src" / "sitecustomize.py").unlink()
    (light / "src" / "more.py").write_text("")
    reasons = {problem.file: problem.reason for problem in verify(light).problems}
    assert reasons["read me.txt"].startswith("changed: its SHA-256 is") and len(reasons) == 3
    assert reasons["src/sitecustomize.py"].startswith("missing") and reasons["src/more.py"].startswith("there, but not")


def test_links_and_pipes_are_named_and_not_followed(light, tmp_path):
    (tmp_path / "secret.h5").write_bytes(b"secret")
    (light / "src" / "link.h5").symlink_to(tmp_path / "secret.h5")
    (light / "src" / "folder").symlink_to(tmp_path)
    (light / RUN).unlink()
    (light / RUN).symlink_to(tmp_path / "secret.h5")
    report = verify(light)
    links = {problem.file for problem in report.problems if problem.reason.startswith("a link")}
    assert links == {"src/link.h5", "src/folder", RUN}


@pytest.mark.long
def test_a_result_that_its_job_did_not_make_is_named_by_its_log(light):
    """Though it is whole, and whoever put it there has renewed all digests of the archive."""
    told = light / "results/tiny/logs/trajectory/fall.log"
    told.parent.mkdir(parents=True)
    lines = [job_log.made(file, digest_of(light / "results/tiny" / file)) for file in ("runs/fall.h5", "../../read me")]
    told.write_text("\n".join(lines))
    assert verify(sealed(light)).ok
    write_dataset(run_dataset(simulate(SCENE, model="sliding", steps=400, every=1)), light / RUN)
    for path in (sealed(light), light / "results", light / "results/tiny"):
        report = verify(path)
        (problem,) = report.problems
        assert RUN.endswith(problem.file)
        assert problem.reason.startswith("its .h5 is not what its job made: another file in its place, or changed")


def test_one_bit_of_a_packed_file_is_named_and_all_else_is_checked(light, tmp_path, capsys):
    path = zipped(light, tmp_path / "a.zip")
    data = bytearray(path.read_bytes())
    data[zipfile.ZipFile(path).getinfo(RUN).header_offset + 5000] ^= 4
    path.write_bytes(data)
    report = verify(path)
    assert failing(report) == {RUN} and "hdf5_files" not in report.checked and report.checked["files"] == 4
    assert main(["verify", str(path)]) == 1
    assert f"FAILS: {RUN}: damaged: Bad CRC-32" in capsys.readouterr().out


def test_a_damaged_shard_is_named_and_its_sweep_is_not_blamed(folder):
    path = shard_of(folder)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    report = verify(sealed(folder))
    assert [problem.file for problem in report.problems] == [path.relative_to(folder).as_posix()]
    assert "not what was sealed" in report.problems[0].reason
    assert any("add up" in note for note in report.not_checked)


FORGERIES = {
    "an energy": (RUN, "kinetic_energy", 100, lambda energy: energy * (1 + 1e-9), RUN),
    "a time": (RUN, "time", 4, lambda time: time * (1 + 1e-9), RUN),
    "a verdict of a run": (RUN, "verdict", (), lambda verdict: np.int8(2), RUN),
    "a verdict": (None, "verdict", (0, 0), lambda verdict: np.int8(0), None),
    "a stiffness": (None, "stiffness", 0, lambda stiffness: stiffness * (1 + 1e-9), f"{SWEEP}/sweep.h5"),
    "an effort": (None, "steps_computed", (0, 0), lambda steps: steps - 1, f"{SWEEP}/sweep.h5"),
    "a count": (f"{SWEEP}/sweep.h5", "failing", (0, 0), lambda count: count - 1, f"{SWEEP}/sweep.h5"),
    "an edge": (f"{SWEEP}/frontier.h5", "flips", (0, 0, 0), lambda n: n + 1, f"{SWEEP}/frontier.h5"),
}


@pytest.mark.parametrize("what", FORGERIES)
@pytest.mark.long
def test_numbers_that_cannot_be_are_named_though_every_digest_is_right(folder, what):
    file, name, place, change, blamed = FORGERIES[what]
    path = shard_of(folder) if file is None else folder / file
    changed(path, name, place, change)
    report = verify(sealed(folder))
    assert (blamed or path.relative_to(folder).as_posix()) in failing(report)
    assert RUN not in failing(report) or file == RUN


def test_a_missing_shard_is_named(folder):
    path = shard_of(folder)
    path.unlink()
    report = verify(sealed(folder))
    assert failing(report) == {path.relative_to(folder).as_posix()}


@pytest.mark.long
def test_shards_of_another_sweep_do_not_add_up(folder):
    one, other = sorted((folder / SWEEP / "shards").iterdir())
    dataset = open_file(one)
    write_dataset(dataset.assign_attrs(model="vertical"), one)
    report = verify(sealed(folder))
    assert f"{SWEEP}/sweep.h5" in failing(report)
    assert report.checked["hdf5_files"] == 5 and other.exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[:-3], "cut short"),
        (lambda text: text.replace("  ", " ", 1), "line 1"),
        (lambda text: text + text.splitlines()[0] + "\n", "listed twice"),
    ],
)
def test_a_manifest_that_is_none_is_named(light, change, words):
    path = light / manifest.NAME
    path.write_text(change(path.read_text()))
    report = verify(light)
    assert failing(report) == {manifest.NAME} and words in report.problems[0].reason


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not an RO-Crate"),
        ('{"@graph": 7}', "not an RO-Crate"),
        ("[" * 100_000, "not an RO-Crate"),
        ('{"@graph": []}', "has no entity ./"),
        ('{"@graph": [{"@id": "gone.txt", "@type": "File"}]}', "missing, but described"),
        ('{"@graph": [{"@id": "read%20me.txt", "@type": "File", "sha256": "0"}]}', "but 0 is described"),
        ('{"@graph": [{"@id": "../../etc/passwd", "@type": "File"}]}', "missing, but described"),
    ],
)
@pytest.mark.long
def test_a_description_that_is_wrong_is_named(light, text, words):
    (light / CRATE).write_text(text)
    assert any(words in problem.reason for problem in verify(light).problems)


def test_names_from_elsewhere_cannot_speak_to_a_terminal(light):
    (light / "\x1b]0;gotcha\x07\n.txt").write_text("")
    lines = verify(light).lines()
    assert all(line.isprintable() for line in lines)
    assert any(r"\x1b]0;gotcha\x07\n.txt" in line for line in lines)


def test_a_zip_file_that_is_no_archive_or_leads_elsewhere_is_refused(tmp_path, capsys):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("README", "hello")
    with pytest.raises(RefusedError, match="not an archive of stiffdice"):
        verify(tmp_path / "a.zip")
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.writestr("../up", "hello")
    assert main(["verify", str(tmp_path / "b.zip")]) == 2
    assert "climbs out" in capsys.readouterr().err
    for name in ("none", "empty"):
        (tmp_path / "empty").mkdir(exist_ok=True)
        with pytest.raises(InputError, match=r"No such file|nothing to check"):
            verify(tmp_path / name)


@pytest.mark.long
def test_the_command_says_it_for_programs_and_for_scripts(light, capsys):
    assert main(["verify", str(light), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ok"] is True
    (light / "read me.txt").unlink()
    assert main(["verify", str(light), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["problems"][0]["file"] == "read me.txt" and told["checked"]["digests"] == 4


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("1.3/frontier.h5", "numbers of frontiers apart from their sweep"),
        ("1.3/sweep.h5", "numbers of sweeps and surveys apart from their shards"),
        ("1.3/shard.h5", "numbers of shards apart from their sweep"),
        ("1.3/experiment.h5", "numbers of experiments and timings (no other file has them)"),
        ("1.3/run.h5", MOTION),
        ("1.1/run.h5", f"{NO_SEAL.format('1.1')}, {MOTION}"),
        ("1.0/run.h5", f"{NO_SEAL.format('1.0')}, {MOTION}"),
    ],
)
@pytest.mark.long
def test_the_last_line_says_what_could_not_be_checked(file, words):
    report = verify(FORMATS / file)
    assert report.ok and report.lines()[-1] == f"nothing fails; not checked: {words}"


@pytest.mark.long
def test_results_of_which_no_log_tells_are_counted(folder):
    assert NO_LOGS in verify(folder / "results/tiny").lines()[-1]
    log = folder / "results/tiny/logs/trajectory/fall.log"
    log.parent.mkdir(parents=True)
    log.write_text(job_log.made("runs/fall.h5", digest_of(folder / RUN)) + "\n")
    report = verify(folder / "results/tiny")
    assert report.ok and NO_LOGS.replace("5", "4", 1) in report.lines()[-1]


def test_a_sweep_without_its_shards_says_so(folder):
    for path in (*(folder / SWEEP / "shards").iterdir(), folder / SWEEP / "shards.csv"):
        path.unlink()
    assert "numbers of sweeps and surveys apart from their shards" in verify(folder / SWEEP).lines()[-1]


def test_measurements_are_tried_by_their_own_reader(tmp_path):
    """They are no files of ours; one that was spoilt is told all the same."""
    name, spoilt = "config/measurements/tosses.h5", tmp_path / "spoilt.h5"
    data = bytearray((ROOT / name).read_bytes())
    data[len(data) // 2 :] = b""
    spoilt.write_bytes(data)
    for path, wrong in ((ROOT / name, []), (spoilt, [name])):
        report = Report("archive.zip", "archive")
        _check_measurements(report, {name: path})
        assert [problem[0] for problem in report.problems] == wrong
