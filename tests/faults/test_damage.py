"""A result that was damaged after it was made is noticed by the job that reads it, set aside, and made again."""

from __future__ import annotations

import shutil

import pytest
import xarray as xr

from stiffdice.errors import RefusedError
from stiffdice.io.reader import parts
from stiffdice.io.writer import write_dataset
from stiffdice.sweep import partition as dealing
from stiffdice.sweep.grid import Column, Piece
from stiffdice.sweep.shard import checked_shard

pytestmark = pytest.mark.workflow


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def shards_of(project):
    return sorted((project.results / "sweeps/steps/shards").glob("*.h5"))


def name_of(project, path):
    return path.relative_to(project.folder).as_posix()


def is_as_undisturbed(project, undisturbed, *aside):
    """Check that all is there as if nothing had happened, and what was set aside besides."""
    found = project.data()
    assert {name for name in found if name.endswith(".damaged")} == {f"{name}.damaged" for name in aside}
    assert {name: content for name, content in found.items() if not name.endswith(".damaged")} == undisturbed.data()


@pytest.mark.long
def test_what_was_damaged_is_named_and_made_again(undisturbed, tmp_path):
    """All shards, each in its own way, and an experiment, in one go."""
    project = undisturbed.copy(tmp_path / "project")
    flipped, swapped, text, emptied, *_ = shards_of(project)
    flip(flipped)
    shutil.copy(flipped.with_name(text.name), swapped)
    text.write_text("stiffness: 1000\n")
    emptied.write_bytes(b"")
    books = project.results / "experiments/books.h5"
    books.write_bytes(books.read_bytes()[:-1])
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    told = f"made again: {name_of(project, flipped)}: damaged: its content is not what was sealed"
    assert [line for line in done.stdout.splitlines() if line.startswith("made again")] == [told]
    others = (swapped, text, emptied, books)  # whose seals say it at once
    for path in others:
        assert f"stiffdice: {name_of(project, path)}: not what its job made: another file in its place" in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    aside = (path.relative_to(project.results).as_posix() for path in (flipped, *others))
    is_as_undisturbed(project, undisturbed, *aside)


@pytest.mark.broad
def test_what_is_made_of_shards_is_made_again_too(undisturbed, tmp_path):
    project = undisturbed.copy(tmp_path / "project")
    folder = project.results / "sweeps/steps"
    flip(folder / "sweep.h5")
    shutil.copy(project.results / "runs/stiff.as_listed.h5", folder / "frontier.h5")
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "made again: results/small/sweeps/steps/sweep.h5: damaged: its content" in done.stdout
    is_as_undisturbed(project, undisturbed, "sweeps/steps/sweep.h5", "sweeps/steps/frontier.h5")


@pytest.mark.long
def test_with_plain_snakemake_the_same_command_makes_it_again(undisturbed, tmp_path):
    project = undisturbed.copy(tmp_path / "project")
    (shard, *_) = shards_of(project)
    flip(shard)
    sweep = "results/small/sweeps/steps/sweep.h5"
    done = project.run("snakemake", target=sweep)
    assert done.returncode == 1
    assert (
        f"{name_of(project, shard)}: damaged: its content is not what was sealed; set aside as "
        f"{shard.name}.damaged, and the same command makes it again\n"
    ) in done.stderr
    assert "Traceback" not in done.stderr
    assert project.run("snakemake", target=sweep).returncode == 0
    is_as_undisturbed(project, undisturbed, f"sweeps/steps/shards/{shard.name}")


@pytest.mark.broad
def test_a_shard_of_other_code_does_not_pass_for_ours_when_snakemake_forgot(undisturbed, tmp_path):
    project = undisturbed.copy(tmp_path / "project")
    (shard, *_) = shards_of(project)
    with xr.open_dataset(shard) as opened:
        found = opened.load()
    write_dataset(found.assign_attrs(code_digest="0" * 64), shard)
    shutil.rmtree(project.folder / ".snakemake")
    (project.results / "sweeps/steps/sweep.h5").unlink()
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{name_of(project, shard)}: not what its job made" in done.stderr
    is_as_undisturbed(project, undisturbed, f"sweeps/steps/shards/{shard.name}")


@pytest.fixture(scope="module")
def shard(plan, shards):
    """A shard of config/quick.yaml: its file, and the cells that are planned to be in it."""
    (path, *_) = shards
    return path, dealing.of(plan)[path.stem].pieces


def read(shard, plan, pieces, change=lambda part: part):
    return list(checked_shard((change(part) for part in parts(shard, 7)), plan, pieces))


@pytest.mark.long
def test_the_shard_planned_is_passed_on_as_it_is(plan, shard):
    path, pieces = shard
    for passed, part in zip(read(path, plan, pieces), parts(path, 7), strict=True):
        xr.testing.assert_identical(passed, part)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda part: part.assign_attrs(code_digest="0" * 64), "other code_digest"),
        (lambda part: part.assign_attrs(scene_digest="0" * 64, scene="{}"), "other scene"),
        (lambda part: part.assign_attrs(note="ours"), "other note"),
        (lambda part: part.isel(member=slice(1, None)), "members, not"),
        (lambda part: part.drop_vars("decided"), "other variable decided"),
        (lambda part: part.assign(verdict=part.verdict.astype("i4")), "other variable verdict"),
        (lambda part: part.assign_coords(stiffness=part.stiffness * 2), "has cells of another"),
        (lambda part: part.assign_coords(contact=1 - part.contact), "has cells of another"),
        (lambda part: part.isel(cell=slice(1, None)), "has cells of another"),
    ],
)
def test_another_shard_is_refused_with_what_is_other(plan, shard, change, told):
    path, pieces = shard
    with pytest.raises(RefusedError, match=f"not the shard planned: .*{told}"):
        read(path, plan, pieces, change)


def test_a_shard_of_fewer_or_more_cells_is_refused(plan, shard):
    path, pieces = shard
    with pytest.raises(RefusedError, match="has cells of another"):
        read(path, plan, pieces[:-1])
    with pytest.raises(RefusedError, match="cells are missing"):
        read(path, plan, [*pieces, Piece(Column("gated", 1.25), (100,))])
