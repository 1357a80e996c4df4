"""The pages of what files in config/ may say, from the code and the schema that check them: `make docs`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from docs import markdown

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.scene import cube, derived_parameters, scene
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.study import catalogue
from stiffdice.study.config import NAMES

SCHEMA = Path(__file__).parents[1] / "src/stiffdice/study/study.schema.yaml"

_SCENE_HEAD = """\
# Keys of a scene

Every key of a scene's file: unit, default, what is allowed, meaning. For whoever writes one.

`make docs` writes this page from the code that reads scenes. [config/README.md](../../config/README.md) says how values
are written, and what restitution and contact time mean. Every key has the paper's value as its default, so an empty
file is a scene.
"""
_STUDY_HEAD = """\
# Keys of a study

Every key of a study's file: default, what is allowed, meaning. For whoever writes one.

`make docs` writes this page from `src/stiffdice/study/study.schema.yaml`, by which studies are checked.
[config/README.md](../../config/README.md) introduces them. A span `{from, to, count}` has so many values from one to
the other. Models, schemes and simulators are explained in [schemes.md](schemes.md).
"""
_EXPERIMENTS_HEAD = """\
# Experiments, figures, tables

What a study can measure, time, draw and tell, with all options. For whoever writes a study.

`make docs` writes this page from the code. An experiment is `experiments.NAME`, with `measure`, `scene` and `options`.
Options that are not given have the values of the last column.
"""
_CRITERIA = "Each with its tolerance; how they are judged is in [criteria.md](../explanation/criteria.md)."
_SCENE_KEYS = {"cube": cube.Cube, "ground": scene.Ground, "launch": scene.Launch}
_OTHER_WORDS = [key for section in derived_parameters.INSTEAD.values() for key in section]
# Of a key, a value that is not allowed, and what has to stand beside it; of all others a text.
_WRONG: Mapping[str, Any] = {
    "restitution": {"restitution": 2},
    "contact_time": {"restitution": 0.5, "contact_time": "x"},
}


def pages() -> dict[str, str]:
    """Return the texts of the pages of scenes, studies and experiments."""
    return {
        "reference/scene.md": markdown.page(_SCENE_HEAD, _scene(), "## Presets", _PRESETS, _presets()),
        "reference/study.md": markdown.page(_STUDY_HEAD, *_study(yaml_loader.load(SCHEMA))),
        "reference/experiments.md": markdown.page(_EXPERIMENTS_HEAD, *_experiments()),
    }


_PRESETS = "A preset sets the keys that are not given. `stiffdice run --preset` goes before the preset of the file."


def _scene() -> str:
    """Return the table of a scene's keys."""
    default = scene.Scene().as_mapping()
    told = [("`preset`", "", "as_listed", _allowed({"preset": "x"})[0], "see below")]
    for section, kind in _SCENE_KEYS.items():
        instead = derived_parameters.INSTEAD.get(section, {})
        fields = list(dict.fromkeys([*kind.__dataclass_fields__, *instead]))
        meaning = _explained(derived_parameters, _OTHER_WORDS) | _explained(kind, fields)
        for key in fields:
            allowed, unit = _allowed({section: _WRONG.get(key, {key: "x"})})
            by_preset = f"{section}.{key}" in next(iter(scene.PRESETS.values()))
            value = "by preset" if by_preset else _value(default[section].get(key))
            told.append((f"`{section}.{key}`", unit, value, allowed, meaning[key]))
    for key, what in (("gravity", "along −z"), ("duration", "of the motion")):
        allowed, unit = _allowed({key: "x"})
        told.append((f"`{key}`", unit, _value(default[key]), allowed, what))
    return markdown.table(("key", "unit", "default", "allowed", "meaning"), told)


def _allowed(wrong: Mapping[str, Any]) -> tuple[str, str]:
    """Return what a message says is allowed in place of a wrong value, and its unit."""
    try:
        scene.from_mapping(wrong)
    except InputError as error:
        allowed = re.sub(r".*: allowed (is|are) |, or with a unit.*", "", str(error))
        unit = re.search(r" \[([^]]*)\]$", allowed.partition(";")[0])
        return allowed.replace(unit[0], "") if unit else allowed, unit[1] if unit else ""
    raise AssertionError(f"{wrong} is allowed")


def _explained(what: Any, names: Iterable[str]) -> dict[str, str]:
    """Return what a docstring says of each of these names, `name [unit]: ...`."""
    text = re.sub(r" Raises \w+Error.*", "", " ".join(inspect.getdoc(what).split()))
    parts = re.split(rf"(?:^|(?<=\. ))({'|'.join(names)})(?: \[[^]]*\])?: ", text)
    return {name: told.strip().removesuffix(".") for name, told in zip(parts[1::2], parts[2::2], strict=True)}


