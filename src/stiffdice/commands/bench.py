"""`stiffdice bench`: how fast it is here."""

from __future__ import annotations

import argparse
from pathlib import Path

from stiffdice.bench import BENCHMARKS
from stiffdice.commands import output

EXAMPLES = """\
examples:
  stiffdice bench
  stiffdice bench listing engines
  stiffdice bench --quick --folder quick-bench

Times are medians of rounds in which everything takes turns; let nothing else run meanwhile. Stored are an HDF5 file
with every sample, a page and a table, named by the time; what changed since the last one there is told, row by row,
with what of it may be noise.
"""


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    bench = commands.add_parser(
        "bench",
        help="measure how fast it is, and compare with the last time",
        description="Measure kernels, skipping, cold start, jobs and engines; store, and compare with the last time.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument("names", metavar="NAME", nargs="*", help=f"{', '.join(BENCHMARKS)} (default: all)")
    bench.add_argument("--folder", default="results/bench", metavar="DIR", help="where (default: results/bench)")
    bench.add_argument("--against", metavar="FILE.h5", help="compare with this one (default: the last in the folder)")
    bench.add_argument("--quick", action="store_true", help="too short to tell times by; shows that all of it works")
    bench.set_defaults(call=_bench)


def _bench(options: argparse.Namespace) -> None:
    from stiffdice import checks

    for name in options.names:
        checks.choice("NAME", name, BENCHMARKS)

    folder = output.name_of("--folder", options.folder)

    # These take about a second to import; bad input is told before.
    from stiffdice.bench.run import bench
    from stiffdice.progress import Notes

    against = None if options.against is None else Path(options.against)
    with Notes("bench:") as notes:
        stored = bench(folder, names=options.names, quick=options.quick, against=against, tell=notes.show)
    print(stored.page)
    print(f"{stored.path}: stored, with the same as .md and .csv")
