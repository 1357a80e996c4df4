"""Whatever became of a compiled kernel on disk, a run gives the same bytes, and the cache is whole afterwards."""

from __future__ import annotations

import hashlib
import itertools
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.forks import run_code

from stiffdice.dynamics.compiling.kernel_files import KernelFiles

ROOT = Path(__file__).parents[3]
KERNEL = {"code": bytes(range(32))}


class Bomb:
    def __reduce__(self):
        return (os._exit, (9,))


@pytest.fixture
def kernels(tmp_path):
    return KernelFiles(tmp_path, "march", "stamp")


def is_healed(kernels):
    """A damaged kernel is as good as none, and the next one replaces it."""
    assert kernels.load("key") is None
    kernels.save("key", KERNEL)
    assert [path.name for path in kernels.path("key").parent.iterdir()] == [kernels.path("key").name]
    return kernels.load("key") == KERNEL


def test_a_kernel_cut_short_anywhere_is_made_again(kernels):
    kernels.save("key", KERNEL)
    whole = kernels.path("key").read_bytes()
    for length in range(len(whole)):
        kernels.path("key").write_bytes(whole[:length])
        assert is_healed(kernels)


@pytest.mark.long
def test_a_kernel_with_a_bit_of_any_byte_flipped_is_made_again(kernels):
    kernels.save("key", KERNEL)
    whole = kernels.path("key").read_bytes()
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << place % 8
        kernels.path("key").write_bytes(damaged)
        assert kernels.load("key") is None
    assert is_healed(kernels)


def test_nothing_that_does_not_match_its_digest_is_unpickled(kernels):
    content = pickle.dumps(Bomb())
    for digest in (bytes(32), hashlib.sha256(content + b"x").digest(), hashlib.sha256().digest(), b""):
        kernels.path("key").write_bytes(digest + content)
        assert is_healed(kernels)


def test_another_kernel_under_its_name_is_not_taken_for_it(kernels, tmp_path):
    kernels.save("other key", KERNEL)
    kernels.path("other key").rename(kernels.path("key"))
    assert is_healed(kernels)
    other = KernelFiles(tmp_path, "march", "stamp of an older source")
    kernels.path("key").rename(other.path("key"))
    assert other.load("key") is None


def test_a_folder_in_its_place_goes(kernels):
    (kernels.path("key") / "sub").mkdir(parents=True)
    assert is_healed(kernels)


def test_a_link_in_its_place_goes_and_what_it_points_at_stays(kernels, tmp_path_factory):
    target = tmp_path_factory.mktemp("other") / "file"
    target.write_bytes(b"mine")
    kernels.path("key").symlink_to(target)
    assert is_healed(kernels)
    assert target.read_bytes() == b"mine"


TWO = """
import sys
from pathlib import Path
from stiffdice.dynamics.compiling.kernel_files import KernelFiles
kernels = KernelFiles(Path(sys.argv[1]), "march", "stamp")
for k in range(100):
    if k % 7 == 0:
        kernels.path("shared").write_bytes(b"cut short")
    for key in ("shared", sys.argv[2]):
        found = kernels.load(key)
        assert found in (None, key * 1000), found
        kernels.save(key, key * 1000)
assert kernels.load(sys.argv[2]) == sys.argv[2] * 1000
"""


@pytest.mark.long
def test_processes_that_write_at_once_read_whole_kernels_or_none(kernels, tmp_path):
    """Among them is damage, too."""
    started = [subprocess.Popen([sys.executable, "-c", TWO, tmp_path, name]) for name in ("one", "two", "three")]
    assert [process.wait() for process in started] == [0, 0, 0]
    names = {kernels.path(key).name for key in ("shared", "one", "two", "three")}
    assert {path.name for path in tmp_path.iterdir()} == names


# A kernel that compiles quickly, and what it says.
ENERGY = """
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.scene.scene import from_mapping
scene = from_mapping({})
print(energies(physics_of(scene), start_of(scene, "sliding")))
"""
HITS = "print(next(iter(energies.dispatcher.stats.cache_hits.values()), 0))"


def energies(cache, prefix=(), source=ROOT / "src"):
    """Return what the kernel says in a process of its own, and how often it was found stored."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(source)}
    command = [*prefix, sys.executable, "-c", ENERGY + HITS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said, hits = done.stdout.splitlines()
    return said, int(hits)


def run(folder, out, prefix=(), **changes):
    scene = ["config/scenes/figure-09.yaml", "--model", "vertical", "--every", "5000"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")} | changes
    done = subprocess.run(
        [*prefix, sys.executable, "-m", "stiffdice.cli", "run", *scene, "-o", str(folder / out)],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return (folder / out).read_bytes()


def cached(folder):
    return {path: path.read_bytes() for path in sorted((folder / "cache").rglob("*.nbc")) if path.is_file()}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with the kernels of a run, and what the run stored."""
    folder = tmp_path_factory.mktemp("compiled")
    return folder, run(folder, "first.h5")


def flipped(path, whole, rng):
    damaged = bytearray(whole)
    damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
    path.write_bytes(damaged)


def cut_short(path, whole, rng):
    path.write_bytes(whole[: rng.integers(len(whole))])


def emptied(path, whole, rng):
    path.write_bytes(b"")


