"""`stiffdice rebuild`: an archive made again from its own content."""

from __future__ import annotations

import argparse

from stiffdice import __version__

EXAMPLES = f"""\
examples:
  make archive STUDY=quick
  stiffdice rebuild results/archives/quick-{__version__}.crate.zip
  stiffdice rebuild results/archives/quick-{__version__}.crate.zip --cores 4 -o again

It EXECUTES code of the archive, as `make` would: do so only with one from people that you trust. `stiffdice verify`
executes nothing of it. The archive is checked first, and not run if anything in it fails. The run has no network, and
its own HOME. Exit status: 0 if all data and figures are the same, 1 if some differ, 2 if the archive cannot be trusted
or its run failed.
"""


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    rebuild = commands.add_parser(
        "rebuild",
        help="make an archive again from its own content (executes it), and compare",
        description="Run the workflow in an archive on the code in it, with the libraries installed here and without a "
        "network, and compare what it makes with what the archive holds.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    rebuild.add_argument("archive", metavar="ARCHIVE")
    rebuild.add_argument("-o", "--output", metavar="FOLDER", help="run it in this new folder, and leave it there")
    rebuild.add_argument("--cores", default="1", metavar="N", help="jobs at once (default: 1)")
    rebuild.set_defaults(call=_rebuild)


def _rebuild(options: argparse.Namespace) -> int:
    from stiffdice.commands import numbers, output

    if options.output is not None:
        output.name_of("-o", options.output)
    cores = numbers.whole("--cores", options.cores)

    # This takes about a second to import; bad input is told before.
    from stiffdice.archive.rebuild import rebuild
    from stiffdice.progress import Notes

    with Notes("rebuild:") as notes:
        rebuilt = rebuild(options.archive, options.output, cores, notes.show)
    print("\n".join(rebuilt.lines()))
    return 0 if rebuilt.ok else 1
