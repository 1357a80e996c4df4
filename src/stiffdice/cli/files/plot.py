"""`stiffdice plot`: a file as a figure."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError, printable, told_within

HELP = "draw a file: a run's path and energy, a sweep's edges, what an experiment found"
EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml -o throw.h5
  stiffdice plot throw.h5
  stiffdice plot throw.h5 --draw energy -o energy.svg
  stiffdice plot throw.h5 --draw cube-end
  stiffdice plot throw.h5 --draw animation

The figure lies beside the file unless -o says where: throw.png, throw-energy.png with --draw energy. The drawings are
those of studies (figures.NAME.draw in config/README.md); what is printed names the others of the file. Runs have
position, energy and, where the cube turns, cube-end (the way that it has come), cube-start, cube-middle and animation.
"""

_ENDINGS, _MOVING = (".png", ".svg", ".pdf"), ".gif"


def add(plot: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    plot.add_argument("file", metavar="FILE.h5", help="a file of stiffdice")
    grammar.add(plot, "--output", ", a .png, .svg or .pdf file; of an animation .gif (default: .png beside FILE.h5)")
    plot.add_argument("--draw", metavar="DRAWING", help="which of its drawings (default: the first)")
    plot.add_argument("--show", action="store_true", help="open it in the viewer of the desktop, too")
    grammar.add(plot, "--force")
    grammar.add_form(plot)


def call(options: argparse.Namespace) -> None:
    """Draw the file, and say where the figure is."""
    viewer = _viewer() if options.show else []
    if options.output is not None:
        common.picture_target("-o", options.output, [*_ENDINGS, _MOVING], options.force, options.file)

    # These take about a second to import; a file that is not there is told before.
    from stiffdice.cli.terminal.progress import notes
    from stiffdice.io import isolation, reader

    isolation.admit(options.file)
    with notes(f"plot: drawing {printable(options.file)}"):
        from stiffdice.report import file_figure

        found = reader.open_file(options.file)
        names = file_figure.drawings_of(found)
        drawing = file_figure.chosen(found, options.file, options.draw)
        target = _target_of(options, drawing, names, drawing == file_figure.ANIMATION)
        with told_within(options.file):
            file_figure.draw(found, drawing, target)
    if options.json:
        output.say_json({"file": options.file, "figure": str(target), "drawing": drawing, "drawings": names})
    else:
        others = ", ".join(name for name in names if name != drawing)
        output.say([printable(f"{target}: {drawing}") + (f"; --draw has {others}, too" if others else "")])
    if viewer:
        subprocess.Popen([*viewer, str(target.resolve())], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _target_of(options: argparse.Namespace, drawing: str, names: list[str], moving: bool) -> Path:
    """Return the file to write; raises InputError for one with another ending, and for one that is not ours."""
    endings = (_MOVING,) if moving else _ENDINGS
    path = Path(options.file)
    beside = path.with_name(f"{path.stem}{'' if drawing == names[0] else f'-{drawing}'}{endings[0]}")
    return common.picture_target("-o", options.output or beside, endings, options.force, path)


def _viewer() -> list[str]:
    """Return the command that opens a figure; raises InputError where there is none."""
    name = "open" if sys.platform == "darwin" else "xdg-open"
    if shutil.which(name) is None:
        raise InputError(f"--show: {name} is not installed; open the figure yourself")
    if name == "xdg-open" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("--show: there is no display; leave it out")
    return [name]
