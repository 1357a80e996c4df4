"""`stiffdice completion`: what a shell needs to complete commands, options, files and names."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

HELP = "print what makes your shell complete commands, options, files and names"
EXAMPLES = """\
examples:
  stiffdice completion bash
  stiffdice completion zsh
  stiffdice completion tcsh

In bash, for this session: `source <(stiffdice completion bash)`; for all to come, put that line into ~/.bashrc. In zsh,
write it to a file _stiffdice in a folder of $fpath. In tcsh, `stiffdice completion tcsh | source /dev/stdin`. Files are
offered by what a command takes, studies by their names in config/.
"""

SHELLS = ("bash", "zsh", "tcsh")

# By placeholder of an argument: the endings of the files that it may be.
_ENDINGS = {
    "SCENE.yaml": (".yaml", ".yml"),
    "COUNTS.yaml": (".yaml", ".yml"),
    "MODEL.xml": (".xml",),
    "FILE.h5": (".h5",),
    "FILE.gif": (".gif",),
    "FILE.png": (".png", ".svg", ".pdf"),
    "ARCHIVE": (".zip",),
}
_ANY_FILE = ("OUT", "PATH", "A", "B")
# Placeholders of what cannot be completed.
FREE = ("N", "X", "X,Y,Z", "NAME", "KEY.PATH=VALUE", "COMMAND")
# Studies are those of the folder in which the shell is when it completes.
_STUDIES = r"ls config 2>/dev/null | sed -n 's/\.yaml$//p'"


def add(completion: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    completion.add_argument("shell", metavar="SHELL", choices=SHELLS, help="bash, zsh or tcsh")


def call(options: argparse.Namespace) -> None:
    """Print the shell's script."""
    import shtab

    for action in _actions(options.parser):
        if action.metavar is not None and (how := completion_of(str(action.metavar))) is not None:
            action.complete = how  # type: ignore[attr-defined]  # as shtab wants it
    print(shtab.complete(options.parser, options.shell))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def completion_of(metavar: str) -> Any:
    """Return how shtab is to complete what this placeholder stands for; none if it cannot."""
    import shtab

    if metavar in _ENDINGS:
        return shtab.glob(*(f"*{ending}" for ending in _ENDINGS[metavar]))
    if metavar in _ANY_FILE:
        return shtab.FILE
    if metavar == "STUDY":
        return _of_words("studies", f"$({_STUDIES})", f"`{_STUDIES}`")
    words = _words().get(metavar)
    return words and _of_words(metavar.lower(), " ".join(words), f"({' '.join(words)})")


def _of_words(name: str, words: str, in_tcsh: str) -> dict[str, Any]:
    """Return how shtab completes one of some words; they are found when the shell completes."""
    function = f"_stiffdice_{name}"
    bash = f'{function}() {{\n  compgen -W "{words}" -- "$1"\n}}\n'
    zsh = f"{function}() {{\n  compadd -- {words}\n}}\n"
    return {"bash": function, "zsh": function, "tcsh": in_tcsh, "preamble": {"bash": bash, "zsh": zsh}}


def _words() -> dict[str, Sequence[str]]:
    """Return the names that there are, by the placeholders that stand for them."""
    from stiffdice.advice import engine_parameters, materials
    from stiffdice.dynamics import model_selection
    from stiffdice.integrators import registry as schemes
    from stiffdice.scene.flat_landing import CONTACT_LAWS
    from stiffdice.scene.scene import PRESETS
    from stiffdice.simulation import backend
    from stiffdice.simulation.engines import registry as engines
    from stiffdice.simulation.launch_distribution import ORIENTATIONS
    from stiffdice.study.catalogue import DRAWINGS

    return {
        "PRESET": list(PRESETS),
        "SCHEME": list(schemes.SCHEMES),
        "MODEL": [*model_selection.CHOICES, "pair"],
        "SIMULATOR": [backend.OURS, *engines.ENGINES],
        "ENGINE": list(engine_parameters.ENGINES),
        "MATERIAL": list(materials.MATERIALS),
        "LAW": list(CONTACT_LAWS),
        "ORIENTATION": list(ORIENTATIONS),
        "PURPOSE": ["path", "landing"],
        "THROW": ["dropped", "tossed", "rolled"],
        "DRAWING": [name for name, entry in DRAWINGS.items() if entry.given != "timings"],
        "SHELL": list(SHELLS),
    }
