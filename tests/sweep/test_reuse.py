from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
from tests import rounds

from stiffdice.io.reader import open_file
from stiffdice.sweep import partition as shards
from stiffdice.sweep import reuse, shard
from stiffdice.sweep.grid import Piece
from stiffdice.sweep.reuse import Kept
from stiffdice.sweep.shard import BLOCK, compute_shard


@pytest.fixture(scope="module")
def before(small, tmp_path_factory):
    """A folder with the shards of a sweep of six columns."""
    folder = tmp_path_factory.mktemp("before")
    rounds.compute(rounds.in_parts(small, 4), folder)
    return folder


@pytest.fixture
def folder(before, tmp_path):
    return shutil.copytree(before, tmp_path / "shards")


@pytest.fixture
def extended(small):
    """The sweep with a harder ground and more steps, in jobs of a few cells."""
    return dataclasses.replace(
        small,
        stiffness={"from": 1e2, "to": 10**3.5, "count": 4},
        omega_h=[small.omega_h, {"from": 0.5, "to": 0.4, "count": 3}],
        seconds_per_job=4e-3,
    )


def counted(monkeypatch):
    """Count the runs that are made from now on."""
    made = []
    run = shard.simulate

    def simulate(scene, **options):
        made.append((scene.ground.contact, scene.ground.stiffness, options["steps"]))
        return run(scene, **options)

    monkeypatch.setattr(shard, "simulate", simulate)
    return made


def compute(plan, folder):
    """Compute all shards of a sweep of one round as its jobs do."""
    of = shards.of(plan)
    for name, planned in of.items():
        compute_shard(plan, planned.pieces, folder / f"{name}.h5", kept=Kept(plan, planned.pieces, folder, of))


@pytest.mark.long
def test_an_extended_grid_computes_what_is_new_and_nothing_else(extended, small, folder, tmp_path, monkeypatch):
    made = counted(monkeypatch)
    compute(extended, folder)
    old, new = ({(c, n) for c, scan in shards.scan(plan) for n in scan} for plan in (small, extended))
    assert old < new
    assert sorted(made) == sorted((c.contact, c.stiffness, n) for c, n in new - old)
    (tmp_path / "anew").mkdir()
    for path in rounds.compute(extended, tmp_path / "anew"):
        assert path.read_bytes() == (folder / path.name).read_bytes()


@pytest.mark.long
def test_cells_of_later_rounds_are_kept_too(small, tmp_path, monkeypatch):
    refined = dataclasses.replace(small, omega_h={"from": 2.5, "to": 0.3, "count": 8}, refine=1)
    paths = rounds.compute(refined, tmp_path)
    survey = rounds.judged(refined, paths)
    other = dataclasses.replace(refined, seconds_per_job=1e-4)
    due = shards.refined(other, rounds.judged(refined, paths[:-1]), 1)
    made = counted(monkeypatch)
    compute_shard(other, due, tmp_path / "x.h5", kept=Kept(other, due, tmp_path, ()))
    assert due
    assert made == []
    assert survey.sizes["cell"] > sum(len(piece.steps) for piece in shards.scan(refined))


def test_blocks_of_members_are_kept(small, tmp_path, monkeypatch):
    wide = dataclasses.replace(small, members=BLOCK + 3, stiffness={"from": 1e2, "to": 1e2, "count": 1})
    rounds.by_columns(wide, 2, tmp_path)
    pieces = [Piece(column, scan[1:]) for column, scan in shards.scan(wide)]
    compute_shard(wide, pieces, tmp_path / "anew.h5")
    made = counted(monkeypatch)
    compute_shard(wide, pieces, tmp_path / "kept.h5", kept=Kept(wide, pieces, tmp_path, ["anew"]))
    assert made == []
    assert (tmp_path / "kept.h5").read_bytes() == (tmp_path / "anew.h5").read_bytes()


@pytest.mark.parametrize(
    "change",
    [
        {"members": 4},
        {"scheme": "rk4"},
        {"early_stop": False},
        {"criteria": {"energy": 0.2}},
        {"seed": 7},
    ],
    ids=str,
)
def test_runs_of_another_kind_are_not_used(small, folder, change):
    plan = dataclasses.replace(small, **change)
    assert len(Kept(plan, shards.scan(plan), folder, ())) == 0


