"""Files that someone made to mislead, each sealed as ours are: refused in one line that names what is wrong in them."""

from __future__ import annotations

import json
import os
import re
import struct
import zlib

import h5py
import numpy as np
import pytest
import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, seal, structure_check
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.reader import open_file, parts
from stiffdice.io.schema import FORMAT_VERSION
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Scene
from stiffdice.simulation.dataset import provenance_attributes

ABOUT = {"units": "1", "long_name": "a number"}


def whole():
    """A small file with one of everything that ours have."""
    return xr.Dataset(
        {
            "ratio": (("cell", "member"), np.arange(600.0).reshape(200, 3), ABOUT),
            "verdict": ("cell", np.arange(200, dtype=np.int8) % 2, enum_attributes("verdict", ["one", "two"])),
            "total": ((), 3.5, ABOUT),
        },
        {
            "member": ("member", np.arange(3, dtype=np.int32), ABOUT),
            "stiffness": ("cell", np.geomspace(1, 100, 200), ABOUT),
        },
        provenance_attributes("Numbers", Scene(), "sliding", "rk4", "stiffdice.scene.scene"),
    )


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "x.h5"
    write_dataset(whole(), path)
    return path.read_bytes()


@pytest.fixture
def stored(tmp_path, image):
    path = tmp_path / "x.h5"
    path.write_bytes(image)
    return path


def test_what_is_ours_is_read(stored):
    xr.testing.assert_identical(open_file(stored), whole())
    assert isolation.refused([stored]) == {}


TRICKS = {}


def trick(told):
    """Register a way to spoil an open file, with what is said of it."""

    def register(spoil):
        TRICKS[spoil.__name__] = (spoil, told)
        return spoil

    return register


def add(file, name="more", values=(1.0, 2.0, 3.0), dimensions=("member",), **options):
    """Add a variable as netCDF-4 has it."""
    added = file.create_dataset(name, data=values, **options)
    for axis, dimension in enumerate(dimensions):
        added.dims[axis].attach_scale(file[dimension])
    added.attrs.update(ABOUT)
    return added


@trick("more: a link that points elsewhere")
def link_in_a_loop(file):
    file["more"] = h5py.SoftLink("/more")


@trick("more: a link that points elsewhere")
def link_to_another_file(file):
    file["more"] = h5py.ExternalLink("/etc/passwd", "/")


@trick("one variable under two names")
def two_names(file):
    file["more"] = file["ratio"]


@trick("more: a named type")
def named_type(file):
    file["more"] = np.dtype("f8")


@trick("more: a group")
def group_that_holds_itself(file):
    more = file.create_group("more")
    more["again"] = more


@trick("more: is 1152921504606846976 numbers")
def absurd_shape(file):
    file.create_dataset("more", (2**60,), "f8", chunks=(1000,))


@trick("more: is 1048576 × 1048576 × 1048576 numbers")
def absurd_product(file):
    file.create_dataset("more", (2**20,) * 3, "i1", chunks=(10, 10, 10))


@trick("member: is 1152921504606846976 numbers")
def absurd_dimension(file):
    del file["member"]
    file.create_dataset("member", (2**60,), "f4", chunks=(1000,)).make_scale(
        "This is a netCDF dimension but not a netCDF variable. 3"
    )


@trick("holds 24 GB in a file of .* kB: allowed are 537 MB")
def too_much_in_all(file):
    for name in ("more", "most"):
        file.create_dataset(name, (12_000, 1_000_000), "i1", chunks=(1, 1_000_000), compression="gzip")


@trick("holds 629 MB in a file of .* kB: allowed are 537 MB")
def zeros_that_pack_well(file):
    """Every chunk is there and sound, and stands for a thousand times what it takes."""
    size = structure_check.LARGEST_PIECE // 8
    more = file.create_dataset("more", (300 * size,), "f8", chunks=(size,), compression="gzip")
    block = zlib.compress(bytes(structure_check.LARGEST_PIECE), 9)
    for number in range(300):
        more.id.write_direct_chunk((number * size,), block)


@trick("ratio: more than 10000000 characters in the attributes")
def much_text_in_all(file):
    for number in range(101):
        file["ratio"].attrs[f"a{number}"] = "x" * 100_000


@trick("more: 1 of its 50 chunks are there")
def nothing_stored(file):
    big = file.create_dataset("more", (5000,), "f8", chunks=(100,), compression="gzip")
    big[0] = 1


@trick("more: has no values")
def nothing_stored_in_one_block(file):
    file.create_dataset("more", (1000,), "f8")


