"""Files that someone made to mislead, each sealed as ours are: refused in one line that names what is wrong in them."""

from __future__ import annotations

import json
import os
import re
import zlib
from types import SimpleNamespace

import h5py
import numpy as np
import psutil
import pytest
import xarray as xr

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, seal
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.reader import open_file, parts
from stiffdice.io.structure_check import FORMAT_VERSION
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Scene
from stiffdice.simulation.dataset import provenance_attributes

PIECE = 2 << 20  # bytes of a chunk
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


@trick("more: a group or a named type")
def named_type(file):
    file["more"] = np.dtype("f8")


@trick("more: a group or a named type")
def group_that_holds_itself(file):
    more = file.create_group("more")
    more["again"] = more


@trick("holds 9.223e\\+12 MB in a file of")
def absurd_shape(file):
    file.create_dataset("more", (2**60,), "f8", chunks=(1000,))


@trick("holds 1.153e\\+12 MB in a file of")
def absurd_product(file):
    file.create_dataset("more", (2**20,) * 3, "i1", chunks=(10, 10, 10))


@trick("not a readable HDF5 file")
def absurd_dimension(file):
    del file["member"]
    file.create_dataset("member", (2**60,), "f4", chunks=(1000,)).make_scale(
        "This is a netCDF dimension but not a netCDF variable. 3"
    )


@trick("holds 2.4e\\+04 MB in a file of .* MB: allowed are 536.9 MB")
def too_much_in_all(file):
    for name in ("more", "most"):
        file.create_dataset(name, (12_000, 1_000_000), "i1", chunks=(1, 1_000_000), compression="gzip")


@trick("holds 629.* MB in a file of .* MB: allowed are 536.9 MB")
def zeros_that_pack_well(file):
    """Every chunk is there and sound, and stands for a thousand times what it takes."""
    size = PIECE // 8
    more = file.create_dataset("more", (300 * size,), "f8", chunks=(size,), compression="gzip")
    block = zlib.compress(bytes(PIECE), 9)
    for number in range(300):
        more.id.write_direct_chunk((number * size,), block)


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


@trick("more: has no shape")
def empty(file):
    file["more"] = h5py.Empty("f8")


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

    refuses(stored, of_that_type, "more: its type: allowed are int8, int16, int32, int64, float32, float64")


@trick("more: its type: allowed are int8")
def type_by_reference(file):
    file["type"] = np.dtype("f8")
    file.create_dataset("more", (3,), file["type"])
    del file["type"]


@trick(r"\\x1b\[31mred: allowed in a name are letters")
def name_that_colours_a_terminal(file):
    file["\x1b[31mred"] = 1.0


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


@trick("the file: attribute more: allowed is one text, one number, or a list of numbers")
def attribute_without_a_value(file):
    file.attrs["more"] = h5py.Empty("f8")


@trick("the file: attribute more: allowed is one text, one number, or a list of numbers")
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


@trick("ratio: DIMENSION_LIST: allowed is a dimension of this file")
def dimension_of_another_class(file):
    file["member"].attrs["CLASS"] = np.bytes_("DIMENSION")


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


@trick("more: DIMENSION_LIST: allowed is a dimension of this file for each axis")
def two_dimensions_on_one_axis(file):
    with_references(file, [file["member"].ref, file["cell"].ref])


@trick("not a readable HDF5 file")
def dimension_that_points_nowhere(file):
    with_references(file, [h5py.Reference()])


@trick("not a readable HDF5 file|DIMENSION_LIST: allowed is a dimension")
def dimension_that_is_gone(file):
    gone = file.create_dataset("gone", (3,), "f8")
    with_references(file, [gone.ref])
    del gone, file["gone"]


@trick("more: DIMENSION_LIST: allowed is a dimension of this file for each axis")
def the_same_dimension_twice(file):
    add(file, values=np.zeros((3, 3)), dimensions=("member", "member"))


@trick("not a readable HDF5 file")
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


def test_values_beyond_the_end_are_refused(stored, image):
    """A file that was cut short, though its seal was made again."""
    content = image[: -seal.LENGTH]
    for length in range(len(content) // 2, len(content), len(content) // 9):
        stored.write_bytes(content[:length])
        seal.seal(stored)
        with pytest.raises(RefusedError, match=f"{stored}: not a readable HDF5 file"):
            open_file(stored)


def test_more_than_the_memory_is_not_loaded(stored, monkeypatch):
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(total=4096))
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
