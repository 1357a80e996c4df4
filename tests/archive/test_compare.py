"""Whether two results differ, where, and by how much: told to the last bit, and nothing told that is not so."""

from __future__ import annotations

import json
import math
import shutil
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from tests import rounds

from stiffdice.archive.compare import compare
from stiffdice.archive.differences import datasets_difference, ulps, values_difference
from stiffdice.cli import main as cli
from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, seal
from stiffdice.io.reader import parts
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect
from stiffdice.sweep.shard import compute_shard

NUMBERS = st.floats(width=64, allow_nan=False)


def apart(a, b, dtype=np.float64):
    return int(ulps(np.array([a], dtype), np.array([b], dtype))[0])


@given(NUMBERS.filter(lambda x: x < math.inf), st.integers(1, 50))
def test_an_ulp_is_a_step_of_nextafter(x, steps):
    y = x
    with np.errstate(over="ignore"):
        for k in range(steps):
            assert apart(x, y) == k
            y = np.nextafter(y, np.inf)
            if y == np.inf:
                break
    assert apart(x, y) == k + 1


@given(NUMBERS, NUMBERS, NUMBERS)
def test_ulps_are_a_distance(x, y, z):
    assert apart(x, y) == apart(y, x)
    assert (apart(x, y) == 0) == (x == y)
    assert apart(x, z) <= apart(x, y) + apart(y, z)


@given(NUMBERS, NUMBERS, NUMBERS)
def test_ulps_add_up_along_the_line(x, y, z):
    x, y, z = sorted((x, y, z))
    assert apart(x, z) == apart(x, y) + apart(y, z)


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [
        (1.0, 1.0 + 2**-52, 1),
        (1.0, 1.0 - 2**-53, 1),
        (0.0, -0.0, 0),
        (-5e-324, 5e-324, 2),
        (0.0, 2.2250738585072014e-308, 2**52),
        (1.7976931348623157e308, np.inf, 1),
        (-np.inf, np.inf, 2 * 0x7FF0000000000000),  # more than int64 has
    ],
)
def test_ulps_at_the_ends(a, b, told):
    assert apart(a, b) == told


def test_ulps_of_shorter_floats_are_their_own():
    assert apart(1.0, 1.0 + 2**-23, np.float32) == 1
    assert apart(-65504, np.inf, np.float16) == 2 * 0x7BFF + 1


def of(a, b, **about):
    """Compare two rows of values."""
    a, b = (xr.DataArray(np.asarray(part), dims="k", name="x", attrs=about) for part in (a, b))
    return values_difference(a, b, lambda index: f"k {index[0]}")


def test_kinds_of_difference_are_told_apart():
    a = [1.0, np.nan, np.inf, np.inf, -0.0, np.nan, np.inf, 2.0]
    b = [1.0, 1.0, 1.0, -np.inf, 0.0, np.nan, np.inf, 2.5]
    found = of(a, b, units="m")
    assert (found.count, found.of) == (5, 8)
    assert found.unmeasured == 3  # one NaN, two infinities; the sign of zero is 0 ulp
    assert [place.where for place in found.places] == ["first at k 1", "largest at k 7"]
    assert (found.ulp, found.relative, found.absolute) == (2**50, 0.2, 0.5)


def test_the_largest_of_each_kind_is_found():
    a, b = np.array([1.0, 1e10, 5e-324]), np.array([1.5, 1e10 + 100, 1e-323])
    found = of(a, b)
    assert (found.ulp, found.relative, found.absolute) == (2**51, 0.5, 100)


def test_the_first_and_the_largest_place_are_told():
    a, b = np.ones(8), np.linspace(1, 2, 8)
    assert [place.where for place in of(a, b).places] == ["first at k 1", "largest at k 7"]
    assert [place.where for place in of(a, b[::-1]).places] == ["first and largest at k 0"]
    assert [place.where for place in of([1.0, 2.0], [1.0, 3.0]).places] == ["at k 1"]
    assert [place.where for place in of([1.0, 2.0], [np.nan, np.inf]).places] == ["first at k 0"]


def test_numbers_may_be_farther_apart_than_a_double_can_say():
    found = of([-1.7e308], [1.7e308])
    assert (found.relative, found.absolute) == (2.0, np.inf)


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [([1, 2], [1, 5], 3), ([-(2**63)], [2**63 - 1], 2.0**64), (np.array([7], np.int8), np.array([-7], np.int8), 14)],
)
def test_whole_numbers_are_as_far_apart_as_they_are(a, b, told):
    found = of(a, b)
    assert (found.absolute, found.ulp) == (told, None)


