"""One digest for all runs of a sweep, whoever holds them; attributes the same from every reader."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from tests import rounds

from stiffdice.io import content_digest
from stiffdice.io.content_digest import plain, runs_digest
from stiffdice.io.reader import parts


@pytest.mark.parametrize(
    ("this", "that"),
    [
        (1, np.int32(1)),
        (1, np.array([1], np.int8)),
        (True, 1),
        (0.5, np.float32(0.5)),
        (0.5, np.array([0.5])),
        ("text", np.str_("text")),
        ("text", b"text"),
        ([1.0, 2.0], np.array([1.0, 2.0])),
        ((1, 2), np.array([1, 2], ">i2")),
        (["a", "b"], np.array(["a", "b"], object)),
    ],
)
def test_readers_types_of_attributes_do_not_count(this, that):
    assert plain(this) == plain(that)
    assert type(plain(this)) is type(plain(that))


def test_what_no_attribute_can_be_is_refused():
    with pytest.raises(TypeError, match="dict"):
        plain({})


@pytest.fixture(scope="module")
def dealt(small, tmp_path_factory):
    """Its shards, one column in each, and four; by columns in each."""
    return {size: rounds.by_columns(small, size, tmp_path_factory.mktemp(f"by-{size}")) for size in (1, 4)}


@pytest.fixture(scope="module")
def read(dealt):
    """All runs, a column a part."""
    return list(all_parts(dealt[1]))


def digest_of(parts):
    return runs_digest(map(content_digest.cell_digests, parts))


def all_parts(paths, cells=100):
    return itertools.chain.from_iterable(parts(path, cells) for path in paths)


@pytest.mark.long
def test_how_cells_are_dealt_does_not_count(dealt):
    assert (len(dealt[1]), len(dealt[4])) == (6, 2)
    digests = {
        digest_of(all_parts(dealt[1])),
        digest_of(all_parts(reversed(dealt[1]))),
        digest_of(all_parts(dealt[4], cells=7)),
        digest_of(all_parts(dealt[4])),
        digest_of(part.isel(cell=slice(None, None, -1)) for part in all_parts(dealt[4])),
        digest_of(part.assign_attrs(title="another") for part in all_parts(dealt[4])),
    }
    assert len(digests) == 1


def flipped(parts):
    """Change the last bit of one value of one run."""
    ratio = parts[3]["energy_ratio"]
    ratio[0, 1] = np.nextafter(ratio[0, 1], 0.0)
    return parts


def moved(parts):
    """Say that the runs of one column are of another stiffness."""
    parts[3]["stiffness"] = parts[3]["stiffness"] * 2
    return parts


@pytest.mark.parametrize("change", [flipped, moved, lambda parts: parts[1:]], ids=["bit", "cell", "fewer"])
def test_what_the_runs_say_does(read, change):
    assert digest_of(change([part.copy(deep=True) for part in read])) != digest_of(read)


def test_each_cell_has_a_digest_of_its_own(read):
    whole = content_digest.cell_digests(read[0])
    assert len(set(whole.tolist())) == read[0].sizes["cell"] > 1


def test_nan_is_one_value_and_zeros_are_two(read):
    def digest(value):
        part = read[0].copy(deep=True)
        part["energy_ratio"][0, 0] = value
        return digest_of([part])

    payload = np.array([0x7FF8000000000001], np.uint64).view(np.float64)[0]
    assert digest(np.nan) == digest(payload) == digest(-np.nan)
    assert digest(0.0) != digest(-0.0)


def test_the_width_of_numbers_counts_and_their_byte_order_does_not(read):
    narrow = read[0].assign(verdict=read[0].verdict.astype(np.int16))
    turned = read[0].assign(energy_ratio=read[0].energy_ratio.astype(">f8"))
    assert digest_of([narrow]) != digest_of([read[0]]) == digest_of([turned])


def test_cells_hold_numbers_alone(read):
    with pytest.raises(TypeError, match="of cells of type <U1"):
        content_digest.cell_digests(read[0].assign(word=("cell", np.full(read[0].sizes["cell"], "a"))))


def test_a_part_may_hold_no_cells(read):
    empty = read[0].isel(cell=slice(0))
    assert len(content_digest.cell_digests(empty)) == 0
    assert runs_digest([content_digest.cell_digests(empty)]) == runs_digest([])
