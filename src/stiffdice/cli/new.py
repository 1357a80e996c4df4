"""`stiffdice new`: a scene, and a study of it, to begin with."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from stiffdice.cli import common
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError, OutputError, printable

if TYPE_CHECKING:
    from stiffdice.scene.scene import Scene

HELP = "write a scene of your own, and in the project's folder a study of it, to begin with"
EXAMPLES = """\
examples:
  stiffdice new my-cube
  stiffdice new my-die --from config/scenes/die.yaml
  stiffdice new my-listing --from as_listed

In the project's folder the scene is config/scenes/NAME.yaml and the study config/NAME.yaml, which `make study
STUDY=NAME` runs in seconds; elsewhere the scene is NAME.yaml, here. Comments say unit and alternatives of every key.
Nothing is replaced. Exit status: 0; 2 for bad input, and if one of the files is there.
"""

_START = "as_written"


def add(new: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    new.add_argument("name", metavar="NAME", help="of the scene and the study: letters, digits, hyphens, underscores")
    told = f"a scene, or one of the paper's readings: as_listed, as_written, corrected (default: {_START})"
    new.add_argument("--from", dest="source", default=_START, metavar="SCENE.yaml", help=told)


def call(options: argparse.Namespace) -> None:
    """Write the files, and say what to do with them."""
    # These take about a second to import.
    from stiffdice.study import config, starter

    name, is_project = options.name, Path(common.SCHEMA).is_file()
    if not config.NAME.fullmatch(name):
        raise InputError(f"NAME = {name}: allowed are letters, digits, hyphens and underscores")
    scene = _scene_of(options.source)
    path = Path("config", "scenes", f"{name}.yaml") if is_project else Path(f"{name}.yaml")
    files = {path: starter.scene_text(name, scene, options.source)}
    if is_project:
        files[Path("config", f"{name}.yaml")] = starter.study_text(name, scene, str(path))
    _write(files)
    lines = [*map(str, files), f"  stiffdice run {path} -o {name}.h5"]
    output.say([printable(line) for line in [*lines, *[f"  make study STUDY={name}"] * is_project]])


def _scene_of(source: str) -> Scene:
    """Return the scene in a file, or the paper's by one of its readings."""
    from stiffdice.scene import scene as scenes

    if source not in scenes.PRESETS:
        return scenes.load(source)
    # The preset `corrected` has the inertia stated; that of corner masses is the paper's words.
    return scenes.from_mapping({"cube": {"inertia": "corners"}} if source == "corrected" else {}, source)


def _write(files: dict[Path, str]) -> None:
    """Write new files, all or none; raises InputError if one is there."""
    for path in files:
        if path.exists() or path.is_symlink():
            raise InputError(f"{path}: is there already; name another, or remove it")
    written: list[Path] = []
    try:
        for path, text in files.items():
            with path.open("x", encoding="utf-8") as file:
                written.append(path)
                file.write(text)
    except OSError as error:
        for done in written:
            done.unlink()
        raise OutputError(f"{path}: {error.strerror}; nothing was written") from None