def test_an_enum_is_told_by_its_meaning():
    a, b = (np.array(part, np.int8) for part in ([0, 1, 0, 0], [0, 2, 1, 1]))
    found = of(a, b, flag_meanings="passed blew_up sank")
    assert (found.places[0].a, found.places[0].b, found.absolute) == ("blew_up", "sank", None)
    assert found.changes == ("2 from passed to blew_up", "1 from blew_up to sank")


@pytest.fixture(scope="module")
def run():
    scene = from_mapping({"launch": {"angular_momentum": {"seed": 3}}})
    return run_dataset(simulate(scene, model="tumbling", steps=1000, every=10)).load()


@pytest.fixture
def pair(tmp_path, run):
    """Two files of one run."""
    paths = tmp_path / "a.h5", tmp_path / "b.h5"
    for path in paths:
        write_dataset(run, path)
    return paths


def rewritten(path, run, **values):
    """Store a run with other values of some variables; (index, value) by name."""
    changed = run.copy(deep=True)
    for name, (index, value) in values.items():
        changed[name].values[index] = value
    write_dataset(changed, path)


@pytest.mark.long
def test_equal_files_are_the_same(pair):
    found = compare(*pair)
    assert found.same
    assert found.lines() == ["the same, byte for byte: 1 file"]


@pytest.mark.long
def test_one_bit_is_found(pair, run):
    value = run["position"].values[25, 2]
    rewritten(pair[1], run, position=((25, 2), np.nextafter(value, np.inf)))
    found = compare(*pair)
    assert not found.same
    (values,) = found.differences[0].values
    (place,) = values.places
    assert (values.variable, values.units, values.count, values.of) == ("position", "m", 1, 303)
    assert place.where == "at time = 2.5 s, axis z"
    assert (float(place.a), float(place.b)) == (value, np.nextafter(value, np.inf))
    assert values.ulp == 1
    assert values.absolute == pytest.approx(np.spacing(value))
    lines = found.lines()
    assert lines[0].startswith("different: numbers in 1 file (up to 1 ulp, ")
    assert lines[1:3] == ["", "a.h5"]
    assert lines[3].startswith("  position: 1 of 303 values differ, by up to 1 ulp, ")
    assert lines[4] == f"    at time = 2.5 s, axis z: {place.a} against {place.b}"


@pytest.mark.long
def test_kinds_are_told_in_words(pair, run):
    rewritten(pair[0], run, velocity=((3, 0), 0.0), position=((4, 1), np.nan), verdict=((), 0))
    rewritten(pair[1], run, velocity=((3, 0), -0.0), position=((4, 1), 1.0), verdict=((), 1))
    text = "\n".join(compare(*pair).lines())
    assert "velocity: 1 of 303 values differ, by up to 0 ulp, 0 of the value, 0 m s-1" in text
    assert "position: 1 of 303 values differ (1 NaN or infinite)" in text
    assert "at time = 0.4 s, axis y: nan against 1.0" in text
    first, second = str(run["verdict"].attrs["flag_meanings"]).split()[:2]
    assert f"verdict: {first} against {second}" in text


def change(path, **attributes):
    """Give a stored file other attributes, NAME or VARIABLE__NAME; none where it is to have none."""
    with h5py.File(path, "a") as file:
        for key, value in attributes.items():
            variable, _, name = key.rpartition("__")
            of = (file[variable] if variable else file).attrs
            of.pop(name, None)
            if value is not None:
                of[name] = value
    seal.seal(path)


@pytest.mark.long
def test_equal_numbers_are_told_although_attributes_differ(pair, run):
    scene = json.loads(run.attrs["scene"])
    scene["ground"]["stiffness"] = 5.0
    digest = from_mapping(scene).digest
    change(
        pair[1],
        code_digest="0" * 64,
        scene=json.dumps(scene),
        scene_digest=digest,
        title=None,
        position__units="cm",
    )
    found = compare(*pair)
    assert (found.same, found.numbers_same) == (False, True)
    lines = found.lines()
    assert lines[0] == "the numbers are the same; different: attributes in 1 file"
    assert {line.partition(":")[0] for line in lines[1:] if line} == {
        "code_digest",
        "scene_digest",
        "title",
        "position.units",
        "scene.ground.stiffness",
    }
    assert {"position.units: m against cm (1 file)", "scene.ground.stiffness: 10000.0 against 5.0 (1 file)"} < set(
        lines
    )
    assert lines[-1] == "title: only in A: A thrown cube (1 file)"


