"""Run Snakemake, then say what failed, or where the time went: run.py --cores N [what Snakemake takes]..."""

from __future__ import annotations

import argparse
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STAGES = (
    *("trajectory", "experiment", "timings", "shard", "survey", "collect", "frontier"),
    *("table", "figure", "animation", "pdf"),
)
ROOT = Path(__file__).resolve().parent.parent
SNAKEFILE = "workflow/Snakefile"

# The library of this checkout, as the jobs have it.
sys.path[:0] = [str(ROOT / "src"), str(ROOT / "workflow" / "scripts")]

import ending  # noqa: E402
import following  # noqa: E402
import lock  # noqa: E402
import room  # noqa: E402
from job import ADDRESS  # noqa: E402

from stiffdice.errors import printable  # noqa: E402
from stiffdice.io.process import end_with_parent  # noqa: E402
from stiffdice.study import job_log  # noqa: E402

# Of Snakemake, at most: what is made again because it was damaged may show that another result was.
ROUNDS = 4


def seconds_of_simulation(log: Path) -> float:
    """Return the seconds that a job says it spent in the simulator; 0 if it says nothing."""
    found = re.search(r"^simulation: ([0-9.]+) s$", job_log.text_of(log), re.MULTILINE)
    return float(found[1]) if found else 0.0


def asked_for(words: list[str]) -> list[str]:
    """Return the studies that Snakemake is asked for: by name, as `study` with --config, by files, or by default."""
    given = [found[1] for word in words if (found := re.fullmatch(r"(?:--config=)?study=(.*)", word))]
    default = (given or ["paper"])[-1]
    there, asked = {path.stem for path in ROOT.glob("config/*.yaml")}, []
    for word in words:
        if word == "study":
            asked.append(default)
        elif word in there:
            asked.append(word)
        elif word.startswith("results/"):
            asked.append(word.split("/")[1])
    return sorted(there.intersection(asked or [default]))


def written_since(begun: float, studies: list[str], pattern: str) -> list[Path]:
    """Return the files of some studies that match a pattern and were written after `begun`."""
    found = (path for name in studies for path in sorted((ROOT / "results" / name).glob(pattern)))
    return [path for path in found if path.lstat().st_mtime >= begun]


def jobs_since(begun: float, studies: list[str]) -> dict[str, list[tuple[float, float]]]:
    """Return for each stage the job and simulation seconds of the jobs of some studies that ended after `begun`."""
    jobs: dict[str, list[tuple[float, float]]] = {}
    for benchmark in written_since(begun, studies, "benchmarks/**/*.tsv"):
        relative = benchmark.relative_to(ROOT / "results")
        log = ROOT / "results" / relative.parts[0] / "logs" / Path(*relative.parts[2:]).with_suffix(".log")
        stage = relative.with_suffix("").parts[2]
        seconds = job_log.took(benchmark)
        if seconds is not None:
            jobs.setdefault(stage, []).append((seconds, seconds_of_simulation(log)))
    return jobs


def table(jobs: dict[str, list[tuple[float, float]]], elapsed: float, cores: int) -> str:
    """Return where the time went, as lines of text."""
    lines = [f"{'':12}{'jobs':>6}{'in jobs':>11}{'simulating':>12}"]
    for stage in sorted(jobs, key=lambda name: STAGES.index(name) if name in STAGES else len(STAGES)):
        total, simulated = (sum(part) for part in zip(*jobs[stage], strict=True))
        lines.append(f"{stage:12}{len(jobs[stage]):6}{total:9.1f} s{simulated:10.1f} s")
    total, simulated = (sum(part) for part in zip(*(job for stage in jobs.values() for job in stage), strict=True))
    lines.append(f"{'all':12}{sum(map(len, jobs.values())):6}{total:9.1f} s{simulated:10.1f} s")
    lines.append(
        f"{elapsed:.0f} s on {cores} core{'s' if cores > 1 else ''}: {simulated / (elapsed * cores):.0%} of them "
        f"simulation, {(total - simulated) / (elapsed * cores):.0%} start-up, files and drawing, the rest Snakemake "
        "and idle cores"
    )
    return "\n".join(lines)


