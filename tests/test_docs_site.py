"""The documentation as a site: it builds without a warning, and works in a browser without a network."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}
PLAIN = "docs/explanation/refinement.html"  # text, a picture, wide tables
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        not importlib.util.find_spec("pydata_sphinx_theme"), reason="needs Sphinx and its theme (make install-docs)"
    ),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """Return the folder of the site; a warning, as of a link that leads nowhere, is an error."""
    folder = tmp_path_factory.mktemp("site")
    options = ["--quiet", "--fail-on-warning", "--conf-dir", "docs", "--doctree-dir", str(folder / "doctrees")]
    command = [sys.executable, "-m", "sphinx", *options, ".", str(folder / "html")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "html"


@pytest.fixture
def opened(chromium, site):
    """Return a function that opens a page; in the end no console has told of trouble, and no network was asked."""
    contexts, heard = [], []

    def open_page(path, viewport=None, query="", **options):
        contexts.append(chromium.new_context(viewport=viewport or DESKTOP, **options))
        tab = contexts[-1].new_page()
        tab.on("console", lambda message: heard.append(message.text) if message.type != "log" else None)
        tab.on("pageerror", lambda error: heard.append(str(error)))
        tab.on("requestfailed", lambda request: heard.append(f"failed: {request.url}"))
        tab.on("request", lambda request: heard.append(request.url) if not request.url.startswith("file:") else None)
        tab.goto((site / path).as_uri() + query)
        return tab

    yield open_page
    for context in contexts:
        context.close()
    assert heard == []


def test_every_page_is_on_the_site(site):
    for folder in ("docs", "config", "results"):
        for page in ROOT.joinpath(folder).glob("**/*.md") if folder != "results" else [ROOT / "results/README.md"]:
            assert (site / page.relative_to(ROOT)).with_suffix(".html").is_file(), page


def test_the_map_leads_to_every_part(opened):
    tab = opened("docs/index.html")
    for part in ("tutorial", "how-to", "explanation", "reference"):
        tab.locator(f"article a[href='{part}/index.html']").first.click()
        tab.wait_for_url(f"**/docs/{part}/index.html")
        assert tab.locator("article h1").count() == 1
        tab.go_back()


def test_pictures_are_there(opened):
    tab = opened(PLAIN)
    widths = tab.eval_on_selector_all("article img", "images => images.map(image => image.naturalWidth)")
    assert widths
    assert all(widths)


def test_search_finds_a_page(opened):
    tab = opened("search.html", query="?q=restitution")
    tab.wait_for_selector("#search-results li a")
    found = tab.eval_on_selector_all("#search-results li a", "links => links.map(link => link.getAttribute('href'))")
    assert any("ground.html" in link for link in found), found


def brightness(tab, what: str, selector: str) -> float:
    """Return the mean of red, green and blue [0 to 255] of a colour of the first such element."""
    script = f"(element) => getComputedStyle(element).{what}.match(/[\\d.]+/g).slice(0, 3).map(Number)"
    return sum(tab.eval_on_selector(selector, script)) / 3


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_light_and_in_dark(opened, scheme):
    tab = opened(PLAIN, color_scheme=scheme)
    text, ground = brightness(tab, "color", "article p"), brightness(tab, "backgroundColor", "body")
    assert (text - ground) * (1 if scheme == "dark" else -1) > 120


@pytest.mark.parametrize(
    "page", [PLAIN, "docs/index.html", "docs/reference/experiments.html", "docs/reference/api.html"]
)
def test_a_phone_need_not_scroll_sideways(opened, page):
    """Wide tables and code scroll in themselves."""
    tab = opened(page, PHONE)
    assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
