"""What an archive says of itself to people: one page that needs nothing but itself and the figures beside it."""

from __future__ import annotations

from pathlib import Path

from stiffdice.archive import manifest
from stiffdice.archive.contents import REPORT, in_megabytes
from stiffdice.archive.crate import Facts
from stiffdice.errors import printable

NAME = "ro-crate-preview.html"


def page(facts: Facts) -> str:
    """Return the page, as HTML: all text is shown as it is, in its order."""
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=True, keep_trailing_newline=True)
    environment.finalize = lambda value: printable(value) if isinstance(value, str) else value
    environment.filters["megabytes"] = in_megabytes
    template = environment.from_string(Path(__file__).with_name("preview.html.jinja").read_text(encoding="utf-8"))
    # Worth opening; shards, logs and code are in the manifest.
    shown = [
        file.path
        for file in facts.files
        if file.kind == REPORT
        or (file.result is not None and file.result.stage not in {"shard", "figure", "animation"})
        or file.path == "docs/FORMAT.md"
    ]
    paths = ["README.md", "LICENSE", "CITATION.cff", f"config/{facts.study.name}.yaml", manifest.NAME, *shown]
    return template.render(facts=facts, paths=paths, manifest=manifest.NAME)
