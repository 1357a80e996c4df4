"""The command `stiffdice`."""

from __future__ import annotations

import argparse
import atexit
import gc
import itertools
import os
import re
import sys
import textwrap
from collections.abc import Sequence
from typing import Any, NoReturn

from stiffdice import __version__
from stiffdice.cli import advise, check, ground, infer, new, run, status, throw, tosses
from stiffdice.cli.archives import archive, rebuild, verify
from stiffdice.cli.files import diff, inspect, plot
from stiffdice.cli.terminal import completion, output
from stiffdice.errors import StiffdiceError, printable
from stiffdice.scene import validation

EXAMPLES = """\
examples:
  stiffdice new my-cube
  stiffdice run config/scenes/figure-09.yaml --model sliding -o stiff.h5
  stiffdice run config/scenes/figure-09.yaml --dt '0.1 ms' --set ground.stiffness='500 kN/m' -o softer.h5
  stiffdice run config/scenes/figure-04.yaml --model auto -o throw.h5
  stiffdice advise config/scenes/figure-04.yaml --error 1%
  stiffdice ground --restitution 0.5 --mass '4 g' --side '16 mm' --drop '30 cm' --depth '0.1 mm'
  stiffdice throw --count 100000
  stiffdice tosses config/measurements/tosses.h5
  stiffdice infer config/measurements/labby-2009.yaml
  stiffdice inspect stiff.h5
  stiffdice plot stiff.h5
  stiffdice diff stiff.h5 softer.h5
  make archive STUDY=quick
  stiffdice status quick
  stiffdice verify results/quick
"""

# By name, in the order in which they are told.
COMMANDS = {
    module.__name__.rpartition(".")[2]: module
    for module in (
        *(run, advise, ground, check, throw, tosses, infer, new),
        *(inspect, plot, diff, status, archive, verify, rebuild, completion),
    )
}
_INTERRUPTED = "interrupted; nothing was stored"
# What is meant by a file in place of a command, by its ending.
_MEANT = {".yaml": "run", ".yml": "run", ".h5": "inspect", ".zip": "verify", ".xml": "check"}


class _Help(argparse.RawDescriptionHelpFormatter):
    """Fits paragraphs to the terminal; examples, which are to be copied, keep their lines."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        parts = [
            part if part.startswith(("examples:", " ")) else textwrap.fill(part, width, break_on_hyphens=False)
            for part in text.strip("\n").split("\n\n")
        ]
        return textwrap.indent("\n\n".join(parts), indent) + "\n"


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and what was meant if that is near."""

    def error(self, message: str) -> NoReturn:
        choice = re.search(r"argument (.*): invalid choice: '(.*)' \(choose from (.*)\)", message)
        if choice and choice[1] == "COMMAND":
            message = f"{choice[2]}: no such command{_meant(choice[2])}; allowed is {', '.join(COMMANDS)}"
        elif choice:
            message += validation.meant(choice[2], re.findall(r"[a-z]+", choice[3]))
        elif message.endswith("required: COMMAND"):
            message = f"a command is missing; allowed is {', '.join(COMMANDS)}"
        told = printable(f"{message} (see {self.prog} --help)")
        self.exit(2, f"{output.painted(f'{self.prog}:', output.RED, sys.stderr)} {told}\n")

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


def _meant(word: str) -> str:
    """Return which command was meant by a word that is none."""
    command = _MEANT.get(os.path.splitext(word)[1])  # noqa: PTH122 (pathlib takes a while to import)
    return f"; did you mean `stiffdice {command} {word}`?" if command else validation.meant(word, list(COMMANDS))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="stiffdice",
        description="How many time steps does a stiff ground cost, and what do you get for them?",
        epilog=EXAMPLES,
        formatter_class=_Help,
    )
    parser.add_argument("--version", action="version", version=f"stiffdice {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=module.HELP,
            description=f"{module.HELP[0].upper()}{module.HELP[1:]}.",
            epilog=module.EXAMPLES,
            formatter_class=_Help,
        )
        command.set_defaults(call=module.call, parser=parser)
        module.add(command)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    # What is imported stays: looking through it for garbage takes a third of a short command's time.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    try:
        status = called(_parser().parse_args(arguments))
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:  # as in `stiffdice --help | head -1`
        return _unread()
    except OSError as error:  # no room where standard output goes
        return _unread() or _failed(_about(error))
    except KeyboardInterrupt:
        return _failed(_INTERRUPTED, 130)
    return status


def called(options: argparse.Namespace) -> int:
    """Call what the parsed options name with them, and return its exit status; errors are one line."""
    quiet = output.QUIET.set(getattr(options, "quiet", False))
    try:
        return int(options.call(options) or 0)
    except StiffdiceError as error:
        return _failed(str(error))
    except KeyboardInterrupt:
        return _failed(_INTERRUPTED, 130)
    except BrokenPipeError:  # as in `stiffdice inspect FILE | head`
        return _unread()
    except MemoryError:
        return _failed("not enough memory; keep fewer samples with a larger --every")
    except OSError as error:  # no room for the compiled kernel, say
        return (_unread() if error.filename is None else 0) or _failed(_about(error))
    finally:
        output.QUIET.reset(quiet)


def _about(error: OSError) -> str:
    """Return what the system said; an error without a file's name is one of standard output."""
    return printable(f"{error.filename or 'standard output'}: {error.strerror or error}")


def _failed(told: str, status: int = 2) -> int:
    """Say in one line what went wrong, and return the exit status."""
    if sys.stderr is not None:
        print(f"{output.painted('stiffdice:', output.RED, sys.stderr)} {told}", file=sys.stderr)
    return status


def _unread() -> int:
    """Give up standard output, which nobody reads, so that the interpreter does not try once more at its end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    return 0
