"""Build the explorer: one HTML file that needs no network, made of the assets beside this module, plotly and data."""

from __future__ import annotations

import base64
import gzip
import json
from importlib import resources
from pathlib import Path
from typing import Any

import stiffdice
from stiffdice.errors import InputError
from stiffdice.experiments.dice.throws import default_steps
from stiffdice.io.writer import write_bytes
from stiffdice.report.explorer import map_data, scene_data
from stiffdice.scene import die
from stiffdice.scene import scene as scenes
from stiffdice.simulation.landing import faces_of

# In the order in which they are put together: one strict-mode script, whose functions see each other.
SCRIPTS = (
    *("kernel.js", "verdict.js", "landing.js", "charts.js", "replay.js", "throw.js", "die.js"),
    *("judge.js", "cells.js", "rerun.js", "map_plots.js", "map.js", "main.js"),
)
MOST_BYTES = 4_000_000

# The cube of Figure 13 on its stiffest ground, where steps matter.
_THROW = {"ground": {"stiffness": 1.0e6}}
_PRESETS = ("as_written", "as_listed")
# Of the die's velocity [m/s] and spin [rad/s], as `stiffdice throw` draws them unless told otherwise.
_SPREAD = {"velocity_spread": 0.3, "spin_spread": 30.0}


def build(results: Path) -> str:
    """Return the page of the studies that are stored in a results folder; raises InputError if it is too large."""
    parts = {
        "STYLE": _asset("style.css") + _asset("map.css"),
        "DATA": _embedded(data_of(results)),
        "PLOTLY": _plotly(),
        "SCRIPT": '"use strict";\n' + "\n".join(_asset(name) for name in SCRIPTS),
    }
    page = _asset("page.html")
    for name, text in parts.items():
        page = page.replace(f"<!-- {name} -->", text)
    size = len(page.encode())
    if size > MOST_BYTES:
        sizes = ", ".join(f"{name.lower()} {len(text.encode()):,}" for name, text in parts.items())
        raise InputError(f"explorer: {size:,} bytes ({sizes}); allowed are at most {MOST_BYTES:,}")
    return page


def write(results: Path, target: Path) -> None:
    """Write the page of the studies in a results folder; raises InputError if it is too large."""
    write_bytes(build(results).encode(), target)


def data_of(results: Path) -> dict[str, Any]:
    """Return what the page's script works on: scenes to throw, the die, and the stored stability map."""
    bases = {preset: scene_data.plain(scenes.from_mapping(_THROW, preset), "tumbling") for preset in _PRESETS}
    return {"version": stiffdice.__version__, "throw": bases, "die": _die(), "map": map_data.collect(results)}


def _die() -> dict[str, Any]:
    """Return the die of `stiffdice throw`, how it is thrown, and what decides its face."""
    scene = scenes.from_mapping(die.SCENE, "as_written")
    faces = faces_of(scene)
    return {
        "scene": scene_data.plain(scene, "tumbling"),
        "steps": default_steps(scene),
        "height": faces.height.tolist(),
        "barrier": faces.barrier.tolist(),
        "normals": die.NORMALS.tolist(),
        **_SPREAD,
    }


def _asset(name: str) -> str:
    return (resources.files("stiffdice.report.explorer") / "assets" / name).read_text(encoding="utf-8")


def _embedded(data: dict[str, Any]) -> str:
    """Return data as JSON that no `</script>` in it can end."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _plotly() -> str:
    """Return plotly's own minified script, gzip and base64; the same bytes at any time."""
    script = (resources.files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    return base64.b64encode(gzip.compress(script, 9, mtime=0)).decode("ascii")
