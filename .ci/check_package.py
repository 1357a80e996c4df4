"""Install the wheel and the source distribution where there is no checkout, and use them: check_package.py.

Each goes into an environment of its own, which has the locked packages of this Python and nothing of the checkout.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import tomllib
import venv
import zipfile
from pathlib import Path

from flit_core import buildapi

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = PROJECT["version"]
NAME = f"stiffdice-{VERSION}"

# What a person's own script looks like to a type checker: wrong in its last line alone.
SCRIPT = """\
import stiffdice
run = stiffdice.simulate(stiffdice.load_scene("cube.yaml"), steps=100)
sentence: str = stiffdice.Verdict(run.verdict[0]).sentence
wrong: int = sentence
"""
INSPECT = """\
import importlib.metadata as metadata, pathlib, sys, stiffdice
folder = pathlib.Path(stiffdice.__file__).parent
assert pathlib.Path(sys.prefix) in folder.parents, folder
assert stiffdice.__version__ == metadata.version("stiffdice")
assert (folder / "py.typed").is_file()
print(metadata.distribution("stiffdice").read_text("licenses/LICENSE"))
"""
CUBE = "preset: as_written\nground: {stiffness: 2 kN/m, restitution: 0.9}\nduration: 1\n"

# Where there is no checkout: words, exit status, and what is said.
COMMANDS = (
    ("--version", 0, NAME.replace("-", " ")),
    ("run cube.yaml --model sliding --steps 10000 -o cube.h5", 0, "cube.h5: passed"),
    ("run config/scenes/figure-09.yaml --model sliding -o stiff.h5", 0, "comes with stiffdice"),
    ("run figure-09 --model sliding --preset as_written -o written.h5", 0, "comes with stiffdice"),
    ("inspect cube.h5", 0, "position"),
    ("verify cube.h5", 0, "cube.h5"),
    ("diff stiff.h5 written.h5", 1, "differ"),
    ("ground --restitution 0.5 --mass 4g --side 16mm --speed 2 --depth 0.1mm --quick", 0, "ground:"),
    ("infer counts.yaml", 0, "faces"),
    ("status", 2, "config/: No such folder; call this in the project's folder"),
    ("archive quick", 2, "config/: No such folder; call this in the project's folder"),
    ("rebuild quick.zip", 2, "quick.zip: No such file"),
    ("tosses tosses.h5", 2, "tosses.h5: No such file"),
    ("check ball.xml", 2, "ball.xml: No such file"),
)


def check(condition: object, what: str, said: str = "") -> None:
    """End with status 1, and what was said, unless the condition holds."""
    if not condition:
        sys.exit(f"check_package: not so: {what}\n{said}")
    print(f"ok: {what}")


def run(words: list[str], folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, with nothing of the checkout in its environment."""
    there = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")} | environment
    return subprocess.run(words, cwd=folder, env=there, capture_output=True, text=True, check=False)


def built(folder: Path) -> tuple[Path, Path]:
    """Return the source distribution of the checkout, and the wheel built from what that unpacks to."""
    os.chdir(ROOT)
    with tarfile.open(folder / buildapi.build_sdist(str(folder))) as packed:
        packed.extractall(folder, filter="data")
    os.chdir(folder / NAME)
    return folder / f"{NAME}.tar.gz", folder / buildapi.build_wheel(str(folder))


def installed(package: Path, place: Path) -> Path:
    """Return the Python of a new environment that has a package installed, and this one's other packages beside it."""
    venv.create(place)
    (pure,) = place.glob("lib/python*/site-packages")
    # Of a folder named in a .pth file no .pth file is read: not the one that would name the checkout.
    (pure / "locked.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "--python", str(place), "install", "-q", "--no-deps", "--no-index"]
    done = run([*pip, "--no-build-isolation", "--no-compile", str(package)], place.parent)
    if done.returncode:
        sys.exit(f"check_package: {package.name} cannot be installed\n{done.stderr}")
    return place / "bin" / "python"


def contents(wheel: Path) -> dict[str, str]:
    """Return the digests of what is in a wheel, by name."""
    with zipfile.ZipFile(wheel) as packed:
        return {name: hashlib.sha256(packed.read(name)).hexdigest() for name in packed.namelist()}


def check_use(python: Path, folder: Path, label: str) -> None:
    """Use what is installed in a folder that is empty but for a scene and some counts."""
    folder.mkdir()
    (folder / "cube.yaml").write_text(CUBE, encoding="utf-8")
    (folder / "counts.yaml").write_text("counts: [17, 15, 20, 18, 16, 14]\n", encoding="utf-8")
    seen = run([str(python), "-c", INSPECT], folder)
    check(seen.returncode == 0, f"{label}: imported, typed, its version the metadata's", seen.stderr)
    check(seen.stdout.strip() == (ROOT / "LICENSE").read_text(encoding="utf-8").strip(), f"{label}: has the licence")
    for words, status, told in COMMANDS:
        done = run([str(python.parent / "stiffdice"), *words.split()], folder)
        said = done.stdout + done.stderr
        right = done.returncode == status and told in said and (status != 2 or said.count("\n") == 1)
        check(right, f"{label}: stiffdice {words}", f"status {done.returncode}\n{said}")
    done = run([str(python), "-m", "stiffdice", "--version"], folder)
    check(VERSION in done.stdout, f"{label}: python -m stiffdice")


def check_types(python: Path, folder: Path) -> None:
    """Check the types of a script that uses the library."""
    (folder / "script.py").write_text(SCRIPT, encoding="utf-8")
    cache = ["--cache-dir", str(ROOT / ".mypy_cache/package")]
    words = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(python), *cache, "script.py"]
    said = run(words, folder).stdout
    check(said.count("error:") == 1 and "script.py:4" in said, "mypy --strict knows the library's types", said)


def main() -> None:
    """Build both, install each, use each."""
    with tempfile.TemporaryDirectory() as place:
        top = Path(place)
        source, wheel = built(top)
        os.chdir(ROOT)
        check(contents(top / buildapi.build_wheel(str(top))) == contents(wheel), "sdist and checkout give one wheel")
        dry = run([sys.executable, "-m", "snakemake", "-n", "-q", "--cores", "1"], top / NAME, PYTHONPATH="src")
        check(dry.returncode == 0, "the source distribution has what the workflow needs", dry.stderr)
        for package in (wheel, source):
            label = "wheel" if package is wheel else "sdist"
            python = installed(package, top / label)
            check_use(python, top / f"empty-{label}", label)
        check_types(python, top / "empty-sdist")


if __name__ == "__main__":
    main()