@trick("more: chunks of 8 MB: allowed are 2.1 MB")
def huge_chunk(file):
    file.create_dataset("more", (10,), "f8", chunks=(1_000_000,), maxshape=(None,), compression="gzip")


@trick("more: is in 50001 chunks: allowed are 50000")
def many_chunks(file):
    """48 MB in chunks of two numbers took 6.6 GB to read."""
    file.create_dataset("more", (100_001,), "f8", chunks=(2,), compression="gzip")


@trick("more: a chunk without its filters")
def checksum_left_out(file):
    more = file.create_dataset("more", (100,), "f8", chunks=(100,), compression="gzip", fletcher32=True)
    more.id.write_direct_chunk((0,), np.zeros(100).tobytes(), filter_mask=0b111)


@trick("more: filters .*: allowed are shuffle, gzip, fletcher32, each once")
def unknown_filter(file):
    file.create_dataset("more", (100,), "f8", chunks=(100,), compression="lzf")


@trick("more: filters .*each once")
def deflated_twice(file):
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((100,))
    plan.set_deflate(9)
    plan.set_deflate(9)
    h5py.h5d.create(file.id, b"more", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((100,)), plan)


@trick("more: allowed are values in chunks or in one block")
def compact(file):
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_layout(h5py.h5d.COMPACT)
    h5py.h5d.create(file.id, b"more", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((3,)), plan)


@trick("more: has 9 dimensions: allowed are 8")
def many_dimensions(file):
    file.create_dataset("more", (1,) * 9, "f8")


@trick("more: has no shape")
def empty(file):
    file["more"] = h5py.Empty("f8")


@trick("holds 1003 variables|holds 100. variables: allowed are 1000")
def many_variables(file):
    for number in range(1000):
        file.create_dataset(f"more{number}", data=1.0)


@pytest.mark.parametrize(
    "dtype",
    [
        "u1",
        "u8",
        "f2",
        "c16",
        "S8",
        "V4",
        bool,
        [("a", "f8"), ("b", "i4")],
        h5py.string_dtype(),
        h5py.vlen_dtype(np.float64),
        h5py.enum_dtype({"a": 0, "b": 1}, "i1"),
        h5py.ref_dtype,
        h5py.regionref_dtype,
        "(3,)f8",
        "g",
    ],
    ids=str,
)
def test_only_plain_numbers_are_let_in(stored, dtype):
    def of_that_type(file):
        file.create_dataset("more", (3,), dtype)

    refuses(stored, of_that_type, "more: type .*: allowed are int8, int16, int32, int64, float32, float64")


@trick("more: type .*: allowed are int8")
def type_by_reference(file):
    file["type"] = np.dtype("f8")
    file.create_dataset("more", (3,), file["type"])
    del file["type"]


@trick(r"\\x1b\[31mred: allowed in a name are letters")
def name_that_colours_a_terminal(file):
    file["\x1b[31mred"] = 1.0


@trick("allowed in a name are letters")
def name_that_turns_into_another(file):
    add(file, "ra_nc4_non_coord_tio")


@trick("more: has no units")
def no_unit(file):
    del add(file).attrs["units"]


@trick("ratio: has no long_name")
def empty_name(file):
    file["ratio"].attrs["long_name"] = " "


@trick("ratio: has no units")
def unit_that_is_a_number(file):
    file["ratio"].attrs["units"] = 1


@trick("ratio: attribute scale_factor: makes readers change the numbers")
def packed(file):
    file["ratio"].attrs["scale_factor"] = 2.0


@trick("verdict: attribute dtype: makes readers change the numbers")
def turned_into_truth(file):
    file["verdict"].attrs["dtype"] = "bool"


@trick("the file: has 2.. attributes: allowed are 200")
def many_attributes(file):
    for number in range(200):
        file.attrs[f"a{number}"] = 1


@trick("the file: attribute much: 1001 values: allowed are 1000")
def long_attribute(file):
    file.attrs["much"] = np.zeros(1001)


@trick("the file: attribute much: 100001 characters: allowed are 100000")
def long_text(file):
    file.attrs["much"] = "x" * 100_001


@trick("the file: attribute much: allowed is one text")
def many_texts(file):
    file.attrs["much"] = ["x", "y"]


@trick("the file: attribute title: is not UTF-8 text")
def text_of_another_encoding(file):
    file.attrs["title"] = np.bytes_(b"W\xfcrfel")


@trick("the file: attribute title: has control characters")
def text_that_clears_a_terminal(file):
    file.attrs["title"] = "\x1b[2J"


@trick("the file: attribute more: allowed are plain text and plain numbers")
def attribute_of_references(file):
    file.attrs["more"] = file["ratio"].ref


