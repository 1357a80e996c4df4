"""Write workflow/envs/stiffdice.yaml from the lock file: the same versions, for sites that use conda environments."""

from __future__ import annotations

import re
from pathlib import Path

HERE = Path(__file__).parent
HEAD = """\
# For sites that run rules in conda environments (snakemake --software-deployment-method conda). `make` and CI do not
# use it: they use the hashed lock file, whose versions these are. Written by `make lock`.
channels:
  - conda-forge
  - nodefaults
dependencies:
  - python >=3.11,<3.14
  - pip
  - pip:
"""


def library() -> list[str]:
    """Return the names in requirements.in that the library, not the checks, stands on."""
    text = (HERE / "requirements.in").read_text(encoding="utf-8").partition("# --- the workflow ---")[0]
    return [line.split()[0] for line in text.splitlines() if line and not line.startswith("#")]


def pinned(name: str) -> str:
    """Return `name==version` as the lock file has it."""
    lock = (HERE / "requirements.lock").read_text(encoding="utf-8")
    found = re.search(rf"^({re.escape(name)}==\S+)", lock, re.MULTILINE | re.IGNORECASE)
    if not found:
        raise SystemExit(f"{name} is not in requirements.lock")
    return found[1]


if __name__ == "__main__":
    pins = "".join(f"      - {pinned(name)}\n" for name in library())
    (HERE.parent / "workflow" / "envs" / "stiffdice.yaml").write_text(HEAD + pins, encoding="utf-8")
