"""How Sphinx makes a site of the pages: `make docs`. The site has the folders of the project, so links stay."""

from __future__ import annotations

project = "stiffdice"
author = "The stiffdice developers"
extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["*.md", "config/**.md", "results/README.md", "docs/**.md"]
# Folders that need not be looked through.
exclude_patterns = [".*", "benchmarks", "profiles", "requirements", "results/[!R]*", "src", "tests"]
nitpick_ignore_regex = [("myst", r"[\w./-]+/[\w-]+/?")]  # a link to a folder of the project is text on the site
myst_heading_anchors = 4
language = "en"

html_theme = "pydata_sphinx_theme"
html_title = "stiffdice"
html_copy_source = False
html_use_index = False
html_show_search_summary = False  # needs a server: pages opened as files may not read each other
html_context = {"default_mode": "auto"}  # light or dark as the reader's system
html_theme_options = {
    "footer_end": [],
    "footer_start": [],
    "header_links_before_dropdown": 4,
    "show_prev_next": False,
    "secondary_sidebar_items": {"docs/[!r]*/*": ["page-toc"]},  # not beside the wide tables of the reference
}
