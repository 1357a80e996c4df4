"""What the tests of commands share."""

from __future__ import annotations

import re

import pytest

from stiffdice.cli import main as cli


@pytest.fixture
def stiffdice(tmp_path, monkeypatch, capsys):
    """Run the command in an empty folder; return its status, what it printed, and the files it left."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code
        out, err = capsys.readouterr()
        err = re.sub(r"^compiling .*\n", "", err, flags=re.MULTILINE)  # the first time
        return status, out, err, sorted(path.name for path in tmp_path.iterdir())

    return call
