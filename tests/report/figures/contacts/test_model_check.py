from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from stiffdice.advice.model_check import LADDER, Check, Contact, Rung, Span, Verdict
from stiffdice.report.figures import style
from stiffdice.report.figures.contacts import model_check
from stiffdice.simulation.engines.mjcf.model import Model


def contact(name, energy, verdicts=()):
    """Return a contact whose restitution is the root of its energy, at all time steps."""
    span = Span(*[energy**0.5] * 3)
    rungs = tuple(Rung(0.001 * k, 0.1 * k, span, span, energy, 0.01, 0.01) for k in LADDER)
    return Contact(SimpleNamespace(names=(name, "floor")), SimpleNamespace(), 1.0, 0.01, rungs, verdicts)


def drawn(*contacts):
    compiled = SimpleNamespace(opt=SimpleNamespace(timestep=0.001))
    with style.applied():
        return model_check.draw(Check(Model(Path("a.xml"), "", (), compiled), contacts, (), 0), {}, "a title")


def test_it_shows_restitution_energy_and_the_models_own_step():
    figure = drawn(contact("a", 0.25), contact("b", 4.0))
    left, right = figure.axes
    heights = [line.get_ydata()[0] for line in left.lines if len(line.get_xdata()) == len(LADDER)]
    assert heights == pytest.approx([0.5, 0.5, 2.0, 2.0])  # measured and predicted, of either
    assert right.lines[0].get_ydata() == pytest.approx([0.25] * 7)
    assert right.lines[1].get_ydata() == pytest.approx([4.0] * 7)
    own = [line for line in left.lines if list(line.get_xdata()) == [0.001, 0.001]]
    assert len(own) == 1
    assert [text.get_text() for text in figure.legends[0].get_texts()][:2] == ["a on floor", "b on floor"]


def test_what_has_a_verdict_is_shown_first_and_what_blew_up_at_the_edge():
    fine = [contact(f"fine {k}", 0.25) for k in range(5)]
    figure = drawn(*fine, contact("bad", float("inf"), (Verdict("gains_energy", "will gain energy"),)))
    assert figure.legends[0].get_texts()[0].get_text() == "bad on floor"
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx([1e3] * 7)
    assert "1 more not shown" in figure.get_suptitle()
