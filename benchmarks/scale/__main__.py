"""Measure how a sweep grows with its number of runs, through the real workflow: 1e4, 1e5, 1e6 runs unless told."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.scale.run import RECORD, Asked, measure
from stiffdice.errors import StiffdiceError

EXAMPLES = """\
examples:
  python -m benchmarks.scale                                 what docs/explanation/scale.md shows; half an hour
  python -m benchmarks.scale --runs 1e4 --workers 0 --extend 0                one size, and nothing else
  python -m benchmarks.scale --study config/my-sweep.yaml --runs 1e5 1e6      how a sweep of one's own grows

Let nothing else run meanwhile. What is measured stays in the folder, and an interrupted measurement goes on where it
was; --again begins anew, and so does a changed study or a changed simulation.
"""


def count(text: str) -> int:
    """Return a whole number as a person writes it: 1e6, 100000."""
    return int(float(text))


def main() -> int:
    """Measure, print the page, and return 0; 2 for what cannot be measured, 130 if interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.scale",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--study", default="config/million.yaml", metavar="FILE.yaml", help="default: config/million.yaml"
    )
    parser.add_argument("--runs", type=count, nargs="+", default=[10**4, 10**5, 10**6], metavar="N", help="sizes")
    parser.add_argument("--cores", type=int, default=2, metavar="N", help="of each size (default: 2)")
    parser.add_argument("--workers", type=count, default=10**5, metavar="N", help="runs for two against one; 0: not")
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="of two against one (default: 3)")
    parser.add_argument("--extend", type=count, default=10**5, metavar="N", help="runs of an extended grid; 0: not")
    parser.add_argument("--folder", default="results/scale", metavar="DIR", help="where (default: results/scale)")
    parser.add_argument("--again", action="store_true", help="forget what was measured before")
    options = parser.parse_args()
    folder = Path(options.folder)
    asked = Asked(Path(options.study), options.runs, options.cores, options.workers, options.rounds, options.extend)
    if options.again:
        (folder / RECORD).unlink(missing_ok=True)
    try:
        page = measure(asked, folder, lambda text: print(f"million: {text}", file=sys.stderr, flush=True))
    except StiffdiceError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstiffdice: interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    print(page)
    print(f"{folder}/scale.md, scale.csv: stored")
    return 0


if __name__ == "__main__":
    sys.exit(main())
