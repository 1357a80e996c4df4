"""A Slurm of two nodes on this machine, with accounting, in one folder: for tests, and to try a profile by hand.

It needs namespaces of its own (tests/slurm/run makes them): of mounts, as Slurm's tools look for their configuration in
/etc/slurm; of the network, so that its ports are nobody else's; of processes, so that none outlives the test, however
that ends; of host names, so that the nodes have different ones.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

NODES = ("n1", "n2")
ETC = Path("/etc/slurm")
# Debian's packages, by a program of each.
PACKAGES = {
    "slurmctld": "slurmctld",
    "slurmd": "slurmd",
    "slurmdbd": "slurmdbd",
    "sbatch": "slurm-client",
    "munged": "munge",
    "mariadbd": "mariadb-server",
    "ip": "iproute2",
    "unshare": "util-linux",
}
UP = 60.0  # seconds that a daemon may take to answer

CONF = """
ClusterName=stiffdice
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=6817
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={top}/munge.socket
StateSaveLocation={top}/state
SlurmdSpoolDir={top}/spool-%n
SlurmctldPidFile={top}/slurmctld.pid
SlurmdPidFile={top}/slurmd-%n.pid
SlurmctldLogFile={top}/slurmctld.log
SlurmdLogFile={top}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2
EnforcePartLimits=ALL
ReturnToService=2
MinJobAge=300
# Minutes become seconds, so that tests do not wait for them.
SlurmdTimeout=10
SlurmctldTimeout=10
KillWait=5
MessageTimeout=10
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill,UsePss
{accounting}
SlurmdParameters=config_overrides
NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port=6821 CPUs=2 RealMemory=6000
NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port=6822 CPUs=2 RealMemory=6000
PartitionName=normal Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
"""
WITH_ACCOUNTING = """
AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=localhost
AccountingStoragePort=6819
AccountingStoragePass={top}/munge.socket
AccountingStorageEnforce=associations
AccountingStoreFlags=job_comment
"""
WITHOUT_ACCOUNTING = "AccountingStorageType=accounting_storage/none\n"
DATABASE_CONF = """
AuthType=auth/munge
AuthInfo=socket={top}/munge.socket
DbdHost=localhost
DbdPort=6819
SlurmUser=root
LogFile={top}/slurmdbd.log
PidFile={top}/slurmdbd.pid
StorageType=accounting_storage/mysql
StorageHost=127.0.0.1
StoragePort=3306
StorageUser=root
StorageLoc=slurm
"""


def missing() -> list[str]:
    """Return the Debian packages that are not here."""
    return sorted({package for program, package in PACKAGES.items() if shutil.which(program) is None})


class Cluster:
    """The daemons; `top` is the folder that they live in."""

    def __init__(self, top: Path) -> None:
        self.top = top
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        top.mkdir(parents=True, exist_ok=True)
        for name in ("state", "database", "etc", *(f"spool-{node}" for node in NODES)):
            (top / name).mkdir(mode=0o755)
        self._configure(accounting=True)
        database = top / "etc/slurmdbd.conf"
        database.write_text(DATABASE_CONF.format(top=top))
        database.chmod(0o600)

    def _configure(self, accounting: bool) -> None:
        how = (WITH_ACCOUNTING if accounting else WITHOUT_ACCOUNTING).format(top=self.top)
        (self.top / "etc/slurm.conf").write_text(CONF.format(top=self.top, accounting=how))

    def start(self) -> None:
        """Start all, each once the one before answers."""
        run("mount", "--bind", str(self.top / "etc"), str(ETC))
        self._start_munge()
        self._start_accounting()
        self.start_controller(empty=True)
        for node in NODES:
            self.start_node(node)
        self._until_idle()

    def _until_idle(self) -> None:
        until("both nodes are idle", lambda: run("sinfo", "--noheader", "--format=%T %D").split() == ["idle", "2"])

    def _start_munge(self) -> None:
        key = self.top / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        self._start(
            "munged",
            *("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.top}/munge.socket"),
            *(f"--pid-file={self.top}/munge.pid", f"--seed-file={self.top}/munge.seed"),
            *(f"--log-file={self.top}/munge.log", "--num-threads=2"),
        )
        until("munge answers", (self.top / "munge.socket").exists)

    def _start_accounting(self) -> None:
        data, socket = self.top / "database", self.top / "database.socket"
        here = ("--no-defaults", "--user=root", f"--datadir={data}")
        run("mariadb-install-db", *here, "--auth-root-authentication-method=normal", "--skip-test-db")
        self._start(
            "mariadbd",
            *("mariadbd", *here, f"--socket={socket}", "--bind-address=127.0.0.1", "--port=3306"),
            *(f"--pid-file={self.top}/database.pid", "--innodb-lock-wait-timeout=900", "--skip-name-resolve"),
        )
        until("the database answers", lambda: succeeds("mariadb-admin", f"--socket={socket}", "ping"))
        run("mariadb", f"--socket={socket}", "-e", ALLOW)
        self._start("slurmdbd", "slurmdbd", "-D")
        until("accounting answers", lambda: succeeds("sacctmgr", "-n", "list", "cluster"))
        run("sacctmgr", "-i", "add", "cluster", "stiffdice")
        run("sacctmgr", "-i", "add", "account", "physics")
        run("sacctmgr", "-i", "add", "user", "root", "account=physics")

    def start_controller(self, *, empty: bool = False) -> None:
        """Start slurmctld; empty: with no memory of earlier jobs."""
        self._start("slurmctld", "slurmctld", "-D", *(["-c"] if empty else []))
        until("the controller answers", lambda: succeeds("scontrol", "ping"))

    def stop_controller(self) -> None:
        """Stop slurmctld, as for an update."""
        self._end("slurmctld", signal.SIGTERM)

    def restart_controller(self, *, accounting: bool) -> None:
        """Have the controller keep accounts from here on, or not."""
        self.stop_controller()
        self._configure(accounting)
        self.start_controller()
        self._until_idle()

    def start_node(self, node: str) -> None:
        """Start a slurmd, on a host of its own name."""
        self._start(node, "unshare", "--uts", "bash", "-c", f"hostname {node}; exec slurmd -D -N {node}")

    def stop_node(self, node: str) -> None:
        """Stop a slurmd, as for an update: jobs go on."""
        self._end(node, signal.SIGTERM)

    def lose_node(self, node: str) -> None:
        """End a slurmd and all that it started, as when the power fails: nobody says goodbye."""
        alike = beside(self._running[node].pid)
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for process in alike:
                send(number, process)
        self._running.pop(node).wait()

    def stop(self) -> None:
        """Stop all."""
        for name in reversed(list(self._running)):
            self._end(name, signal.SIGTERM)
        run("umount", str(ETC))

    def _start(self, name: str, *command: str) -> None:
        with (self.top / f"{name}.out").open("ab") as said:
            self._running[name] = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)

    def _end(self, name: str, number: signal.Signals) -> None:
        daemon = self._running.pop(name)
        daemon.send_signal(number)
        try:
            daemon.wait(15)
        except subprocess.TimeoutExpired:
            daemon.kill()
            daemon.wait()


ALLOW = """
CREATE DATABASE slurm;
CREATE USER IF NOT EXISTS 'root'@'127.0.0.1'; GRANT ALL ON *.* TO 'root'@'127.0.0.1' WITH GRANT OPTION;
"""


def run(*command: str) -> str:
    """Run a command and return what it says; raises RuntimeError with all of that if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def succeeds(*command: str) -> bool:
    """Return whether a command ends well within a few seconds."""
    try:
        return subprocess.run(command, capture_output=True, timeout=5, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def until(what: str, true: Callable[[], object], seconds: float = UP) -> None:
    """Wait until something is true; raises TimeoutError if it is not within `seconds`."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise TimeoutError(f"not within {seconds:g} s: {what}")
        time.sleep(0.1)


def send(number: signal.Signals, process: int) -> None:
    """Send a signal to a process that may be gone."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, number)


def beside(process: int) -> list[int]:
    """Return the processes on the same host, as it calls itself, this one included."""
    found, host = [], Path(f"/proc/{process}/ns/uts").readlink()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if (folder / "ns" / "uts").readlink() == host:
                found.append(int(folder.name))
    return found


if __name__ == "__main__":
    print(*missing())