def made_a_folder(path, whole, rng):
    path.unlink()
    path.mkdir()


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A folder with the one kernel, and what that says."""
    folder = tmp_path_factory.mktemp("stored")
    return folder, energies(folder / "cache")[0]


@pytest.mark.parametrize("damage", [flipped, pytest.param(made_a_folder, marks=pytest.mark.broad)])
@pytest.mark.long
def test_a_damaged_kernel_is_compiled_again_and_says_the_same(stored, damage):
    folder, said = stored
    ((path, whole),) = cached(folder).items()
    damage(path, whole, np.random.default_rng(15))
    assert energies(folder / "cache") == (said, 0)
    assert energies(folder / "cache") == (said, 1)


@pytest.mark.broad
def test_a_run_on_damaged_kernels_gives_the_same_bytes_and_heals_them(compiled):
    """Each kernel damaged in its own way."""
    folder, first = compiled
    whole, rng = cached(folder), np.random.default_rng(15)
    damages = (flipped, cut_short, emptied, made_a_folder)
    assert len(whole) >= len(damages)
    for damage, (path, content) in zip(itertools.cycle(damages), whole.items(), strict=False):
        damage(path, content, rng)
    assert run(folder, "again.h5") == first
    healed = cached(folder)
    assert healed.keys() == whole.keys()
    assert run(folder, "warm.h5") == first
    assert cached(folder) == healed  # nothing was compiled again


@pytest.mark.long
def test_a_kernel_that_cannot_be_stored_serves_its_process(stored, tmp_path):
    assert energies(tmp_path, ["prlimit", "--fsize=5000"]) == (stored[1], 0)
    assert not list(tmp_path.rglob("*.nbc"))


@pytest.mark.broad
def test_kernels_that_cannot_be_stored_serve_the_run(compiled, tmp_path):
    """No file of this process may be as long."""
    _, first = compiled
    assert run(tmp_path, "out.h5", ["prlimit", "--fsize=53000"]) == first
    assert not list(tmp_path.rglob("*.nbc"))


@pytest.mark.long
def test_a_copy_of_the_project_finds_its_kernels(stored, tmp_path):
    """They are known by the digest of what they stand on, not by where that lies."""
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    folder, said = stored
    assert energies(folder / "cache", source=tmp_path / "src") == (said, 1)


TOGETHER = """
import sys
from stiffdice.dynamics.compiling import kernel_files
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

store = kernel_files.KernelFiles.save

def save(self, key, kernel):
    with open(sys.argv[1], "a") as file:
        file.write(f"{self.path(key).name}\\n")
    store(self, key, kernel)

kernel_files.KernelFiles.save = save
"""
RUN = """
run = simulate(from_mapping({}), model="vertical", steps=10, every=1)
print(float(run.trajectory.state["position"][-1, 2]).hex())
"""


@pytest.mark.parametrize(
    ("what", "count"),
    [
        pytest.param(ENERGY, 1, marks=pytest.mark.long),
        pytest.param(RUN, 6, marks=pytest.mark.broad),
    ],
    ids=["kernel", "run"],
)
def test_what_one_process_compiles_another_waits_for(tmp_path, what, count):
    """Two processes make each kernel once, and agree; of a run each has a helper of its own."""
    environment, saved = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, tmp_path / "saved"
    command = [sys.executable, "-c", TOGETHER + what, str(saved)]
    started = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = {process.communicate()[0] for process in started}
    assert [process.returncode for process in started] == [0, 0]
    assert len(said) == 1
    kernels = saved.read_text().splitlines()
    assert len(kernels) == len(set(kernels)) == count
    assert {path.name for path in tmp_path.rglob("*.nbc")} == set(kernels)


CHOSEN = "import os, stiffdice.dynamics.compiling.compiler; print(os.environ['NUMBA_CACHE_DIR'])"


def chosen(folder, **places):
    """Return the folder for kernels that a new process chooses, its caches and temporary files at these places."""
    environment = {key: value for key, value in os.environ.items() if key not in {"NUMBA_CACHE_DIR", "XDG_CACHE_HOME"}}
    environment |= {"HOME": str(folder / "nowhere/home"), "TMPDIR": str(folder)} | places
    done = run_code(CHOSEN, cwd=folder, environment=environment)
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.strip())


@pytest.mark.long
def test_where_the_home_cannot_be_written_kernels_lie_with_temporary_files(tmp_path):
    (tmp_path / "nowhere").write_text("")
    first = chosen(tmp_path)
    assert first.parent == tmp_path / f"stiffdice-{os.getuid()}"
    assert [folder.stat().st_mode & 0o777 for folder in (first, first.parent)] == [0o700, 0o700]
    assert chosen(tmp_path) == first


def to_link(folder):
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to("elsewhere")


def to_stranger(folder):
    if os.getuid():
        pytest.skip("only root can give a folder away")
    os.chown(folder, 12345, -1)


@pytest.mark.parametrize("change", [to_link, to_stranger, lambda folder: folder.chmod(0o777)])
@pytest.mark.parametrize("which", ["leaf", "parent"])
@pytest.mark.parametrize("place", ["tmp", pytest.param("home", marks=pytest.mark.broad)])
@pytest.mark.long
def test_a_folder_that_another_could_have_filled_is_not_used(tmp_path, change, which, place):
    if place == "tmp":
        (tmp_path / "nowhere").write_text("")
    first = chosen(tmp_path)
    assert first.parent == (
        tmp_path / f"stiffdice-{os.getuid()}" if place == "tmp" else tmp_path / "nowhere/home/.cache/stiffdice"
    )
    change(first if which == "leaf" else first.parent)
    assert not chosen(tmp_path).resolve().is_relative_to(first.parent.resolve())