def _presets() -> str:
    keys = list(next(iter(scene.PRESETS.values())))
    rows = [
        (f"`{name}`", *(values[key] or "has to be stated" for key in keys)) for name, values in scene.PRESETS.items()
    ]
    return markdown.table(("preset", *(f"`{key}`" for key in keys)), rows)


def _study(schema: Any) -> list[str]:
    """Return the tables of a study's keys, one for all and one for each kind of thing that has keys of its own."""
    head = ("key", "default", "allowed", "meaning")
    kinds = schema["$defs"]
    parts = [markdown.table(head, _rows(schema, kinds))]
    for name in ("run", "sweep", "experiment", "figure", "table"):
        also = "The keys of `timings.NAME` are the same." if name == "experiment" else ""
        parts += [f"## {name}s.NAME", also, markdown.table(head, _rows(kinds[name], kinds))]
    rows = [(f"`{name}`", f"{part.TOLERANCE:g}", _criterion(part)) for name, part in CRITERIA.items()]
    return [*parts, "## criteria", _CRITERIA, markdown.table(("key", "default", "meaning"), rows)]


def _criterion(part: Any) -> str:
    said = inspect.getdoc(part).splitlines()[0].partition(": ")[2].removesuffix(".")
    return said if part.FOR_TURNING else f"{said} (only of a cube that does not turn)"


def _rows(kind: Any, kinds: Any) -> Iterable[tuple[str, ...]]:
    for key, part in kind["properties"].items():
        needed = key in kind.get("required", ())
        default = "needed" if needed else _value(part["default"]) if "default" in part else "none"
        yield f"`{key}`", default, _of_schema(part, kinds), part["description"]


def _of_schema(part: Any, kinds: Any) -> str:
    """Return what is allowed, from the message that a person gets where it is not."""
    name = part.get("$ref", "").rpartition("/")[2]
    if name in NAMES:
        return " or ".join(NAMES[name])
    told = re.sub(
        r"^allowed (is|are) ", "", part.get("errorMessage") or kinds.get(name, {}).get("errorMessage", "a name")
    )
    items = part.get("items", {})
    words = items.get("enum") or NAMES.get(items.get("$ref", "").rpartition("/")[2], ())
    return f"{told}: {' or '.join(words)}" if words else told


def _experiments() -> list[str]:
    parts = []
    for heading, registry in (("Experiments", catalogue.EXPERIMENTS), ("Timings", catalogue.TIMINGS)):
        rows = []
        for name, entry in registry.items():
            parameters = inspect.signature(entry.load()).parameters.values()
            options = [part for part in parameters if part.kind is part.KEYWORD_ONLY]
            defaults = ", ".join(f"`{part.name}` {_short(part.default)}" for part in options)
            rows.append((f"`{name}`", _said(entry.load(), [part.name for part in parameters]), defaults or "none"))
        head = ("`measure`", "what it gives, and what its options mean", "options")
        parts += [f"## {heading}", markdown.table(head, rows)]
    rows = []
    for word, registry in (("draw", catalogue.DRAWINGS), ("tell", catalogue.TABLES)):
        for name, entry in sorted(registry.items(), key=lambda item: (item[1].given, item[1].measures)):
            measures = f"`{entry.measures}`" if entry.measures else ""
            rows.append((f"`{word}: {name}`", entry.given, measures, "yes" if entry.timed else ""))
    return [*parts, "## Figures and tables", markdown.table(("name", "of", "`measure`", "with timings"), rows)]


def _said(function: Any, names: Iterable[str]) -> str:
    """Return what a docstring says, without its errors, its parameters in code."""
    text = re.sub(r" Raises \w+Error.*", "", " ".join(inspect.getdoc(function).split())).removeprefix("Return ")
    name = rf"(?:{'|'.join(names)})(?: \[[^]]*\])?"
    listed = rf"(?:^|(?<=\. )|(?<=; )){name}(?:(?:, | and ){name})*(?=: )"
    return re.sub(listed, lambda found: re.sub(rf"\b({'|'.join(names)})\b", r"`\1`", found[0]), text)


def _short(value: object) -> str:
    """Return a default value in few words."""
    if isinstance(value, tuple):
        if len(value) > 4:
            return f"{_short(value[0])} … {_short(value[-1])} ({len(value)})"
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


def _value(value: object) -> str:
    """Return a value as a file of YAML has it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return "{}" if value == {} else f"{value:g}" if isinstance(value, (int, float)) else str(value)
