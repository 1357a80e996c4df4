"""Spoilt files, hundreds of them, and thousands with STIFFDICE_FUZZ=10000 (for each reader): never a crash, a hang, or
a number that is silently another one.

A case that fails is tried again alone by: python -m tests.fuzz.worker READER SEED 1
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.fuzz.hdf5_blocks import blocks, changed, lookup3
from tests.fuzz.mutations import bytes_of, text_of
from tests.fuzz.readers import READERS

TOP = Path(__file__).parent.parent.parent
CASES = {
    "scene": 200,
    "set": 300,
    "study": 30,
    "manifest": 300,
    "zip": 200,
    "crate": 200,
    "damaged": 100,
    "forged": 100,
    "tosses": 60,
}


def tried(readers, share):
    """Let one process try a share of the cases of some readers."""
    first = int(os.environ.get("STIFFDICE_FUZZ_FIRST", "0"))
    counts = {reader: round(share * int(os.environ.get("STIFFDICE_FUZZ", CASES[reader]))) for reader in readers}
    asked = [word for reader, count in counts.items() for word in (reader, str(first), str(count))]
    command = [sys.executable, "-m", "tests.fuzz.worker", *asked]
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True, errors="replace", check=False)
    told = done.stderr.splitlines()
    last = [line for line in told if line.partition(" ")[0] in counts][-1:]
    assert done.returncode == 0, f"{done.stdout}\nlast case: {last}, status {done.returncode}\n{done.stderr[-3000:]}"
    assert {f"{reader} {first + count - 1}" for reader, count in counts.items()} <= {*told}


@pytest.mark.long
def test_some_spoilt_files_are_refused_in_one_line_or_sound():
    """Of each reader a few, in one process."""
    tried(READERS, 0.2)


@pytest.mark.broad
@pytest.mark.parametrize("reader", READERS)
def test_a_spoilt_file_is_refused_in_one_line_or_sound(reader):
    tried([reader], 1)


@pytest.mark.parametrize("spoil", [bytes_of, text_of])
def test_a_seed_always_makes_the_same_case(spoil):
    sample, others = b"gravity: 9.8\nground: {stiffness: 1.0e4}\n", [b"duration: 10\n"]
    cases = [spoil(sample, others, seed) for seed in range(200)]
    assert cases == [spoil(sample, others, seed) for seed in range(200)]
    assert len(set(cases)) > 100


def test_checksums_are_those_of_the_library():
    assert lookup3(b"") == 0xDEADBEEF  # as lookup3.c says of nothing from 0
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # its own example


def test_changed_blocks_have_right_checksums(tmp_path):
    samples = READERS["forged"](tmp_path).samples
    known = blocks(samples[0])
    assert len(known) > 15
    spoilt = [changed(samples[0], samples, seed) for seed in range(30)]
    assert sum(
        lookup3(image[a:b]) == int.from_bytes(image[b : b + 4], "little") for image in spoilt for a, b in known
    ) > (0.7 * len(spoilt) * len(known))
