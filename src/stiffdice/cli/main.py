"""The command `stiffdice`."""

from __future__ import annotations

import argparse
import atexit
import gc
import itertools
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from stiffdice import __version__
from stiffdice.cli import advise, check, diff, ground, infer, inspect, run, status, throw, tosses
from stiffdice.cli.archives import archive, rebuild, verify
from stiffdice.errors import StiffdiceError, printable
from stiffdice.scene import validation

EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-09.yaml --model sliding -o stiff.h5
  stiffdice run config/scenes/figure-09.yaml --dt '0.1 ms' --set ground.stiffness='500 kN/m' -o softer.h5
  stiffdice run config/scenes/figure-04.yaml --model auto -o throw.h5
  stiffdice advise config/scenes/figure-04.yaml --error 1%
  stiffdice ground --restitution 0.5 --mass '4 g' --side '16 mm' --drop '30 cm' --depth '0.1 mm'
  stiffdice throw --count 100000
  stiffdice tosses --data config/measurements/tosses.h5
  stiffdice infer config/measurements/labby-2009.yaml
  stiffdice inspect stiff.h5
  stiffdice diff stiff.h5 softer.h5
  make archive STUDY=quick
  stiffdice status quick
  stiffdice verify results/quick
"""

# By name, in the order in which they are told.
COMMANDS = {
    module.__name__.rpartition(".")[2]: module
    for module in (run, advise, ground, check, throw, tosses, infer, inspect, diff, status, archive, verify, rebuild)
}


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and what was meant if that is near."""

    def error(self, message: str) -> NoReturn:
        choice = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
        meant = validation.meant(choice[1], re.findall(r"[a-z]+", choice[2])) if choice else ""
        self.exit(2, printable(f"{self.prog}: {message}{meant} (see {self.prog} --help)") + "\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse an option that is not known before another is missed, and by the command's name."""
        words = sys.argv[1:] if args is None else args
        own = "-" if self._subparsers else ""  # what follows a command is the command's
        known = list(self._option_string_actions)
        for word in itertools.takewhile(lambda word: word.startswith(own) and word != "--", words):
            option = word.partition("=")[0]
            if option.startswith("--") and not any(name.startswith(option) for name in known):
                self.error(f"unrecognized arguments: {word}{validation.meant(option, known)}")
        return super().parse_known_args(args, namespace)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="stiffdice",
        description="How many time steps does a stiff ground cost, and what do you get for them?",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"stiffdice {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=module.HELP,
            description=f"{module.HELP[0].upper()}{module.HELP[1:]}.",
            epilog=module.EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.set_defaults(call=module.call)
        module.add(command)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    # What is imported stays: looking through it for garbage takes a third of a short command's time.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    return called(_parser().parse_args(arguments))


def called(options: argparse.Namespace) -> int:
    """Call what the parsed options name with them, and return its exit status; errors are one line."""
    status = 2
    try:
        return int(options.call(options) or 0)
    except StiffdiceError as error:
        told = str(error)
    except KeyboardInterrupt:
        told, status = "interrupted; nothing was stored", 130
    except BrokenPipeError:  # as in `stiffdice inspect FILE | head`
        sys.stderr.close()
        return 0
    except MemoryError:
        told = "not enough memory; keep fewer samples with a larger --every"
    except OSError as error:  # no room for the compiled kernel, say
        told = printable(error)
    print(f"stiffdice: {told}", file=sys.stderr)
    return status
