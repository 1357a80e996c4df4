"""`python -m benchmarks`: how fast it is here."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import BENCHMARKS
from benchmarks.run import bench
from stiffdice.cli.main import called
from stiffdice.cli.terminal.progress import notes
from stiffdice.scene import validation

EXAMPLES = """\
examples:
  python -m benchmarks
  python -m benchmarks listing engines
  python -m benchmarks --quick --folder quick-bench

Times are medians of rounds in which everything takes turns; let nothing else run meanwhile. Stored are an HDF5 file
with every sample, a page and a table, named by the time; what changed since the last one there is told, row by row,
with what of it may be noise.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, store and print the page, and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure kernels, skipping, cold start, jobs and engines; store, and compare with the last time.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"{', '.join(BENCHMARKS)} (default: all)")
    parser.add_argument("--folder", default="results/bench", metavar="DIR", help="where (default: results/bench)")
    parser.add_argument("--against", metavar="FILE.h5", help="compare with this one (default: the last in the folder)")
    parser.add_argument("--quick", action="store_true", help="too short to tell times by; shows that all of it works")
    parser.set_defaults(call=_bench)
    return called(parser.parse_args(arguments))


def _bench(options: argparse.Namespace) -> None:
    for name in options.names:
        validation.choice("NAME", name, BENCHMARKS)
    against = None if options.against is None else Path(options.against)
    with notes("bench:") as tell:
        stored = bench(Path(options.folder), names=options.names, quick=options.quick, against=against, tell=tell)
    print(stored.page)
    print(f"{stored.path}: stored, with the same as .md and .csv")


if __name__ == "__main__":
    sys.exit(main())