@pytest.mark.long
def test_readers_do_not_read_a_difference_into_a_single_number(pair):
    change(pair[1], steps=np.array([1000], np.int32))
    assert compare(*pair).same


@pytest.mark.long
def test_other_storage_is_no_difference(pair, run):
    encoding = {name: {"_FillValue": None} for name in run.variables}
    encoding["position"]["chunksizes"] = (5, 1)
    run.drop_encoding().to_netcdf(pair[1], engine="h5netcdf", encoding=encoding)
    seal.seal(pair[1])
    found = compare(*pair)
    assert found.same
    assert found.lines() == ["the same numbers and attributes, stored otherwise: 1 file, 0 of them byte for byte"]


@pytest.mark.long
def test_variables_types_and_sizes_are_told(pair, run):
    other = run.drop_vars("energy_paper").assign(step=run["step"].astype(np.int32))
    write_dataset(other.isel(time=slice(50)), pair[1])
    found = compare(*pair)
    assert not found.numbers_same
    lines = found.lines()
    assert lines[0] == "different: variables, types or sizes in 1 file"
    assert "  energy_paper: only in A: f8, 101 time" in lines
    assert "  step: i8, 101 time against i4, 50 time" in lines
    assert "  position: f8, 101 time, 3 axis against f8, 50 time, 3 axis" in lines
    assert "  compared at the 50 places along time that both have" in lines


@pytest.mark.long
def test_values_are_compared_at_the_times_that_both_files_have(pair, run):
    thinned = run.isel(time=slice(None, None, 2)).copy(deep=True)
    thinned["position"].values[25, 2] = 7.0
    write_dataset(thinned, pair[1])
    lines = compare(*pair).lines()
    assert "  compared at the 51 places along time that both have" in lines
    assert any(line.startswith("  position: 1 of 153 values differ") for line in lines)
    assert any(line.startswith("    at time = 5 s, axis z: ") for line in lines)


@pytest.mark.long
def test_json_has_all(pair, run):
    rewritten(pair[1], run, position=((25, 2), np.nan))
    told = json.loads(compare(*pair).as_json(), parse_constant=pytest.fail)
    assert (told["same"], told["numbers_same"], told["files"]) == (False, False, 1)
    (values,) = told["differences"][0]["values"]
    a = repr(float(run["position"][25, 2]))
    assert values["places"] == [{"where": "at time = 2.5 s, axis z", "a": a, "b": "nan"}]
    assert (values["count"], values["of"], values["unmeasured"], values["ulp"]) == (1, 303, 1, None)


@pytest.mark.long
def test_json_has_no_infinite_numbers(pair, run):
    rewritten(pair[0], run, position=((25, 2), -1.7e308))
    rewritten(pair[1], run, position=((25, 2), 1.7e308))
    told = json.loads(compare(*pair).as_json(), parse_constant=pytest.fail)
    assert told["differences"][0]["values"][0]["absolute"] == "inf"


def test_attributes_are_compared_by_what_they_are():
    a, b = (xr.Dataset(attrs={"x": math.nan, "kind": kind}) for kind in (1, 1.0))
    assert [(part.name, part.a, part.b) for part in datasets_difference("", a, b).attributes] == [("kind", 1, 1.0)]


def test_nothing_is_compared_along_a_dimension_of_two_sizes_that_has_no_labels():
    a, b = (xr.Dataset({"work": ("bounce", values), "total": sum(values)}) for values in ([1.0, 2.0, 3.0], [1.0, 2.5]))
    found = datasets_difference("", a, b)
    assert [values.variable for values in found.values] == ["total"]
    assert found.notes == ("not compared along bounce: its sizes differ, and its places have no labels",)


@pytest.mark.long
def test_text_of_files_does_not_command_a_terminal(pair):
    change(pair[1], title="\x1b[2Jgone")
    with pytest.raises(RefusedError) as caught:
        compare(*pair)
    assert "\x1b" not in str(caught.value)


