"""A folder that is like a fresh clone, set up, in which the commands of a page are run one after another."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from tests.documentation.pages import ROOT, Block, without_comment

from stiffdice.cli import main as cli

# A line that needs no shell.
_PLAIN = re.compile(r"(?:\.venv/bin/)?stiffdice [^|&;<>$*~`(\n]*")


def parts(script: str) -> list[str]:
    """Return the plain lines that a script begins and ends with, one by one; what is between them is one part."""
    rows = script.replace("\\\n", " ").splitlines()
    told = [re.sub(r"^#.*", "", without_comment(row).strip()) for row in rows]
    shelled = [k for k, row in enumerate(told) if row and not _PLAIN.fullmatch(row)]
    first, last = (shelled[0], shelled[-1] + 1) if shelled else (len(rows), len(rows))
    return list(filter(None, [*told[:first], "\n".join(rows[first:last]), *told[last:]]))


class Ended(NamedTuple):
    """What a command has left."""

    status: int
    out: str
    err: str


class Checkout:
    """A copy of the project with the environment that the tests run in, without network."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.namespace: dict[str, Any] = {}
        for name in ("workflow", "config", "docs", "requirements", "benchmarks"):
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.png", "*.gif"))
        for path in ROOT.iterdir():
            if path.is_file() and not path.name.startswith("."):
                shutil.copy(path, folder)
        (folder / "src").symlink_to(ROOT / "src")  # another place would be compiled again
        (folder / "tests").symlink_to(ROOT / "tests")
        (folder / "profiles").symlink_to("workflow/profiles")
        (folder / ".venv").symlink_to(sys.prefix)
        (folder / "results").mkdir()
        shutil.copy(ROOT / "results/README.md", folder / "results")
        self._put_on_path(folder / ".bin")

    def _put_on_path(self, folder: Path) -> None:
        """Set-up is done: make passes over it, and nothing is installed into the environment of these tests."""
        folder.mkdir()
        (folder / "pip").write_text("#!/bin/sh\necho 'no pip in the tests of the documentation' >&2\nexit 1\n")
        (folder / "pip").chmod(0o755)
        (folder / "make").write_text(f'#!/bin/sh\nexec {shutil.which("make")} -o install -o install-engines "$@"\n')
        (folder / "make").chmod(0o755)

    @property
    def environment(self) -> dict[str, str]:
        """A proxy that is not there, so that what asks the network fails; commands of the project on the path."""
        path = os.pathsep.join([str(self.folder / ".bin"), f"{sys.prefix}/bin", os.environ["PATH"]])
        source = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        away = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
        own = {**os.environ, **away, "PATH": path, "PYTHONPATH": source, "MPLBACKEND": "agg"}
        # A make that is started by the one that runs the tests would say so.
        return {name: value for name, value in own.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}

    def shell(self, script: str) -> Ended:
        """Run a script, which ends with the first command that fails."""
        done = subprocess.run(
            ["bash", "-e", "-c", script],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        return Ended(done.returncode, done.stdout, done.stderr)

    def here(self, call: Callable[..., Any], *given: object) -> Ended:
        """Call what runs in this process, so that it need not import all that it needs again."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = call(*given)
            except SystemExit as end:
                status = end.code
        return Ended(int(status or 0), out.getvalue(), err.getvalue())

    def run(self, block: Block, script: str) -> Ended:
        """Run a step of a block, without the lines that are not run; Python after what the page has run before."""
        if block.language == "python":
            return self.here(exec, script, self.namespace)
        script = "".join(
            line for line in script.splitlines(keepends=True) if not line.startswith(block.left_out or "\0")
        )
        ends = [
            self.here(cli.main, shlex.split(part)[1:]) if _PLAIN.fullmatch(part) else self.shell(part)
            for part in parts(script)
        ]
        assert all(end.status == 0 for end in ends[:-1]), f"{block}: {ends}"
        return Ended(ends[-1].status, "".join(end.out for end in ends), "".join(end.err for end in ends))
