from __future__ import annotations

import shutil
from itertools import pairwise

import numpy as np
import pytest
from tests.report.explorer import stored_sweeps

from stiffdice.errors import InputError
from stiffdice.io.reader import open_file
from stiffdice.report.explorer import exact_paths
from stiffdice.report.explorer.map_data import collect


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return stored_sweeps.write(tmp_path_factory.mktemp("results"), "sliding")


@pytest.fixture
def copy(results, tmp_path):
    shutil.copytree(results, tmp_path / "results")
    return tmp_path / "results"


def test_where_nothing_is_stored_it_is_told_what_makes_maps(tmp_path):
    found = collect(tmp_path)
    assert found["maps"] == [] and "make stability" in found["made_by"]


@pytest.mark.long
def test_a_map_has_every_cell_with_its_edges_and_limit(results):
    (found,) = collect(results)["maps"]
    folder = results / stored_sweeps.PLACE / "sliding"
    sweep, frontier = open_file(folder / "sweep.h5"), open_file(folder / "frontier.h5")
    assert (
        sum(column["count"] for column in found["columns"]) == sweep.sizes["cell"] == found["cells"]["steps"]["count"]
    )
    for column in found["columns"]:
        cell, (law, at) = column["first"], stored_sweeps.place_of(frontier, column)
        assert float(sweep.stiffness[cell]) == column["stiffness"]
        assert float(sweep.omega_h[cell]) == pytest.approx(column["radians"] / int(sweep.steps[cell]), rel=1e-15)
        assert column["limit"] == float(frontier.limit[at])
        for k, name in enumerate(found["criteria"]):
            for edge in ("first_pass", "last_fail"):
                stored = float(frontier[edge][law, k, at])
                assert column[edge][name["name"]] == (None if np.isnan(stored) else stored)


@pytest.mark.long
def test_equal_results_give_equal_data(results):
    assert collect(results) == collect(results)


def damage(folder):
    path = folder / "sweep.h5"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def put_another_kind(folder):
    shutil.copy(folder / "frontier.h5", folder / "sweep.h5")


def lose_a_shard(folder):
    next((folder / "shards").glob("*.h5")).unlink()


def name_fewer_shards(folder):
    lines = (folder / "shards.csv").read_text().splitlines()
    (folder / "shards.csv").write_text("\n".join(lines[:-1]) + "\n")


def put_a_foreign_file(folder):
    (folder / "frontier.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(1000))


@pytest.mark.long
@pytest.mark.parametrize(
    "harm, named",
    [
        (damage, "sweep.h5"),
        (put_another_kind, "kind = frontier: allowed here is sweep"),
        (lose_a_shard, ".h5"),
        (name_fewer_shards, "make study STUDY=stability"),
        (put_a_foreign_file, "frontier.h5"),
    ],
)
def test_a_file_that_cannot_be_trusted_is_named_in_one_line(harm, named, copy):
    harm(copy / stored_sweeps.PLACE / "sliding")
    with pytest.raises(InputError) as caught:
        collect(copy)
    assert named in str(caught.value) and str(copy) in str(caught.value) and "\n" not in str(caught.value)


def test_a_flight_is_kept_as_its_two_ends():
    time = np.linspace(0, 1, 500)
    place, velocity = (3 * time - 4.9 * time**2)[:, None], (3 - 9.8 * time)[:, None]
    kept = exact_paths.thinned(500, lambda a, b: exact_paths._off_cubic(time, place, velocity, a, b) <= 1e-12)
    assert kept == [0, 499]


def test_what_is_kept_of_bounces_leaves_out_nothing():
    time = np.linspace(0, 3, 2000)
    phase = time % 1
    place, velocity = (5 * phase - 5 * phase**2)[:, None], (5 - 10 * phase)[:, None]

    def off(a, b):
        return exact_paths._off_cubic(time, place, velocity, a, b)

    kept = exact_paths.thinned(2000, lambda a, b: off(a, b) <= 1e-6)
    assert kept[0] == 0 and kept[-1] == 1999 and len(kept) <= 8
    assert max(off(a, b) for a, b in pairwise(kept)) <= 1e-6