def compute(plan, size, folder):
    """Compute a sweep into the folder of a study, so many columns to a shard."""
    (folder / "shards").mkdir(parents=True)
    lines = ["shard,cells"]
    for path in rounds.by_columns(plan, size, folder / "shards"):
        lines.append(f"{path.stem},{5 * size}")
    (folder / "shards.csv").write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def dealt(small, tmp_path_factory):
    """The results of one sweep, its columns dealt one and four to a shard."""
    found = {}
    for size in (1, 4):
        found[size] = tmp_path_factory.mktemp("dealt") / "study"
        compute(small, size, found[size] / "sweeps" / "grid")
    return found


@pytest.fixture
def results(dealt, tmp_path):
    """Copies of both, to change."""
    for size, folder in dealt.items():
        shutil.copytree(folder, tmp_path / str(size) / "results" / "study")
    return [tmp_path / str(size) / "results" / "study" for size in dealt]


def change_cell(path, row, name, value):
    with h5py.File(path, "a") as file:
        file[name][row] = value(file[name][row])
    seal.seal(path)


@pytest.mark.long
def test_how_cells_are_dealt_is_no_difference(results):
    assert compare(*results).same
    assert not compare(results[0].parent, results[1]).same  # one level up nothing fits


@pytest.mark.long
def test_one_run_is_found_among_cells_dealt_otherwise(results):
    shards = sorted((results[1] / "sweeps" / "grid" / "shards").iterdir())
    with xr.open_dataset(shards[0]) as dataset:
        told = [float(dataset["stiffness"][3]), int(dataset["steps"][3])]
        law = str(dataset["contact"].attrs["flag_meanings"]).split()[int(dataset["contact"][3])]
    change_cell(shards[0], 3, "energy_ratio", lambda row: np.nextafter(row, [0.0, 9.0, *row[2:]]))
    change_cell(shards[1], 7, "steps_done", lambda row: np.add(row, [0, 0, 2]))
    found = compare(*results)
    assert found.lines()[0].startswith("different: numbers in 1 file (up to 1 ulp, ")
    values = {part.variable: part for part in found.differences[0].values}
    assert values.keys() == {"energy_ratio", "steps_done"}
    assert (values["energy_ratio"].count, values["energy_ratio"].of, values["energy_ratio"].ulp) == (2, 90, 1)
    assert (values["steps_done"].count, values["steps_done"].of, values["steps_done"].absolute) == (1, 90, 2)
    place = values["energy_ratio"].places[0]
    assert place.where.endswith(f"at contact {law}, stiffness = {told[0]:.10g} kg s-2, steps = {told[1]}, member = 0")
    with xr.open_dataset(shards[0]) as dataset:
        assert repr(float(dataset["energy_ratio"][3, 0])) == place.b


@pytest.mark.long
def test_a_missing_shard_is_missing_cells(results):
    shards = sorted((results[1] / "sweeps" / "grid" / "shards").iterdir())
    shards[0].unlink()
    found = compare(*results)
    (difference,) = found.differences
    assert (len(difference.only_a), len(difference.only_b), difference.values) == (15, 0, ())
    assert found.lines()[0] == "different: cells only in A in 1 file"


