"""The page in a browser: the system's Chromium, driven by playwright; nothing is downloaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.report.explorer import page as explorer_page

DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="session")
def explorer(tmp_path_factory) -> Path:
    """Return the page as it is where no study is stored."""
    folder = tmp_path_factory.mktemp("explorer")
    explorer_page.write(folder, folder / "explorer.html")
    return folder / "explorer.html"


@pytest.fixture
def opened(chromium, explorer):
    """Return a function that opens the page; at the end nothing was said on the console nor asked of a network."""
    contexts, heard = [], []

    def open_page(viewport=None, **options):
        context = chromium.new_context(viewport=viewport or DESKTOP, **options)
        contexts.append(context)
        tab = context.new_page()
        tab.on("console", lambda message: heard.append(message.text))
        tab.on("pageerror", lambda error: heard.append(str(error)))
        tab.on("request", lambda request: heard.append(request.url) if request.url != explorer.as_uri() else None)
        tab.goto(explorer.as_uri())
        return tab

    yield open_page
    for context in contexts:
        context.close()
    assert heard == []