@trick("the file: attribute more: allowed is one value")
def attribute_without_a_value(file):
    file.attrs["more"] = h5py.Empty("f8")


@trick("the file: attribute more: allowed is one value")
def attribute_that_is_a_table(file):
    file.attrs["more"] = np.zeros((2, 2))


@trick("verdict: an enum is whole numbers, with flag_values 0, 1")
def enum_without_values(file):
    del file["verdict"].attrs["flag_values"]


@trick("verdict: an enum")
def enum_with_too_few_words(file):
    file["verdict"].attrs["flag_meanings"] = "one"


@trick("verdict: an enum")
def enum_in_another_order(file):
    file["verdict"].attrs["flag_values"] = np.array([1, 0], np.int8)


@trick("ratio: an enum")
def enum_that_is_no_whole_number(file):
    file["ratio"].attrs.update(enum_attributes("verdict", ["one", "two"]))


@trick("verdict = 2: allowed is 0 to 1")
def enum_value_without_a_word(file):
    file["verdict"][7] = 2


@trick("stiffness: a coordinate that is not finite")
def coordinate_that_is_no_number(file):
    file["stiffness"][150] = np.nan


@trick("member: a dimension has one axis")
def dimension_without_a_number(file):
    del file["member"].attrs["_Netcdf4Dimid"]


@trick("a dimension has one axis, and a number .* of its own")
def dimensions_with_one_number(file):
    file["member"].attrs["_Netcdf4Dimid"] = file["cell"].attrs["_Netcdf4Dimid"]


@trick("member: _Netcdf4Coordinates names another dimension")
def dimension_that_takes_the_place_of_another(file):
    file["member"].attrs["_Netcdf4Coordinates"] = file["cell"].attrs["_Netcdf4Dimid"]


@trick("member: attribute CLASS = DIMENSION: allowed")
def dimension_of_another_class(file):
    file["member"].attrs["CLASS"] = np.bytes_("DIMENSION")


@trick("member: attribute CLASS: is of another type")
def class_of_another_type(file):
    file["member"].attrs["CLASS"] = "DIMENSION_SCALE"


@trick("more: DIMENSION_LIST: allowed is a dimension of this file for each axis")
def no_dimensions(file):
    add(file, dimensions=())


def with_references(file, *references):
    more = add(file, dimensions=())
    value = np.empty(len(references), object)
    for axis, reference in enumerate(references):
        value[axis] = np.array(reference, h5py.ref_dtype)
    more.attrs.create("DIMENSION_LIST", value, dtype=h5py.vlen_dtype(h5py.ref_dtype))


@trick("more: DIMENSION_LIST: allowed is a dimension of this file for each axis, as long")
def longer_than_its_dimension(file):
    add(file, values=np.zeros(4))


@trick("more: DIMENSION_LIST: allowed is a dimension")
def dimension_that_is_none(file):
    with_references(file, [file["total"].ref])


@trick("more: DIMENSION_LIST: allowed is one dimension for each axis")
def two_dimensions_on_one_axis(file):
    with_references(file, [file["member"].ref, file["cell"].ref])


@trick("more: DIMENSION_LIST: allowed is one dimension for each axis")
def dimension_that_points_nowhere(file):
    with_references(file, [h5py.Reference()])


@trick("not a readable HDF5 file|DIMENSION_LIST: allowed is a dimension")
def dimension_that_is_gone(file):
    gone = file.create_dataset("gone", (3,), "f8")
    with_references(file, [gone.ref])
    del gone, file["gone"]


@trick("DIMENSION_LIST names a dimension twice")
def the_same_dimension_twice(file):
    add(file, values=np.zeros((3, 3)), dimensions=("member", "member"))


@trick("ratio: attribute DIMENSION_LIST: is of another type")
def dimensions_by_name(file):
    del file["ratio"].attrs["DIMENSION_LIST"]
    file["ratio"].attrs["DIMENSION_LIST"] = "cell member"


@trick("the file: attribute scene: is not the scene that scene_digest was made of")
def another_scene(file):
    file.attrs["scene"] = json.dumps(Scene().with_ground(stiffness=1e5).as_mapping())


@pytest.mark.parametrize("text", ["{", "[" * 50_000, '{"a": NaN}', "3"])
def test_a_scene_is_json(stored, text):
    def spoil(file):
        file.attrs["scene"] = text

    refuses(stored, spoil, "the file: attribute scene: ")


@trick("has no format_version")
def no_version(file):
    del file.attrs["format_version"]


