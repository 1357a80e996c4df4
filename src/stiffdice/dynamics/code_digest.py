"""What code made a result: a digest of the sources that a module stands on."""

from __future__ import annotations

import ast
import hashlib
import re
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]

# An import from this package as the formatter writes it; to parse whole sources would take each command 0.15 s.
_STATEMENT = re.compile(rf"^ *((?:from|import) {PACKAGE.name}\b(?:.*\([^)]*\)|.*))$", re.MULTILINE)


@cache
def code_digest(*modules: str) -> str:
    """Return a SHA-256 over the sources of `modules` and of all that they import from this package.

    modules: dotted names, such as "stiffdice.simulation.run". A script in another language that lies beside a module,
    under its name, is part of it. A change in a figure leaves the digest of the simulation as it is, so that only what
    the change touched is computed again.
    """
    digest = hashlib.sha256()
    sources, waiting = set(), [_path(name) for name in modules]
    while waiting:
        path = waiting.pop()
        if path and path not in sources:
            sources.add(path)
            waiting += map(_path, _imports(path))
    scripts = {path.with_suffix(".m") for path in sources}
    for path in sorted(sources | {path for path in scripts if path.is_file()}):
        digest.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def _imports(path: Path) -> set[str]:
    """Return the dotted names that a source file imports from this package, function-level imports included."""
    names: set[str] = set()
    for node in ast.parse("\n".join(_STATEMENT.findall(path.read_text(encoding="utf-8")))).body:
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    # Importing a module runs the packages above it, too; the top one says the version.
    return {".".join(name.split(".")[:depth]) for name in names for depth in range(1, name.count(".") + 2)}


def _path(name: str) -> Path | None:
    """Return the source file of a dotted name, or None if it is an object inside a module."""
    base = PACKAGE.joinpath(*name.split(".")[1:])
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)