def test_shards_of_other_code_are_not_used(small, folder, monkeypatch):
    assert len(Kept(small, shards.scan(small), folder, ())) == sum(len(scan) for _, scan in shards.scan(small))
    monkeypatch.setattr("stiffdice.simulation.dataset.code_digest", lambda *modules: "0" * 64)
    assert len(Kept(small, shards.scan(small), folder, ())) == 0


def test_a_damaged_shard_is_left_where_it_is_and_told(small, folder):
    (first, *_) = sorted(folder.iterdir())
    image = bytearray(first.read_bytes())
    image[len(image) // 2] ^= 1
    first.write_bytes(image)
    told = []
    found = Kept(small, shards.scan(small), folder, (), told.append)
    assert 0 < len(found) < sum(len(scan) for _, scan in shards.scan(small))
    assert [line.partition(": damaged")[0] for line in told] == [f"not used: {first}"]


def test_shards_planned_now_are_not_read(small, folder):
    """They are being written, perhaps."""
    names = [path.stem for path in folder.iterdir()]
    assert len(reuse.Kept(small, shards.scan(small), folder, names)) == 0


def test_shards_that_the_table_puts_elsewhere_are_not_opened(small, folder, monkeypatch):
    """And what it says wrongly, or not at all, costs no more than time."""
    opened = []
    head = reuse.reader.head
    monkeypatch.setattr(reuse.reader, "head", lambda path, names: opened.append(path.stem) or head(path, names))
    pieces = [piece for piece in shards.scan(small) if piece.column.stiffness == 1e3]
    paths = sorted(folder.glob("*.h5"))
    spans = [open_file(path).stiffness.values for path in paths]
    lines = [f"{p.stem},{s.min():g},{s.max():g},1,1000000" for p, s in zip(paths, spans, strict=True)]
    head_line = "shard,stiffness_from_kg_s-2,stiffness_to_kg_s-2,steps_from,steps_to"
    table = folder.parent / "shards.csv"
    table.write_text("\n".join([head_line, *lines]) + "\n")
    count = len(Kept(small, pieces, folder, ()))
    assert count == sum(len(scan) for _, scan in pieces)
    assert opened == [path.stem for path, span in zip(paths, spans, strict=True) if span.max() >= 1e3]
    assert len(opened) < len(paths)
    every = shards.scan(small)
    assert len(Kept(small, every, folder, ())) == sum(len(scan) for _, scan in every)
    table.write_text("nonsense\n1\n")
    assert len(Kept(small, pieces, folder, ())) == count


def test_shards_whose_steps_or_grounds_touch_the_asked_ones_but_for_round_off_are_opened(small, folder):
    """The table has six digits of a stiffness; what it rounds away must lose no cell."""
    (piece, *_) = shards.scan(small)
    ground, few, many = piece.column.stiffness, min(piece.steps), max(piece.steps)
    spans = {
        "around": (ground, ground, few, many),
        "rounded up": (ground * (1 + 9e-6), 2 * ground, few, many),
        "rounded down": (ground / 2, ground * (1 - 9e-6), few, many),
        "fewer steps": (ground, ground, 1, few),
        "more steps": (ground, ground, many, 2 * many),
        "harder": (ground * (1 + 2e-5), 2 * ground, few, many),
        "softer": (ground / 2, ground * (1 - 2e-5), few, many),
        "too few steps": (ground, ground, 1, few - 1),
        "too many steps": (ground, ground, many + 1, 2 * many),
    }
    table = folder.parent / "shards.csv"
    lines = ["shard,stiffness_from_kg_s-2,stiffness_to_kg_s-2,steps_from,steps_to"]
    table.write_text("\n".join(lines + [",".join(map(repr, [name, *span])) for name, span in spans.items()]))
    assert reuse._elsewhere(table, [piece]) == {repr(name) for name in list(spans)[5:]}


def test_more_members_than_are_read_at_once_are_kept(small, folder, monkeypatch):
    kept = Kept(small, shards.scan(small), folder, ())
    (column, (steps, *_)), *_ = shards.scan(small)
    whole = kept(column, steps)(slice(0, small.members))
    monkeypatch.setattr(reuse.reader, "RUNS_AT_ONCE", 1)
    again = Kept(small, shards.scan(small), folder, ())(column, steps)(slice(0, small.members))
    np.testing.assert_equal(again, whole)
