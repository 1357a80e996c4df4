"""`stiffdice archive`: a study with all that made it, in one file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from stiffdice.cli import common

if TYPE_CHECKING:
    from stiffdice.archive.sizes import Sizes

EXAMPLES = """\
examples:
  make report STUDY=quick           # runs the study and makes its report
  stiffdice archive quick
  stiffdice archive quick -o quick.crate.zip --agent "Ada Lovelace"
  make archive STUDY=quick          # all of it

The file is an RO-Crate: data, figures, report, configuration, workflow, code and locked versions, with a digest of
each. To be called in the project's folder.
"""


def add(commands: common.Commands) -> None:
    """Add the command to the parser."""
    archive = common.add_command(
        commands, "archive", _archive, "pack a finished study with all that made it into one file", EXAMPLES
    )
    archive.add_argument("study", metavar="STUDY", help="the name of a file in config/, without .yaml")
    archive.add_argument(
        "-o", dest="output", metavar="FILE.zip", help="default: results/archives/STUDY-VERSION.crate.zip"
    )
    common.add_force(archive)
    archive.add_argument("--agent", metavar="NAME", help="who ran the study, if the archive is to say so")
    archive.add_argument("--json", action="store_true", help="sizes for programs")


def _archive(options: argparse.Namespace) -> None:
    import json

    from stiffdice import __version__
    from stiffdice.archive import pack
    from stiffdice.archive.sizes import in_megabytes
    from stiffdice.errors import InputError, printable
    from stiffdice.study import config as studies

    root = Path()
    schema = root / "workflow/schemas/study.schema.yaml"
    if not schema.is_file():
        raise InputError(f"{schema}: not here; an archive is made in the project's folder")
    if not studies.NAME.fullmatch(options.study):
        raise InputError(f"STUDY = {options.study}: allowed is the name of a file in config/, without .yaml")
    study = studies.load(root / "config" / f"{options.study}.yaml", schema)
    target = pack.default_target(study, root, __version__)
    if options.output:
        target = common.target_of(options.output, options.force, _is_archive)
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
    packed = pack.pack(study, root, target, options.agent)
    if options.json:
        print(json.dumps({"archive": str(packed.path), "bytes": packed.size, **_plain(packed.sizes)}, indent=2))
        return
    for line in study.left_out:
        print(line)
    print(packed.sizes)
    print(printable(f"{packed.path}: {in_megabytes(packed.size)}"))


def _is_archive(path: Path) -> bool:
    import zipfile

    from stiffdice.archive import crate

    if not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return crate.NAME in archive.namelist()


def _plain(sizes: Sizes) -> dict[str, object]:
    """Return sizes as plain data."""
    return {
        "kinds": {kind: size._asdict() for kind, size in sizes.kinds.items()},
        "runs": sizes.runs,
        "bytes_per_run": sizes.per_run and sizes.per_run[0],
        "packed_bytes_per_run": sizes.per_run and sizes.per_run[1],
    }
