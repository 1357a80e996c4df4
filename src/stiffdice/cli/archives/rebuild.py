"""`stiffdice rebuild`: an archive made again from its own content."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from stiffdice import __version__
from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output

if TYPE_CHECKING:
    from stiffdice.archive.rebuild import Opened
    from stiffdice.archive.sandbox import Way

HELP = "make an archive again from its own content, and compare"
EXAMPLES = f"""\
examples:
  make archive STUDY=quick
  stiffdice rebuild results/archives/quick-{__version__}.crate.zip
  stiffdice rebuild results/archives/quick-{__version__}.crate.zip --cores 4 -o again

The archive is checked first. Its own code, where that is not the installed code, file by file, is run after asking, in
a sandbox (bubblewrap), or not at all. Exit status: 0 if all data and figures are the same, 1 if some differ, 2 if the
archive cannot be trusted, is not to be run, or its run failed. docs/how-to/verify.md says more.
"""

_SIGNALS = (signal.SIGTERM, signal.SIGHUP)  # the end of a login sends both


def add(rebuild: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    rebuild.add_argument("archive", metavar="ARCHIVE", help="an archive (.zip)")
    grammar.add(rebuild, "--output", ": a new folder, in which it runs and stays (default: none stays)")
    grammar.add(rebuild, "--cores", ", that many jobs at once (default: 1)", default="1")
    rebuild.add_argument("--yes", action="store_true", help="run the archive's own code without asking")
    told = "without a sandbox: its code can read and change all that you can"
    rebuild.add_argument("--no-sandbox", action="store_true", help=told)
    grammar.add_form(rebuild)


def call(options: argparse.Namespace) -> int:
    """Rebuild and print what differs; 1 if anything does."""
    cores = common.whole("--cores", options.cores)

    # This takes about a second to import; bad input is told before.
    from stiffdice.archive.rebuild import opened, rebuild, way_of
    from stiffdice.cli.terminal.progress import notes

    with _told_to_stop(), ExitStack() as stack:
        with notes("rebuild: unpacking and checking the archive"):
            unpacked = stack.enter_context(opened(options.archive, options.output))
            way = way_of(unpacked, not options.no_sandbox)
        if not unpacked.code.is_installed and not options.yes:
            _ask(unpacked, way)
        with notes(f"rebuild: making {unpacked.study} again") as tell:
            rebuilt = rebuild(unpacked, way, cores, tell.part)
    output.say(rebuilt.as_json() if options.json else rebuilt.lines())
    return 0 if rebuilt.ok else 1


def _ask(unpacked: Opened, way: Way) -> None:
    """Ask whether to run an archive's own code; raises RefusedError unless the answer, on a terminal, is yes."""
    from stiffdice.errors import RefusedError, printable

    told = f"{unpacked.archive}: {unpacked.code}"
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise RefusedError(f"{told}; nobody is here to be asked whether to run that: --yes runs it {way}")
    print(f"{printable(told)}\nIt would run the archive's own code, {way}.", file=sys.stderr)
    print("Run it? [y/N] ", end="", file=sys.stderr, flush=True)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise RefusedError(f"{unpacked.archive}: not run")


@contextmanager
def _told_to_stop() -> Iterator[None]:
    """Clean up when told to stop: end what runs, remove what is temporary; the exit status is 128 and the signal's."""

    def stop(number: int, frame: FrameType | None) -> NoReturn:
        for other in _SIGNALS:
            signal.signal(other, signal.SIG_IGN)
        sys.exit(128 + number)

    heard = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, stop) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
