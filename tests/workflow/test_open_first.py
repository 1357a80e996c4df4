"""What is named as the first to open, once a study is made."""

from __future__ import annotations

import pytest
from tests.workflow.test_workflow import ROOT


@pytest.fixture
def ending(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "workflow")
    import ending

    return ending


@pytest.fixture
def project(tmp_path):
    (tmp_path / "config").symlink_to(ROOT / "config")
    return tmp_path


def made(project, *names):
    for name in names:
        path = project / "results" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


@pytest.mark.parametrize(
    ("study", "figure"),
    [
        ("paper", "figure-13.svg (Figure 13: steps needed against stiffness)"),
        ("quick", "frontier.svg (Steps needed against stiffness)"),
        ("stability", "map-sliding.svg (Where a sliding cube passes)"),
        ("extremes", "failure-map.svg (Where and how runs fail"),
        ("tradeoff", "evaluations-position.svg (Error of the position against force evaluations)"),
        ("refinement", "refinement.svg (A cube that slides: the dense grid's answer"),
        ("shapes", "ends.svg (How often a square box (a, a, c) lands on one of its ends"),
        ("pair-engines", "peers.svg (Two boxes in contact: what users of other engines complained of"),
        ("engines", "limits.svg (One flat bounce with longer and longer steps"),
    ],
)
def test_the_first_figure_that_shows_more_than_single_runs(ending, project, study, figure):
    made(project, f"{study}/figures/figure-01.svg", f"{study}/figures/{figure.partition(' ')[0]}")
    assert ending.open_first(project, study).startswith(f"open first: results/{study}/figures/{figure}")


def test_only_what_is_there_is_named(ending, project):
    assert ending.open_first(project, "paper") == ""
    made(project, "paper/figures/throw.gif")
    title = "The throw of figures 1 to 3, as listed"
    assert ending.open_first(project, "paper") == f"open first: results/paper/figures/throw.gif ({title})"


def test_a_table_where_no_figure_is(ending, project):
    table = "stability/tables/paper-questions.md"
    made(project, table)
    assert ending.open_first(project, "stability").startswith(f"open first: results/{table} (")