def refuses(path, spoil, told):
    """State that a spoilt file is refused alike by each reader, in one line with its name."""
    with h5py.File(path, "a") as file:
        spoil(file)
    seal.seal(path)
    for read in (open_file, lambda file: list(parts(file, 7))):
        with pytest.raises(RefusedError, match=told) as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", TRICKS)
def test_what_is_not_ours_is_refused(stored, name):
    refuses(stored, *TRICKS[name])


def test_another_process_refuses_the_same(tmp_path, image):
    """All of them, and one that is sound in their midst, by one child."""
    told = {}
    for name, (spoil, reason) in TRICKS.items():
        told[path := tmp_path / f"{name}.h5"] = reason
        path.write_bytes(image)
        with h5py.File(path, "a") as file:
            spoil(file)
        seal.seal(path)
    told[tmp_path / "missing.h5"] = "No such file"
    sound = tmp_path / "sound.h5"
    sound.write_bytes(image)
    paths = list(told)
    found = isolation.refused([*paths[:20], sound, *paths[20:]])
    assert list(found) == [str(path) for path in paths]
    for path in paths:
        assert re.search(told[path], str(found[str(path)])), path
        assert str(found[str(path)]).startswith(f"{path}: ")


@pytest.mark.parametrize("version", ["2.0", "1", "1.x", "01.2", "1.2.3", "", "\x1b", "11.0", "-1.0"])
def test_versions_that_mean_something_else_are_refused(stored, version):
    def spoil(file):
        file.attrs["format_version"] = version

    refuses(stored, spoil, "format_version|control characters")


def test_a_number_is_no_version(stored):
    def spoil(file):
        file.attrs["format_version"] = 1.2

    refuses(stored, spoil, r"format_version = 1\.2: allowed is 1\.x")


def test_a_later_version_of_the_same_format_is_read(stored):
    """The part before the dot tells whether an older reader understands a file."""
    with h5py.File(stored, "a") as file:
        file.attrs["format_version"] = "1.99"
        file.attrs["more"] = "that this reader knows nothing of"
        add(file)
    with pytest.raises(RefusedError, match="has no seal"):
        open_file(stored)
    seal.seal(stored)
    assert "more" in open_file(stored)
    assert FORMAT_VERSION < "1.99"


def test_bytes_before_the_content_are_refused(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w", userblock_size=512) as file:
        file.attrs["format_version"] = FORMAT_VERSION
    seal.seal(tmp_path / "x.h5")
    with pytest.raises(RefusedError, match="has 512 bytes before its HDF5 content"):
        open_file(tmp_path / "x.h5")


def test_values_beyond_the_end_are_refused(stored, image):
    """A file that was cut short, though its seal was made again."""
    content = image[: -seal.LENGTH]
    for length in range(len(content) // 2, len(content), len(content) // 9):
        stored.write_bytes(content[:length])
        seal.seal(stored)
        with pytest.raises(RefusedError, match=f"{stored}: not a readable HDF5 file"):
            open_file(stored)


def test_more_than_the_memory_is_not_loaded(stored, monkeypatch):
    monkeypatch.setattr(os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 1}.__getitem__)
    with pytest.raises(InputError, match=f"{stored}: holds .* GB: this machine has 4.1e-06 GB of memory"):
        open_file(stored)
    assert len(list(parts(stored, 7))) == 29


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "x.h5")
    with pytest.raises(InputError, match="is not a regular file"):
        open_file(tmp_path / "x.h5")


def test_files_of_runs_have_cells(tmp_path):
    write_dataset(whole()[["total"]].drop_vars(["member", "stiffness"], errors="ignore"), tmp_path / "x.h5")
    with pytest.raises(RefusedError, match="has no dimension cell"):
        list(parts(tmp_path / "x.h5", 7))


def test_a_chunk_where_no_values_are_is_refused(stored):
    """One number in the tree of the chunks: the library would give zeros for the values that are gone."""
    with h5py.File(stored, "a") as file:
        more = file.create_dataset("more", data=np.arange(1.0, 3001.0), chunks=(1000,), compression="gzip")
        more.attrs.update(ABOUT)
    image = bytearray(stored.read_bytes())
    key = bytes(4) + struct.pack("<QQ", 2000, 0)  # no filter left out, where the chunk begins
    place = image.find(key)
    assert place > 0 and image.find(key, place + 1) < 0
    image[place + 4 : place + 12] = struct.pack("<Q", 9000)
    stored.write_bytes(image)
    with h5py.File(stored) as file:
        assert file["more"].id.get_num_chunks() == 3 and not file["more"][2000:].any()
    seal.seal(stored)
    with pytest.raises(RefusedError, match=r"more: a chunk at \(9000,\), where none of its values are"):
        open_file(stored)
