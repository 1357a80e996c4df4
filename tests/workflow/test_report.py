"""A title is text in the report, whatever it says: rendered here as Snakemake renders it, with our captions."""

from __future__ import annotations

import json
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import jinja2
import pytest
from docutils.core import publish_parts
from snakemake.iocontainers import Params
from snakemake.logging import format_dict
from snakemake.report.html_reporter.data import render_results

from stiffdice.study.catalogue import DRAWINGS
from stiffdice.study.config import PlannedFigure

sys.path.append(str(Path(__file__).parents[2] / "workflow" / "scripts"))

from job import Sealed

CAPTIONS = Path(__file__).parents[2] / "workflow" / "report"
TITLES = [
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(1)> <!-- <script>",
    "`press <javascript:alert(1)>`_ here_ |this| *that* :raw:`x`",
    "x\n\n.. raw:: html\n\n   <script>alert(1)</script>",
    r"\ back\slash, 1. ωh < 2 & 'more' \"so\"",
]


class Page(HTMLParser):
    """The elements and the text of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text = [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, attrs))

    def handle_data(self, data):
        self.text.append(data)


@pytest.mark.parametrize("kind", ["figure", "table"])
@pytest.mark.parametrize("title", TITLES)
def test_a_title_is_text_in_its_caption_and_in_the_settings(kind, title):
    planned = PlannedFigure("energy", ("steps",), title)
    params = Params(fromdict={"planned": Sealed(planned)})
    files = ["results/tiny/runs/steps.as_listed.h5"]
    snakemake = SimpleNamespace(params=params, wildcards=SimpleNamespace(study="tiny"), input=files)
    caption = jinja2.Template((CAPTIONS / f"{kind}.rst").read_text()).render(snakemake=snakemake)
    body = publish_parts(caption, writer="html")["body"]
    found = Page(body)
    allowed = {("p", ()), ("em", ()), ("tt", (("class", "docutils literal"),)), ("span", (("class", "pre"),))}
    assert {(tag, tuple(attrs)) for tag, attrs in found.tags} <= allowed
    assert "".join(found.text).startswith(f"{' '.join(title.split())} (tiny).")

    job = SimpleNamespace(rule=SimpleNamespace(name=kind))
    result = SimpleNamespace(
        **dict.fromkeys(("name", "filename", "labels", "mime", "wildcards"), ""),
        **{"path": Path("x.svg"), "size": 1, "caption": body, "job": job, "params": format_dict(params), "id": "x"},
    )
    element = render_results({"": {"": [result]}}, False)
    page = Page(f'<script id="results">var results = {element};</script><p>after</p>')
    assert [tag for tag, _ in page.tags] == ["script", "p"]
    assert json.loads(element)["x.svg"]["job_properties"]["params"] == format_dict(params)


@pytest.mark.parametrize("draw", DRAWINGS)
def test_each_drawing_has_its_own_words_what_to_see_who_asked_and_where_the_data_are(draw):
    planned = PlannedFigure(draw, ("x",), "A title")
    files = ["results/mine/experiments/x.h5", "results/mine/experiments/y.h5"]
    snakemake = SimpleNamespace(
        params=Params(fromdict={"planned": Sealed(planned)}), wildcards=SimpleNamespace(study="mine"), input=files
    )
    caption = jinja2.Template((CAPTIONS / "figure.rst").read_text()).render(snakemake=snakemake)
    found = "".join(Page(publish_parts(caption, writer="html")["body"]).text)
    assert ("wireframe" in found) == draw.startswith(("cube", "animation"))
    assert "Asked in config/mine.yaml; data:" in found
    assert all(file in found for file in files)
