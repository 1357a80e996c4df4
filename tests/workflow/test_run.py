"""Which studies a command of Snakemake's asks for, as far as `workflow/run.py` has to know."""

from __future__ import annotations

import pytest
from tests.workflow.test_workflow import ROOT


@pytest.mark.parametrize(
    ("words", "studies"),
    [
        ("", ["paper"]),
        ("study", ["paper"]),
        ("study --config study=quick", ["quick"]),
        ("-n --config study=quick", ["quick"]),  # without a target the first rule, `study`, is made
        ("stability --config study=quick", ["stability"]),
        ("results/tosses/tables/fit.md paper", ["paper", "tosses"]),
    ],
)
def test_studies_are_found_by_target_option_and_file(monkeypatch, words, studies):
    monkeypatch.syspath_prepend(ROOT / "workflow/scripts")
    monkeypatch.syspath_prepend(ROOT / "workflow")
    import run

    assert run.asked_for(words.split()) == studies
