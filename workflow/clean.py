"""Remove all results, and what Snakemake notes of them, unless a study is being made: clean.py."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# The library of this checkout, installed or not.
sys.path.insert(0, str(ROOT / "src"))

import lock  # noqa: E402


def main() -> int:
    """Remove them and return the exit status."""
    try:
        for path in lock.files(ROOT):
            lock.hold(path.parents[len(lock.FOLDER.parts)], path.name)
    except lock.RunningError as error:
        print(f"stiffdice: {error}; nothing was removed", file=sys.stderr)
        return 2
    for path in (ROOT / "results").iterdir():
        if path.name != "README.md":
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    shutil.rmtree(ROOT / ".snakemake", ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
