"""`stiffdice archive`: a study with all that made it, in one file."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path

from stiffdice import __version__
from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output

HELP = "pack a finished study with all that made it into one file"
EXAMPLES = """\
examples:
  make report STUDY=quick           # runs the study and makes its report
  stiffdice archive quick
  stiffdice archive quick -o quick.crate.zip --agent "Ada Lovelace"
  make archive STUDY=quick          # all of it

The file is an RO-Crate: data, figures, report, configuration, workflow, code and locked versions, with a digest of
each. To be called in the project's folder.
"""


def add(archive: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    archive.add_argument("study", metavar="STUDY", help="the name of a file in config/, without .yaml")
    grammar.add(archive, "--output", ", a .zip file (default: results/archives/STUDY-VERSION.crate.zip)")
    archive.add_argument("--agent", metavar="NAME", help="who ran the study, if the archive is to say so")
    grammar.add(archive, "--force")
    grammar.add_form(archive)


def call(options: argparse.Namespace) -> None:
    """Pack the study, and print how much room it takes."""
    from stiffdice.archive import pack
    from stiffdice.archive.contents import in_megabytes
    from stiffdice.cli.terminal.progress import notes
    from stiffdice.errors import printable

    study = common.study_of(options.study)
    # In a folder that is no study's. WorkflowHub knows a crate by its ending, zip programs go by the last part of it.
    target = Path("results", "archives", f"{study.name}-{__version__}.crate.zip")
    if options.output:
        target = common.target_of(options.output, options.force, _is_archive)
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
    with notes(f"archive: packing {study.name}") as tell:
        packed = pack.pack(study, Path(), target, options.agent, tell.part)
    if options.json:
        output.say_json({"archive": str(packed.path), "bytes": packed.size, **packed.sizes.as_data()})
        return
    output.say([*study.left_out, str(packed.sizes), printable(f"{packed.path}: {in_megabytes(packed.size)}")])


def _is_archive(path: Path) -> bool:
    import zipfile

    from stiffdice.archive import crate

    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        return crate.NAME in archive.namelist()
    return False
