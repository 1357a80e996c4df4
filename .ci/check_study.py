"""Check what the small study left: files that open, and numbers that are right. check_study.py NAME"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import xarray as xr
from PIL import Image

ROOT = Path(__file__).parent.parent


def check(condition: object, what: str) -> None:
    """End with status 1 unless the condition holds."""
    if not condition:
        sys.exit(f"check_study: {what}")
    print(f"ok: {what}")


def main(name: str) -> None:
    """Check the results of one study."""
    top = ROOT / "results" / name
    for figure in ("position", "energy", "frontier"):
        with Image.open(top / "figures" / f"{figure}.png") as image:
            pixels = np.asarray(image.convert("L"))
        check(pixels.std() > 5 and min(pixels.shape) > 300, f"{figure}.png is a picture")
        svg = (top / "figures" / f"{figure}.svg").read_text(encoding="utf-8")
        check(svg.startswith("<?xml") and svg.rstrip().endswith("</svg>"), f"{figure}.svg is whole")
    listed = xr.open_dataset(top / "runs" / "figure-09.as_listed.h5")
    highest = float(listed.energy_paper.max())
    check(abs(highest - 96.10474204235116) < 1e-9, f"figure 9: energy rises to {highest:.4f} J as listed")
    frontier = xr.open_dataset(top / "sweeps" / "steps-needed" / "frontier.h5")
    asked = frontier.criterion.attrs["flag_meanings"].split()
    bounces = frontier.isel(criterion=[asked.index("energy"), asked.index("apex")])
    check((bounces.first_pass > bounces.limit).all(), "nothing passes above the limit of linear stability")
    exponent = bounces.exponent.isel(edge=frontier.edge.attrs["flag_meanings"].split().index("last_fail")).values
    check(np.all(np.abs(exponent - 0.5) < 0.17), f"last fail grows about as the root of stiffness: {exponent.round(3)}")
    with (top / "sweeps" / "steps-needed" / "frontier.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    check(len(rows) == frontier.first_pass.size, "the table has a line for each point")


if __name__ == "__main__":
    main(sys.argv[1])
