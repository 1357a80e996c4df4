"""What an archive says of itself to people: one page that needs nothing but itself and the figures beside it."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING
from urllib.parse import quote

from stiffdice.archive import manifest
from stiffdice.archive.sizes import in_megabytes, rows, sentence
from stiffdice.errors import printable

if TYPE_CHECKING:
    from stiffdice.archive.crate import Facts

NAME = "ro-crate-preview.html"

_STYLE = """\
body { font-family: sans-serif; line-height: 1.45; max-width: 60em; margin: 2em auto; padding: 0 1em; }
img { max-width: 100%; }
td, th { padding: 0 1em 0 0; text-align: right; }
td:first-child, th:first-child { text-align: left; }
pre { background: #f3f3f3; padding: 0.7em; overflow-x: auto; }"""


def page(facts: Facts) -> str:
    """Return the page, as HTML."""
    parts = [
        f"<h1>{_text(facts.title)}</h1>",
        f"<p>{_text(facts.citation.abstract)}</p>",
        *(f"<p>{_text(line)}</p>" for line in facts.study.left_out),
        *_figures(facts),
        *_data(facts),
        *_use(facts),
        *_sizes(facts),
        *_origin(facts),
    ]
    head = f'<meta charset="utf-8">\n<title>{_text(facts.title)}</title>\n<style>\n{_STYLE}\n</style>'
    body = "\n".join(parts)
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _text(text: str) -> str:
    """Return text as HTML that shows all of it, in its order."""
    return escape(printable(text))


def _link(path: str, text: str | None = None) -> str:
    return f'<a href="{quote(path)}">{_text(text or path)}</a>'


def _figures(facts: Facts) -> list[str]:
    top = f"results/{facts.study.name}/figures"
    lines = ["<h2>Figures</h2>"] if facts.study.figures else []
    for name, figure in facts.study.figures.items():
        suffix = "gif" if figure.draw == "animation" else "png"
        title = _text(figure.title)
        lines += [f'<p><img src="{quote(top)}/{quote(name)}.{suffix}" alt="{title}"><br>{title}</p>']
    return lines


def _data(facts: Facts) -> list[str]:
    """Return the list of what is worth opening; shards, logs and code are in the manifest."""
    paths = [
        file.path
        for file in facts.files
        if file.kind == "report"
        or (file.result is not None and file.result.stage not in {"shard", "figure", "animation"})
        or (file.path.startswith("docs/") and file.path.lower().endswith("format.md"))
    ]
    own = ["README.md", "LICENSE", "CITATION.cff", f"config/{facts.study.name}.yaml", manifest.NAME]
    items = "\n".join(f"<li>{_link(path)}</li>" for path in [*own, *paths])
    told = "Files that end in .h5 are netCDF-4 on HDF5: ncdump, h5dump, xarray, MATLAB and Octave read them."
    return ["<h2>Files</h2>", f"<p>{told}</p>", f"<ul>\n{items}\n</ul>"]


def _use(facts: Facts) -> list[str]:
    name = facts.study.name
    return [
        "<h2>Check it, make it again</h2>",
        "<p>Any system can check that every file is as it was packed:</p>",
        f"<pre>sha256sum --check {manifest.NAME}</pre>",
        f"<p>With stiffdice {_text(facts.citation.version)} installed, which also looks into the files, "
        "or from the unpacked folder itself:</p>",
        f"<pre>stiffdice verify ARCHIVE\nstiffdice rebuild ARCHIVE\n\nmake study STUDY={_text(name)}</pre>",
    ]


def _sizes(facts: Facts) -> list[str]:
    lines = [
        f"<tr><td>{_text(name)}</td><td>{size.files}</td><td>{in_megabytes(size.bytes)}</td>"
        f"<td>{in_megabytes(size.packed)}</td></tr>"
        for name, size in rows(facts.sizes)
    ]
    head = "<tr><th></th><th>files</th><th>unpacked</th><th>packed</th></tr>"
    table = "\n".join(["<table>", head, *lines, "</table>"])
    told = sentence(facts.sizes)
    return ["<h2>Sizes</h2>", table, *([f"<p>{_text(told)}.</p>"] if told else [])]


def _origin(facts: Facts) -> list[str]:
    made = ", ".join(f"{name} {version}" for name, version in facts.software)
    lines = ["<h2>Origin</h2>", f"<p>Computed by {_text(made)}.</p>"]
    if facts.span:
        begun, ended = (f"{time:%Y-%m-%d %H:%M:%S} UTC" for time in facts.span)
        lines.append(f"<p>The first job began on {begun}, the last one ended on {ended}.</p>")
    if facts.agent:
        lines.append(f"<p>Run by {_text(facts.agent)}.</p>")
    stands_on = "".join(f"<br>{_text(authors)}: {_text(title)}" for title, authors in facts.citation.references)
    return [
        *lines,
        "<h2>Citation and licence</h2>",
        f"<p>{_text(facts.citation.sentence)}</p>",
        f"<p>It stands on:{stands_on}</p>" if stands_on else "",
        f"<p>{_text(facts.citation.licence)} licence: {_link('LICENSE')}.</p>",
    ]
