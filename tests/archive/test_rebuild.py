from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml

from stiffdice import figures, ledger
from stiffdice import study as studies
from stiffdice.archive import manifest
from stiffdice.archive.rebuild import ARCHIVED, RunError, other_versions, rebuild
from stiffdice.archive.verify import CRATE
from stiffdice.cli import main
from stiffdice.errors import RefusedError
from stiffdice.io.layout import run_dataset
from stiffdice.io.read import open_file
from stiffdice.io.write import write_dataset
from stiffdice.scene import load
from stiffdice.simulate import simulate

ROOT = Path(__file__).parent.parent.parent
STUDY = {
    "question": "Is it the same again?",
    "runs": {"fall": {"scene": "config/scenes/figure-09.yaml", "model": "sliding", "steps": 400, "every": 1}},
    "figures": {"position": {"draw": "position", "run": "fall", "title": "Position"}},
}
RUN = "results/tiny/runs/fall.as_written.h5"


def packed(folder: Path, path: Path) -> Path:
    """Pack a folder as an archive, with a description and a manifest."""
    for name in (CRATE, manifest.NAME):
        (folder / name).unlink(missing_ok=True)
    (folder / CRATE).write_text(json.dumps({"@graph": [{"@id": "./"}, {"@id": CRATE}]}))
    files = {file.relative_to(folder).as_posix(): file for file in sorted(folder.rglob("*")) if file.is_file()}
    digests = {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}
    (folder / manifest.NAME).write_text(manifest.text_of(digests))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in [*files, manifest.NAME]:
            archive.write(folder / name, name)
    return path


# A project as ours is laid out, whose workflow has one job that says what the run was given.
SNAKEFILE = """\
rule study:
    input: expand("results/{study}/{name}", study=config["study"], name=["same.txt", "runs.csv", "figures/t.svg"])

rule all_of_it:
    output: "results/{study}/same.txt", "results/{study}/runs.csv", "results/{study}/figures/t.svg"
    log: "results/{study}/logs/job.log"
    script: "workflow/scripts/job.py"
"""
JOB = """\
import os, socket, sys, time
import stiffdice

assert stiffdice.HERE == "the archive's own", stiffdice.__file__
try:
    socket.create_connection(("192.0.2.1", 80), timeout=1)
    raise SystemExit("there is a network")
except OSError:
    pass
home = os.path.expanduser("~")
assert home.startswith(os.getcwd()) and "SECRET" not in os.environ, home
for path, text in zip(snakemake.output, ("same", "1,2,3", str(time.time_ns()))):
    with open(path, "w") as file:
        file.write(text)
"""
RUN_PY = """\
import subprocess, sys
sys.exit(subprocess.run([sys.executable, "-m", "snakemake", *sys.argv[1:]]).returncode)
"""


@pytest.fixture
def project(tmp_path):
    """The content of a small archive whose job is no simulation."""
    texts = {
        "Snakefile": SNAKEFILE,
        "config/tiny.yaml": yaml.safe_dump({"figures": {"t": {"draw": "work-precision", "timings": ["x"]}}}),
        "requirements/requirements.lock": "numpy==0.0.1 \\\n    --hash=sha256:00\nnot-here-at-all==1.0\n",
        "results/tiny/same.txt": "same",
        "results/tiny/runs.csv": "1,2,3",
        "results/tiny/figures/t.svg": "some time",
        "results/tiny/logs/job.log": "at noon",
        "results/README.md": "results",
        "src/stiffdice/__init__.py": 'HERE = "the archive\'s own"\n',
        "workflow/run.py": RUN_PY,
        "workflow/profiles/default/config.yaml": "nolock: true\n",
        "workflow/scripts/job.py": JOB,
    }
    folder = tmp_path / "content"
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.mark.workflow
def test_it_runs_the_archives_own_code_away_from_everything(project, tmp_path, monkeypatch, capsys):
    """No network, no home, none of the variables of who runs it; and it says what is the same and what may differ."""
    monkeypatch.setenv("SECRET", "leaks")
    path = packed(project, tmp_path / "a.zip")
    rebuilt = rebuild(path)
    assert rebuilt.ok and rebuilt.different == {}
    assert rebuilt.same == ["results/tiny/runs.csv", "results/tiny/same.txt"]
    assert rebuilt.left_out == ["results/tiny/figures/t.svg", "results/tiny/logs/job.log"]
    assert any("the archive's lock says 0.0.1" in note for note in rebuilt.notes)
    (project / "results/tiny/same.txt").write_text("same but for this")
    packed(project, path)
    assert main(["rebuild", str(path), "-o", str(tmp_path / "kept")]) == 1
    assert "DIFFERS: results/tiny/same.txt: 17 bytes archived, 4 now" in capsys.readouterr().out
    assert (tmp_path / "kept" / "results/tiny/same.txt").read_text() == "same"
    assert (tmp_path / "kept" / ARCHIVED / "tiny/same.txt").read_text() == "same but for this"


