"""Python processes that start with their libraries imported: forks of one that has imported them.

Most of `python -m snakemake -n` and of `python -m stiffdice.cli status` is imports. What is imported before is not of
this project: each process finds the code that its own PYTHONPATH names.
"""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

SERVER = """
import json, os, runpy, sys, traceback
import h5netcdf, jsonschema, numba, pandas, psutil, scipy.integrate, xarray, yaml
import snakemake.cli

def become(asked):
    for handle, path in enumerate((os.devnull, asked["out"], asked["err"])):
        os.dup2(os.open(path, os.O_RDWR), handle)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    numba.config.reload_config()
    sys.path[:1] = [asked["folder"], *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    sys.argv = ["", *asked["words"]]
    if "code" in asked:
        exec(asked["code"], {"__name__": "__main__"})
    else:
        runpy.run_module(asked["module"], run_name="__main__", alter_sys=True)

def status_of(asked):
    try:
        become(asked)
        return 0
    except SystemExit as ended:
        if isinstance(ended.code, str):
            print(ended.code, file=sys.stderr)
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1

for line in sys.stdin:
    child = os.fork()
    if child == 0:
        status = status_of(json.loads(line))
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@functools.cache
def _server() -> subprocess.Popen[str]:
    """Return the process of this test worker that has imported the libraries; it ends with the worker."""
    words, plain = [sys.executable, "-c", SERVER], os.environ | {"PYTHONPATH": ""}
    server = subprocess.Popen(words, env=plain, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(server.communicate)
    return server


def _run(
    asked: dict[str, str], words: tuple[str, ...], folder: Path, environment: dict[str, str] | None
) -> subprocess.CompletedProcess[str]:
    server = _server()
    with tempfile.NamedTemporaryFile("r") as out, tempfile.NamedTemporaryFile("r") as err:
        files = {"out": out.name, "err": err.name, "folder": str(folder)}
        given = {"words": words, "environment": {**(environment or os.environ)}}
        print(json.dumps(asked | files | given), file=server.stdin, flush=True)
        status = int(server.stdout.readline())
        return subprocess.CompletedProcess([*asked.values(), *words], status, out.read(), err.read())


def run_module(
    module: str, *words: str, cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Do what `python -m module words` does, and return what `subprocess.run` would."""
    return _run({"module": module}, words, cwd, environment)


def run_code(
    code: str, *words: str, cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Do what `python -c code words` does, and return what `subprocess.run` would."""
    return _run({"code": code}, words, cwd, environment)