@pytest.mark.long
def test_a_damaged_shard_is_named(results):
    shards = sorted((results[1] / "sweeps" / "grid" / "shards").iterdir())
    image = bytearray(shards[0].read_bytes())
    image[len(image) // 2] ^= 1
    shards[0].write_bytes(image)
    found = compare(*results)
    assert not found.numbers_same
    text = "\n".join(found.lines())
    assert f"B: sweeps/grid/shards/{shards[0].name}: damaged" in text
    assert str(results[1]) not in text


@pytest.mark.long
def test_files_of_folders_that_differ_are_tried_in_another_process_first(results, monkeypatch):
    tried = []
    honest = isolation.refused
    monkeypatch.setattr(isolation, "refused", lambda paths: honest(tried.append(str(path)) or path for path in paths))
    assert compare(*results).same
    shards = [str(path) for folder in results for path in (folder / "sweeps" / "grid" / "shards").iterdir()]
    assert sorted(tried) == sorted(shards)


@pytest.mark.long
def test_single_shards_are_compared_by_cell(results, tmp_path):
    shard = min((results[0] / "sweeps" / "grid" / "shards").iterdir())
    with xr.open_dataset(shard, decode_times=False) as dataset:
        write_dataset(dataset.load().drop_encoding().isel(cell=[4, 0, 1, 2]), tmp_path / "turned.h5")
    found = compare(shard, tmp_path / "turned.h5")
    (difference,) = found.differences
    with xr.open_dataset(shard) as dataset:
        alone = f"stiffness = {float(dataset.stiffness[3]):.10g} kg s-2, steps = {int(dataset.steps[3])}"
    assert (difference.values, len(difference.only_a), difference.only_b) == ((), 1, ())
    assert difference.only_a[0].endswith(alone)


@pytest.mark.long
def test_shards_of_an_earlier_grid_are_left_out(results):
    folder = results[0] / "sweeps" / "grid" / "shards"
    shutil.copy(min(folder.iterdir()), folder / "0123456789ab.h5")
    found = compare(*results)
    assert found.same
    assert found.left_out == ("sweeps/grid/shards/0123456789ab.h5",)


@pytest.mark.long
def test_verdicts_that_changed_are_told_in_the_fields_words(results):
    shard = min((results[1] / "sweeps" / "grid" / "shards").iterdir())
    with xr.open_dataset(shard) as dataset:
        words = str(dataset["verdict"].attrs["flag_meanings"]).split()
        before, steps = words[int(dataset["verdict"][2, 1])], int(dataset["steps"][2])
    change_cell(shard, 2, "verdict", lambda row: np.where(np.arange(len(row)) == 1, words.index("sank"), row))
    text = "\n".join(compare(*results).lines())
    assert f"verdict: 1 of 90 values differ\n    1 from {before} to sank\n" in text
    assert f"steps = {steps}, member = 1: {before} against sank" in text


@pytest.mark.long
def test_edges_that_moved_are_told_by_law_and_stiffness(tmp_path, small):
    compute_shard(small, rounds.scan(small), tmp_path / "shard.h5")
    found = stability_limits.find(collect(parts(tmp_path / "shard.h5"), small.criteria))
    place = tuple(np.argwhere(np.isfinite(found["steps_needed"].values))[0])
    moved = found.copy(deep=True)
    moved["steps_needed"].values[place] += 3
    for name, dataset in (("a.h5", found), ("b.h5", moved)):
        write_dataset(dataset, tmp_path / name)
    lines = compare(tmp_path / "a.h5", tmp_path / "b.h5").lines()
    assert lines[3].startswith("  steps_needed: 1 of ") and "by up to " in lines[3] and ", 3" in lines[3]
    needed = float(found["steps_needed"].values[place])
    assert lines[4].endswith(f": {needed} against {needed + 3}") and "stiffness = " in lines[4]


@pytest.fixture
def studies(tmp_path, run):
    """Two results of a study, each beside its config, with all kinds of files."""
    folders = []
    for side in "ab":
        folder = tmp_path / side / "results" / "mine"
        for name in ("runs", "tables", "figures", "logs/trajectory", "benchmarks/timings", ".snakemake"):
            (folder / name).mkdir(parents=True)
        (tmp_path / side / "config").mkdir()
        plan = "figures:\n  slow: {draw: cost, of: [x], timings: [x]}\n  bare: {draw: model-ablation-time, of: [x]}\n"
        (tmp_path / side / "config" / "mine.yaml").write_text(plan)
        write_dataset(run, folder / "runs" / "throw.h5")
        (folder / "tables" / "t.csv").write_text("a,b\n1,2\n3,4\n")
        (folder / "figures" / "still.png").write_bytes(b"\x89PNG\0\0\0\0 still")
        for name in (
            "figures/slow.svg",
            "figures/bare.png",
            "logs/trajectory/throw.log",
            ".snakemake/x",
            "report.html",
        ):
            (folder / name).write_text(f"differs: {side}")
        (folder / "benchmarks" / "timings" / "x.h5").write_text(side)
        folders.append(folder)
    return folders


def test_side_files_are_left_out_and_told(studies):
    found = compare(*studies)
    assert found.same
    assert (found.files, found.identical) == (3, 3)
    assert found.lines() == [
        "the same, byte for byte: 3 files",
        "",
        "left out: 6 files of logs, times and the like; --all takes them",
    ]


def test_all_compares_them_too(studies):
    found = compare(*studies, all_files=True)
    assert {part.name for part in found.differences} == set(compare(*studies).left_out)
    text = "\n".join(found.lines())
    assert "report.html\n  other bytes" in text
    assert "A: benchmarks/timings/x.h5: not a readable HDF5 file" in text


def test_files_are_told_by_what_they_are(studies, run):
    a, b = studies
    rewritten(b / "runs" / "throw.h5", run, position=((25, 2), 7.0))
    (b / "tables" / "t.csv").write_text("a,b\n1,2\n3,5\n")
    (b / "figures" / "still.png").write_bytes(b"\x89PNG\0\0\0\0 stirs")
    (a / "tables" / "old.md").write_text("old")
    (b / "tables" / "new.md").write_text("new")
    found = compare(a, b)
    assert (found.only_a, found.only_b) == (("tables/old.md",), ("tables/new.md",))
    assert found.differences[0].name == "runs/throw.h5"  # numbers first
    lines = found.lines()
    assert lines[0].startswith("different: numbers in 1 file (up to ")
    assert lines[0].endswith("), other bytes in 2 files, 1 file only in A, 1 file only in B")
    text = "\n".join(lines)
    assert "\nfigures/still.png\n  other bytes\n\ntables/t.csv\n  other bytes\n" in text


def test_links_are_not_followed(studies):
    for folder in studies:
        (folder / "tables" / "t.csv").unlink()
        (folder / "tables" / "t.csv").symlink_to("/dev/zero")
    assert compare(*studies).same
    (studies[1] / "tables" / "t.csv").unlink()
    (studies[1] / "tables" / "t.csv").write_text("x")
    text = "\n".join(compare(*studies).lines())
    assert "tables/t.csv: a link, or no file" in text


def test_only_so_much_is_shown(studies):
    for k in range(30):
        (studies[0] / "tables" / f"{k}.md").write_text("x")
    lines = compare(*studies).lines()
    assert "… and 10 more files" in lines
    assert len(json.loads(compare(*studies).as_json())["only_a"]) == 30


@pytest.mark.long
def test_archives_are_compared_by_what_is_in_them(studies, run, tmp_path):
    rewritten(studies[1] / "runs" / "throw.h5", run, position=((25, 2), 7.0))
    archives = []
    for folder in studies:
        (folder / "benchmarks" / "timings" / "x.h5").unlink()
        top = folder.parent.parent
        archives.append(tmp_path / f"{top.name}.zip")
        with zipfile.ZipFile(archives[-1], "w", zipfile.ZIP_DEFLATED) as archive:
            for path in sorted(top.rglob("*")):
                if path.is_file():
                    archive.write(path, path.relative_to(top).as_posix())
    found = compare(*archives)
    (difference,) = found.differences
    assert difference.name == "results/mine/runs/throw.h5"
    assert "results/mine/figures/slow.svg" in found.left_out
    assert compare(archives[0], studies[0].parent.parent).same


@pytest.fixture
def diff(capsys):
    def call(*arguments):
        status = cli.main(["diff", *map(str, arguments)])
        return status, *capsys.readouterr()

    return call


@pytest.mark.long
def test_exit_statuses(diff, pair, run):
    assert diff(*pair) == (0, "the same, byte for byte: 1 file\n", "")
    rewritten(pair[1], run, position=((25, 2), 7.0))
    status, out, err = diff(*pair)
    assert (status, err) == (1, "")
    assert out.startswith("different: numbers in 1 file (up to ")
    status, out, err = diff(*pair, "--json")
    assert (status, json.loads(out)["same"], err) == (1, False, "")


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ("missing.h5", "missing.h5: No such file or directory"),
        (".", ": a folder and a file; allowed are two files, two folders, two archives"),
        ("text.h5", "text.h5: not a readable HDF5 file"),
        ("cut.h5", "cut.h5: damaged|cut.h5: not a readable HDF5 file"),
    ],
)
@pytest.mark.long
def test_what_cannot_be_compared_is_refused(diff, pair, tmp_path, other, told):
    (tmp_path / "text.h5").write_text("text")
    (tmp_path / "cut.h5").write_bytes(pair[0].read_bytes()[:-100])
    for arguments in ((pair[0], tmp_path / other), (tmp_path / other, pair[0])):
        status, out, err = diff(*arguments)
        assert (status, out, err.count("\n")) == (2, "", 1)
        with pytest.raises(InputError, match=told):
            compare(*map(Path, arguments))


def test_what_is_not_ours_is_refused_even_if_it_is_the_same(diff, tmp_path):
    (tmp_path / "text.h5").write_text("text")
    assert diff(tmp_path / "text.h5", tmp_path / "text.h5")[0] == 2
