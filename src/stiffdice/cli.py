"""The command `stiffdice`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn

from stiffdice import __version__
from stiffdice.commands import advise, archive, bench, diff, inspect, rebuild, run, status, verify
from stiffdice.errors import StiffdiceError

EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-09.yaml --model sliding -o stiff.h5
  stiffdice run my-cube.yaml --steps 1e5 --set ground.stiffness=1e6 --set cube.mass=0.02 -o out.h5
  stiffdice run my-cube.yaml --model auto -o out.h5
  stiffdice advise my-cube.yaml --error 1%
  stiffdice inspect stiff.h5
  stiffdice diff stiff.h5 out.h5
  stiffdice status paper
  stiffdice archive paper
  stiffdice verify results/paper
  stiffdice bench
"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="stiffdice",
        description="How many time steps does a stiff ground cost, and what do you get for them?",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"stiffdice {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in (run, advise, inspect, diff, status, archive, verify, rebuild, bench):
        command.add(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        status: int | None = options.call(options)
    except StiffdiceError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stiffdice: interrupted; nothing was stored", file=sys.stderr)
        return 130
    except BrokenPipeError:  # as in `stiffdice inspect FILE | head`
        sys.stderr.close()
        return 0
    except MemoryError:
        print("stiffdice: not enough memory; keep fewer samples with a larger --every", file=sys.stderr)
        return 2
    except OSError as error:  # no room for the compiled kernel, say
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    return status or 0
