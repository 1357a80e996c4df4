"""The pages of the command `stiffdice`, from its parsers: `make docs`."""

from __future__ import annotations

import argparse
import inspect
import re

from docs import markdown

from stiffdice.cli import main

_HEAD = """\
# The command stiffdice

The subcommands of `stiffdice`, a page each. For whoever types them, or calls them from a script.

`make docs` writes these pages from what `stiffdice COMMAND --help` says. Every command tells bad input in one line and
exits with status 2. Ctrl-C ends with status 130, and nothing is stored.
"""


def pages() -> dict[str, str]:
    """Return the texts of docs/reference/cli.md and of docs/reference/cli/*.md."""
    told, rows = {}, []
    for name, parser in _commands(main._parser()).items():
        path = f"cli/{name.replace(' ', '-')}.md"
        rows.append((f"[{name}]({path})", parser.description or ""))
        told[f"reference/{path}"] = markdown.page(f"# stiffdice {name}", *_parts(parser))
    return {"reference/cli.md": markdown.page(_HEAD, markdown.table(("command", "what it does"), rows))} | told


def _commands(parser: argparse.ArgumentParser, before: str = "") -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all subcommands by their words, those of a subcommand after it."""
    found = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                found |= {f"{before}{name}": command} | _commands(command, f"{before}{name} ")
    return found


def _parts(parser: argparse.ArgumentParser) -> list[str]:
    shown = [action for action in parser._actions if action.help != argparse.SUPPRESS and action.dest != "help"]
    options = any(action.option_strings for action in shown)
    needed = [action for action in shown if action.required and action.option_strings]
    words = [parser.prog, *(f"{action.option_strings[0]} {_value(action)}".strip() for action in needed)]
    words += ["[OPTIONS]"] * options + [_words(action) for action in shown if not action.option_strings]
    parts = [f"{parser.description} For whoever types the command.", markdown.code(" ".join(words), "text")]
    for group in parser._action_groups:
        rows = [(f"`{_words(action)}`", _help(parser, action)) for action in group._group_actions if action in shown]
        if rows:
            parts += [f"## {_title(group.title)}", markdown.table(("name", "what"), rows)]
    examples, _, rest = inspect.cleandoc(parser.epilog or "").partition("\n\n")
    commands = "\n".join(line.removeprefix("  ") for line in examples.splitlines()[1:])
    return [*parts, "## Examples", markdown.code(commands, "text"), re.sub(r"(\bdocs/[\w/.-]+)", r"`\1`", rest)]


def _title(title: str | None) -> str:
    named = {"positional arguments": "arguments"}.get(title or "", title or "")
    return named[:1].upper() + named[1:]


def _words(action: argparse.Action) -> str:
    """Return how an option or an argument is typed."""
    value = _value(action)
    if not action.option_strings:
        return {"?": f"[{value}]", "*": f"[{value} ...]", "+": f"{value} ..."}.get(str(action.nargs), value)
    return f"{', '.join(action.option_strings)} {value}".strip()


def _value(action: argparse.Action) -> str:
    return str(action.metavar or action.dest) if action.nargs != 0 else ""


def _help(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    return parser._get_formatter()._expand_help(action) if action.help else ""