@pytest.mark.workflow
def test_a_run_that_fails_is_told_with_its_last_lines(project, tmp_path, capsys):
    (project / "workflow/scripts/job.py").write_text("raise ValueError('out of luck')")
    path = packed(project, tmp_path / "a.zip")
    with pytest.raises(RunError, match=r"(?s)exit status 1.*out of luck"):
        rebuild(path)
    (project / "workflow/run.py").write_text("raise SystemExit('cannot \\x1b[2J even start')")
    assert main(["rebuild", str(packed(project, path))]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].endswith("exit status 1:") and lines[-1] == r"  cannot \x1b[2J even start"


def test_what_fails_a_check_is_not_run_and_not_left_behind(project, tmp_path):
    """Nothing of an archive is executed before all of it has passed."""
    (project / "workflow/run.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')")
    path = packed(project, tmp_path / "a.zip")
    (project / "extra").write_text("")
    with zipfile.ZipFile(path, "a") as archive:
        archive.write(project / "extra", "extra")
    with pytest.raises(RefusedError, match=r"extra: there, but not listed in .*; not run"):
        rebuild(path, tmp_path / "kept")
    assert {file.name for file in tmp_path.iterdir()} == {"content", "a.zip"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda top: shutil.rmtree(top / "results/tiny"), "holds results of these studies: none"),
        (lambda top: shutil.copytree(top / "results/tiny", top / "results/other"), "other, tiny; allowed is one"),
        (lambda top: (top / "results/tiny").rename(top / "results/-x"), "studies: -x"),
        (lambda top: (top / "Snakefile").unlink(), "has no Snakefile"),
        (lambda top: (top / "config/tiny.yaml").rename(top / "config/other.yaml"), "has no config/tiny.yaml"),
    ],
)
def test_what_cannot_be_made_again_is_refused(project, tmp_path, change, words):
    change(project)
    with pytest.raises(RefusedError, match=words):
        rebuild(packed(project, tmp_path / "a.zip"))


def test_a_lock_of_this_environment_has_nothing_to_tell(tmp_path):
    lock = tmp_path / "x.lock"
    lock.write_text(f"numpy=={np.__version__} \\\n    --hash=sha256:00\n")
    assert other_versions(lock) == []
    assert "not known" in other_versions(tmp_path / "none.lock")[0]


@pytest.mark.long
@pytest.mark.workflow
def test_a_study_is_the_same_again_from_its_archive_alone(tmp_path, study_schema, capsys):
    """Ours: what this process computes, a workflow in another place does, to the last bit; and a forgery differs."""
    folder = tmp_path / "content"
    for name in ("workflow", "config", "src", "requirements"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(ROOT / "Snakefile", folder)
    (folder / "config/tiny.yaml").write_text(yaml.safe_dump(STUDY))
    for path in (RUN, "results/tiny/figures/x"):
        (folder / path).parent.mkdir(parents=True)
    for preset in ("as_listed", "as_written"):
        scene = load(ROOT / "config/scenes/figure-09.yaml", preset=preset)
        run = run_dataset(simulate(scene, model="sliding", steps=400, every=1), f"fall, {preset.replace('_', ' ')}")
        books = ledger.keep(scene, model="sliding", steps=400)
        path = folder / f"results/tiny/runs/fall.{preset}.h5"
        write_dataset(run.assign(ledger.variables(books)), path)
    data = {preset: open_file(folder / f"results/tiny/runs/fall.{preset}.h5") for preset in ("as_listed", "as_written")}
    drawn = [str(folder / f"results/tiny/figures/position.{suffix}") for suffix in ("svg", "png")]
    figures.draw("position", data, "Position", studies.load(folder / "config/tiny.yaml", study_schema).dpi, drawn)
    write_dataset(data["as_written"].assign_attrs(title="forged"), folder / RUN)
    path = packed(folder, tmp_path / "a.zip")
    assert main(["rebuild", str(path), "-o", str(tmp_path / "kept")]) == 1
    out = capsys.readouterr().out
    assert "3 files are the same to the last bit, 1 differ" in out and f"DIFFERS: {RUN}" in out
