"""Install what a lock file pins into the virtual environment that runs this, every file checked against its hash:
install_extras.py FOLDER/engines.lock [NAME...].

Each package that is named in engines.in beside it is installed for itself, with what it needs: one that has no wheel
for this Python is left out with a line, and so is not in the way of the others. Nothing is built.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# What can be installed beside what requirements.lock pins, each from a lock file of its own.
EXTRAS = ("engines", "docs")


def asked(lock: Path) -> list[str]:
    """Return the packages that a lock file was made for: the names in the .in file beside it."""
    lines = lock.with_suffix(".in").read_text(encoding="utf-8").splitlines()
    return [line.split()[0] for line in lines if line and line[0] not in "#-"]


def needed(lock: str, package: str) -> dict[str, str]:
    """Return the part of a lock file's text that one package needs: pins with their hashes, by package."""
    blocks = {block.partition("==")[0]: block for block in re.split(r"^(?=\w)", lock, flags=re.MULTILINE)[1:]}
    # `# via` says who asked for a package: one name beside it, or one in each line below.
    asker = re.compile(r"^    #(?: via)? +([\w.-]+)$", re.MULTILINE)
    askers = {name: set(asker.findall(block)) for name, block in blocks.items()}
    names = {package}
    while True:
        more = {name for name, by in askers.items() if by & names} - names
        if not more:
            return {name: blocks[name] for name in blocks if name in names}
        names |= more


def pip() -> list[str]:
    """Return how pip is called for this environment: its own, or that of the Python that made it."""
    if importlib.util.find_spec("pip"):
        return [sys.executable, "-m", "pip"]
    return [os.environ.get("PYTHON", "python3"), "-m", "pip", "--python", sys.executable]


def install(blocks: dict[str, str]) -> str:
    """Install what these parts of a lock file pin, and return what went wrong, in one line; nothing if all is well."""
    with tempfile.TemporaryDirectory() as folder:
        pins = Path(folder) / "pins.txt"
        pins.write_text("".join(blocks.values()), encoding="utf-8")
        options = ["--quiet", "--no-warn-script-location", "--require-hashes", "--only-binary", ":all:"]
        quiet = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_NO_INPUT": "1"}
        command = [*pip(), "install", *options, "-r", str(pins)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=quiet)
    if done.returncode == 0:
        return ""
    missing = re.search(r"No matching distribution found for (\S+)", done.stderr)
    if missing:
        here = f"Python {platform.python_version()} on {sys.platform} {platform.machine()}"
        return f"no wheel of {missing[1]} for {here} was found"
    return (done.stderr.strip().splitlines() or [f"pip ended with status {done.returncode}"])[-1]


def main(lock: Path, *names: str) -> int:
    """Install what can be, of these packages or of all that a lock file was made for; return 2 if nothing could."""
    text = lock.read_text(encoding="utf-8")
    ready = 0
    for name in names or asked(lock):
        wrong = install(needed(text, name))
        ready += not wrong
        print(f"stiffdice: {name} is {f'left out: {wrong}' if wrong else 'ready'}", flush=True)
    return 0 if ready else 2


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *sys.argv[2:]))
