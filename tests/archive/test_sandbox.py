"""What a command in a sandbox can see, read and change; tried from inside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from tests.archive import sandboxes

from stiffdice.archive import sandbox
from stiffdice.errors import RefusedError

# Says what is there, and what can be done; beside it lies a file that it must not see.
PROBE = """\
import json, os, re, socket, subprocess, sys
from pathlib import Path

def changed(path):
    try:
        return Path(path).write_text("changed")
    except OSError:
        return 0

def files_below(home):
    for top, folders, names in os.walk(home):
        folders[:] = [name for name in folders if os.path.join(top, name) not in python]
        yield from (os.path.join(top, name) for name in names)

beside, home, *python = map(Path, sys.argv[1:])
python = [str(path) for path in python]
status = dict(re.findall(r"^(\\w+):\\s*(.*)$", Path("/proc/self/status").read_text(), re.M))
mount = subprocess.run(["mount", "-o", "remount,bind,rw", "/usr"], capture_output=True)
print(json.dumps({
    "folder": os.getcwd(),
    "here": sorted(os.listdir()),
    "beside": [str(path) for path in (beside, beside.parent, Path("/rebuilt/../archived")) if path.exists()],
    "home": [*files_below(home)],
    "etc": [name for name in os.listdir("/etc") if name in ("passwd", "shadow", "hosts", "ssh")],
    "top": sorted(os.listdir("/")),
    "variables": sorted(os.environ),
    "network": [name for _, name in socket.if_nameindex()],
    "processes": [name for name in os.listdir("/proc") if name.isdigit()],
    "capabilities": status["CapBnd"],
    "new privileges": status["NoNewPrivs"],
    "remounted": mount.returncode == 0,
    "written": [top for top in ("/usr", "/", sys.prefix, "/tmp", ".", "/proc/sys") if changed(f"{top}/by-a-sandbox")],
}))
"""


@sandboxes.needed
def test_a_sandbox_has_one_folder_and_nothing_else(tmp_path, monkeypatch):
    """No network, home, files beside its own, variables, processes or rights of who runs it; programs cannot change."""
    monkeypatch.setenv("SECRET", "leaks")
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    (beside := tmp_path / "archived").mkdir()
    (beside / "same.txt").write_text("same")
    (folder := tmp_path / "rebuilt").mkdir()
    (folder / "probe.py").write_text(PROBE)
    python = [Path(path) for path in (sys.prefix, sys.base_prefix)]
    places = [beside / "same.txt", Path.home().resolve(), *python, *(path.resolve() for path in python)]
    command = [sys.executable, "probe.py", *map(str, places)]
    with (tmp_path / "said").open("wb") as out:
        running = sandbox.start(sandbox.sandboxed(folder), command, folder, out)
        running.wait(60)
    said = (tmp_path / "said").read_text()
    assert running.returncode == 0, said
    found = json.loads(said)
    assert (found["folder"], found["here"]) == ("/rebuilt", [".home", "probe.py"])
    assert found["beside"] == found["home"] == found["etc"] == []
    assert not {"mnt", "media", "opt", "srv", "sys", "var", "run"} & {*found["top"]}
    assert not {"SECRET", "LD_LIBRARY_PATH", "SSH_AUTH_SOCK"} & {*found["variables"]}
    assert found["network"] in ([], ["lo"]) and len(found["processes"]) <= 3
    assert int(found["capabilities"], 16) == 0 and found["new privileges"] == "1" and not found["remounted"]
    assert {*found["written"]} <= {"/", "/tmp", "."}  # its top is memory of its own
    assert (folder / "by-a-sandbox").read_text() == "changed"
    assert not Path("/by-a-sandbox").exists() and not Path("/tmp/by-a-sandbox").exists()


@sandboxes.needed
def test_what_would_show_what_lies_beside_is_not_in_a_sandbox(tmp_path, monkeypatch):
    """A Python that says to be in a folder above; without what it needs of that there is no sandbox."""
    (folder := tmp_path / "rebuilt").mkdir()
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path))
    assert str(tmp_path) not in sandbox.sandboxed(folder).prefix
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    with pytest.raises(RefusedError, match="bubblewrap does not work here"):
        sandbox.sandboxed(folder)


def test_why_there_is_no_sandbox_is_said(tmp_path, monkeypatch):
    (program := tmp_path / "bwrap").write_text("#!/bin/sh\necho bwrap: not allowed to >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(RefusedError, match=r"bubblewrap does not work here \(bwrap: not allowed to\)"):
        sandbox.sandboxed(tmp_path)


@pytest.mark.parametrize("way", [pytest.param(sandbox.sandboxed, marks=sandboxes.needed), sandbox.unconfined])
def test_all_is_gone_when_a_run_is_ended(tmp_path, way):
    """Not a moment later: what lies in its folder is removed then."""
    (folder := tmp_path / "folder").mkdir()
    with (tmp_path / "said").open("wb") as out:
        running = sandbox.start(way(folder), ["sh", "-c", "setsid sleep 600 & setsid sleep 600"], folder, out)
    started = psutil.Process(running.pid)
    while sum(process.name() == "sleep" for process in started.children(recursive=True)) < 2:
        assert running.poll() is None
        time.sleep(0.01)
    of_it = started.children(recursive=True)
    sandbox.end(running)
    assert running.returncode is not None
    if "leave processes behind" not in way(folder).could:
        assert [process for process in of_it if process.is_running()] == []


def test_what_runs_outside_of_a_sandbox_has_no_network_either(tmp_path):
    """As far as the system allows; it says what it can do."""
    way = sandbox.unconfined(tmp_path)
    assert str(way).startswith("without a sandbox: it can read, change and remove whatever you can")
    if "use the network" in way.could:
        pytest.skip("this system gives no network namespace")
    listed = subprocess.run([*way.prefix, "cat", "/proc/net/dev"], capture_output=True, text=True, check=True)
    assert [line.split(":")[0].strip() for line in listed.stdout.splitlines()[2:]] in ([], ["lo"])
