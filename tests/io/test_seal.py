from __future__ import annotations

import pytest

from stiffdice.errors import RefusedError
from stiffdice.io import seal

CONTENT = bytes(range(256)) * 5


@pytest.fixture
def sealed(tmp_path):
    path = tmp_path / "x.h5"
    path.write_bytes(CONTENT)
    seal.seal(path)
    return path


def test_a_sealed_file_is_its_content_and_a_line(sealed):
    assert sealed.read_bytes() == CONTENT + seal.line_of(CONTENT)
    assert len(seal.line_of(CONTENT)) == seal.LENGTH
    assert seal.is_sealed(sealed)
    seal.check(sealed)


@pytest.mark.parametrize("bit", range(8))
def test_no_bit_of_the_content_can_change(sealed, bit):
    whole = sealed.read_bytes()
    for place in range(0, len(CONTENT), 37):
        sealed.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :])
        with pytest.raises(RefusedError, match="damaged: its content"):
            seal.check(sealed)


@pytest.mark.parametrize("place", range(1, seal.LENGTH + 1))
def test_no_byte_of_the_line_can_change(sealed, place):
    whole = bytearray(sealed.read_bytes())
    whole[-place] ^= 1
    sealed.write_bytes(whole)
    if seal.is_sealed(sealed):
        with pytest.raises(RefusedError, match="damaged"):
            seal.check(sealed)


@pytest.mark.parametrize("length", [0, 1, seal.LENGTH, len(CONTENT), len(CONTENT) + seal.LENGTH - 1])
def test_what_is_cut_short_is_not_sealed(sealed, length):
    sealed.write_bytes(sealed.read_bytes()[:length])
    assert not seal.is_sealed(sealed)


def test_bytes_may_not_be_added_or_taken_before_the_line(sealed):
    line = seal.line_of(CONTENT)
    for content in (CONTENT[:-1], CONTENT + b"x", b""):
        sealed.write_bytes(content + line)
        with pytest.raises(RefusedError, match=f"damaged: {len(content)} bytes long"):
            seal.check(sealed)
