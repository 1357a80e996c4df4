"""The report and the page of an archive in a browser: what a title says is text in them, and nothing of it runs."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from html import unescape
from types import SimpleNamespace

import pytest
import yaml
from tests.archive import packing
from tests.conftest import CHROMIUM
from tests.forks import run_module
from tests.workflow.test_workflow import TINY, Project

from stiffdice.archive.pack import pack

pytestmark = [
    pytest.mark.workflow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium, which is not installed"),
]
RUNS = "document.title='broken'"
TITLE = f'</script><script>{RUNS}</script><img src=x onerror={RUNS}>\nit\'s "so" \u202eb <b>bold</b> &amp; ω'
SHOWN = TITLE.replace("\n", " ").replace("\u202e", r"\u202e")

LOOK = "--report-stylesheet", "workflow/report/report.css"
LOADED = "() => [...document.images].some(image => image.complete && image.naturalWidth > 100)"

# Follows links by their place in the page, and notes what is shown then.
VISITOR = """
<script>
const clicks = %s;
function visit() {
  if (clicks.length) {
    const [what, number] = clicks.shift();
    document.querySelectorAll(what)[number].click();
    setTimeout(visit, 300);
    return;
  }
  const note = document.createElement("pre");
  note.id = "note";
  note.textContent = JSON.stringify({
    title: document.title,
    text: document.body.innerText,
    elements: document.querySelectorAll("[onerror], [src=x]").length,
  });
  document.documentElement.append(note);
}
setTimeout(visit, 500);
</script>
"""


def visited(page, *clicks):
    """Return what a browser shows of a page once some of its links were followed, each a selector and its place."""
    place = page.with_name("visited.html")
    place.write_text(page.read_text() + VISITOR % json.dumps(clicks))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=10000", "--dump-dom"]
    profile = f"--user-data-dir={page.parent / 'browser'}"
    done = subprocess.run(
        [CHROMIUM, *options, profile, place.as_uri()], capture_output=True, text=True, check=True, timeout=120
    )
    found = re.search(r'<pre id="note">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, "the page's own scripts, or the visitor's, failed"
    return SimpleNamespace(**json.loads(unescape(found[1])))


@pytest.mark.long
def test_a_script_in_a_page_would_be_seen(tmp_path):
    page = tmp_path / "page.html"
    page.write_text(f"<title>whole</title><p>{TITLE}</p>")
    seen = visited(page)
    assert seen.title == "broken" and seen.elements == 1


@pytest.mark.broad
def test_nothing_of_a_title_runs_in_the_report(tmp_path):
    project = Project(tmp_path)
    run = {**TINY["runs"]["stiff"], "presets": ["as_listed"], "steps": 1000}
    figures = {"position": {"draw": "position", "run": "stiff", "title": TITLE}}
    project.plan({"question": TITLE, "runs": {"stiff": run}, "figures": figures})
    for arguments in (("--cores", "1"), ("--report", "report.html")):
        done = project.snakemake(*arguments)
        assert done.returncode == 0, done.stderr
    results, details = ("nav ul a", 3), ("table a", 1)
    seen = visited(tmp_path / "report.html", results, details)
    assert seen.title == "Snakemake Report"
    assert seen.elements == 0
    assert f"{SHOWN} (tiny)." in seen.text


@pytest.mark.long
def test_nothing_of_a_title_runs_in_the_page_of_an_archive(tmp_path, monkeypatch):
    folder = packing.project(tmp_path / "project")
    figures = {"position": {**packing.TINY["figures"]["position"], "title": TITLE}}
    (folder / "config/tiny.yaml").write_text(yaml.safe_dump({**packing.TINY, "question": TITLE, "figures": figures}))
    monkeypatch.chdir(folder)
    planned = packing.plan(folder)
    packing.make(planned, folder)
    archive = pack(planned, folder, tmp_path / "tiny.crate.zip", TITLE).path
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(tmp_path / "unpacked")
    seen = visited(tmp_path / "unpacked" / "ro-crate-preview.html")
    shown = TITLE.replace("\n", r"\n").replace("\u202e", r"\u202e")
    assert seen.title == f"stiffdice study tiny: {shown}"
    assert seen.elements == 0
    assert seen.text.count(shown) == 3  # the question, the title of the figure and who ran it


@pytest.fixture(scope="module")
def chapters(tmp_path_factory):
    """A report of two studies that are finished, of one without a chapter, and of none that has only begun."""
    project = Project(tmp_path_factory.mktemp("chapters"))
    run = {**TINY["runs"]["stiff"], "presets": ["as_listed"], "steps": 1000}
    few = {"runs": {"stiff": run}, "figures": {"position": {"draw": "position", "run": "stiff", "title": "Where"}}}
    for name in ("paper", "stability", "tiny", "pair"):
        (project.folder / f"config/{name}.yaml").write_text(yaml.safe_dump({"question": "Why?", **few}))
    files = [f"results/{name}/figures/position.svg" for name in ("stability", "paper", "tiny")]
    (project.folder / "results/pair").mkdir()
    command = [sys.executable, "workflow/run.py", "--cores", "2", *files]
    there = {"cwd": project.folder, "env": project.environment}
    subprocess.run(command, **there, capture_output=True, text=True, check=True)
    report = ("finished", "--report", "results/report.html", *LOOK)
    done = run_module("snakemake", *report, cwd=project.folder, environment=project.environment)
    assert done.returncode == 0, done.stderr
    assert "left out: pair is not finished: make status STUDY=pair" in done.stderr
    return project.folder / "results/report.html"


@pytest.mark.long
def test_the_report_tells_its_chapters_in_order_with_captions_and_figures_and_asks_no_network(chapters, chromium):
    page = chromium.new_page()
    errors, requests = [], []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(chapters.as_uri())
    page.wait_for_selector("nav ul a")
    named = [text.strip() for text in page.locator("nav ul a").all_inner_texts()]
    assert [text for text in named if text[:1].isdigit()] == ["1 Paper", "2 Stability", "7 Other studies"]
    page.get_by_text("2 Stability").click()
    see, about = page.locator("table tbody a").all()[:2]
    about.click()
    page.wait_for_selector("text=Asked in")
    shown = page.inner_text("body")
    for words in (
        "Where (stability).",
        "Asked in config/stability.yaml",
        "results/stability/runs/stiff.as_listed.h5",
    ):
        assert words in shown
    see.click()
    page.wait_for_function(LOADED)  # beside Snakemake's logo, which is smaller
    page.screenshot(path=chapters.with_name("report.png"))
    page.close()
    assert not errors
    assert {url.partition(":")[0] for url in requests} <= {"file", "data", "blob"}
