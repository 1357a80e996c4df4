"""Run Snakemake, then say what failed, or where the time went: run.py --cores N [what Snakemake takes]..."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path

import ending

STAGES = ("trajectory", "experiment", "timings", "shard", "collect", "frontier", "table", "figure", "animation")
ROOT = Path(__file__).parent.parent


def seconds_of_job(benchmark: Path) -> float:
    """Return the wall-clock seconds in one of Snakemake's benchmark files."""
    return float(benchmark.read_text(encoding="utf-8").splitlines()[1].split("\t")[0])


def seconds_of_simulation(log: Path) -> float:
    """Return the seconds that a job says it spent in the simulator; 0 if it says nothing."""
    found = re.search(r"^simulation: ([0-9.]+) s$", log.read_text(encoding="utf-8"), re.MULTILINE)
    return float(found[1]) if found else 0.0


def jobs_since(begun: float) -> dict[str, list[tuple[float, float]]]:
    """Return for each stage the job and simulation seconds of the jobs that ended after `begun`."""
    jobs: dict[str, list[tuple[float, float]]] = {}
    for benchmark in sorted(ROOT.glob("results/*/benchmarks/**/*.tsv")):
        if benchmark.stat().st_mtime < begun:
            continue
        relative = benchmark.relative_to(ROOT / "results")
        log = ROOT / "results" / relative.parts[0] / "logs" / Path(*relative.parts[2:]).with_suffix(".log")
        stage = relative.with_suffix("").parts[2]
        jobs.setdefault(stage, []).append((seconds_of_job(benchmark), seconds_of_simulation(log)))
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
        f"simulation, {(total - simulated) / (elapsed * cores):.0%} start-up, files and drawing, the rest Snakemake"
    )
    return "\n".join(lines)


def main() -> int:
    """Run Snakemake with its default profile and return its exit status."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cores", type=int, required=True)
    options, rest = parser.parse_known_args()
    begun = time.time()
    command = [sys.executable, "-m", "snakemake", "--cores", str(options.cores), *rest]
    try:
        status = subprocess.run(command, cwd=ROOT, check=False).returncode
    except KeyboardInterrupt:
        print("\nstiffdice: interrupted; the same command goes on from here")
        return 130
    jobs = jobs_since(begun)
    if status:
        print(ending.told(ROOT, begun), flush=True)
    elif jobs:
        print("\nwhere the time went")
        print(table(jobs, time.time() - begun, options.cores))
    return status


if __name__ == "__main__":
    sys.exit(main())