def set_aside_since(begun: float, studies: list[str]) -> dict[str, str]:
    """Return the results that jobs since `begun` refused and set aside, with the reason of each, as their logs say."""
    logs = written_since(begun, studies, "logs/**/*.log")
    found = (re.findall(r"^set aside: (\S+): (.*)$", job_log.text_of(log), re.MULTILINE) for log in logs)
    return {path: reason for pairs in found for path, reason in pairs}


def tied() -> None:
    """Have Snakemake end with this process."""
    end_with_parent("run.py")


@contextmanager
def warm(environment: dict[str, str], studies: list[str], named: bool) -> Iterator[dict[str, str]]:
    """Yield the environment in which jobs find a process that has imported what they need, and end it afterwards.

    studies: whose kernels it loads. named: a profile of the user's own, whose jobs may run elsewhere. Without the
    process jobs do all by themselves.
    """
    if named or not hasattr(os, "pidfd_open"):
        yield environment
        return
    with tempfile.TemporaryDirectory(prefix="stiffdice-") as folder, socket.socket(socket.AF_UNIX) as listener:
        address = f"{folder}/warm"
        try:
            listener.bind(address)
        except OSError:  # too long a path
            yield environment
            return
        listener.listen()  # from here on who comes waits
        command = [sys.executable, "workflow/warm.py", str(listener.fileno()), *studies]
        handles = [listener.fileno()]
        process = subprocess.Popen(command, cwd=ROOT, env=environment, pass_fds=handles, start_new_session=True)
        try:
            yield environment | {ADDRESS: address}
        finally:
            process.kill()
            process.wait()


def rounds(command: list[str], environment: dict[str, str], studies: list[str], verbose: bool) -> tuple[int, str]:
    """Run Snakemake, and again while jobs set damaged results aside, so that these are made.

    verbose: show all that it says. Return its exit status, and what it said at last that was not shown.
    """
    made_again: dict[str, str] = {}
    for _ in range(ROUNDS):
        begun = time.time()
        if verbose:
            done = subprocess.run(command, cwd=ROOT, env=environment, check=False, preexec_fn=tied)
            status, withheld = done.returncode, ""
        else:
            status, withheld = following.follow(command, ROOT, environment, tied)
        damaged = set_aside_since(begun, studies)
        if status == 0 or not damaged:
            break
        made_again |= damaged
        print(f"\nstiffdice: {len(damaged)} damaged, set aside; Snakemake runs again to make them", flush=True)
    if status == 0:
        for path, reason in made_again.items():
            print(printable(f"made again: {path}: {reason}"))
    return status, withheld


def main() -> int:
    """Run Snakemake with its default profile and return its exit status."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cores", type=int, required=True)
    parser.add_argument("--end-with-parent", action="store_true", help="be killed with make, which calls this")
    parser.add_argument("--verbose", action="store_true", help="show all that Snakemake says")
    options, rest = parser.parse_known_args()
    if options.end_with_parent:
        end_with_parent("make")
    begun, studies = time.time(), asked_for(rest)
    # By its name, as links to it (profiles/) are not in an archive.
    named = any(part.startswith("--workflow-profile") for part in rest)
    profile = [] if named else ["--workflow-profile", "workflow/profiles/default"]
    command = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--cores", str(options.cores)]
    command += [*profile, *rest]
    try:
        changes, told = room.prepare(ROOT, options.cores)
        for name in studies:
            lock.hold(ROOT, name)
        room.forget_rubbish(ROOT)
    except (room.RoomError, lock.RunningError) as error:
        print(f"stiffdice: {printable(error)}", file=sys.stderr)
        return 2
    for line in told:
        print(f"stiffdice: {printable(line)}", file=sys.stderr)
    try:
        with warm(os.environ | changes, studies, named) as environment:
            status, withheld = rounds(command, environment, studies, options.verbose)
    except KeyboardInterrupt:
        print("\nstiffdice: interrupted; the same command goes on from here")
        return 130
    if status and (reason := room.lack_of(ROOT)):
        print(f"stiffdice: {printable(reason)}", file=sys.stderr)
    jobs = jobs_since(begun, studies)
    if status:
        failed = ending.told(ROOT, begun, studies)
        if ending.FAILED not in failed:  # all there is to read
            print(withheld, end="", file=sys.stderr, flush=True)
        print(failed, flush=True)
        return status
    if jobs:
        print("\nwhere the time went")
        print(table(jobs, time.time() - begun, options.cores))
    for line in filter(None, (ending.open_first(ROOT, name) for name in studies)):
        print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
