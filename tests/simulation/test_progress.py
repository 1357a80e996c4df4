"""What loops say of how far they are."""

from __future__ import annotations

import itertools

import pytest

from stiffdice.experiments.dice import coarse_steps, landing, throws
from stiffdice.experiments.measuring import mapped
from stiffdice.scene import die
from stiffdice.scene import scene as scenes
from stiffdice.simulation import progress


@pytest.fixture
def heard():
    found = []
    with progress.told_to(found.append):
        yield found


def test_a_loop_says_after_each_item_how_far_it_is(heard):
    assert list(progress.each("abcd")) == [*"abcd"]
    assert heard == [0.25, 0.5, 0.75, 1.0]


def test_items_count_by_their_work(heard):
    assert list(progress.each([1, 2, 3], [6, 3, 1])) == [1, 2, 3]
    assert heard == pytest.approx([0.6, 0.9, 1.0])


def test_a_loop_within_another_says_how_far_the_outer_one_is(heard):
    for _ in progress.each([1, 2], [1, 3]):
        for _ in progress.each([1, 2]):
            progress.tell(0.5)
    inner = [0.0625, 0.125, 0.1875, 0.25, 0.25]
    assert heard == pytest.approx([*inner, *(0.25 + 3 * part for part in inner)])


def test_after_a_loop_that_was_left_early_others_say_their_own(heard):
    for _ in progress.each([1, 2]):
        break
    assert list(progress.each([1, 2])) == [1, 2]
    assert heard[-2:] == [0.5, 1.0]


def test_nobody_has_to_listen():
    progress.tell(0.5)
    assert list(progress.each([], [])) == []
    assert list(progress.each([1, 2], [1, 2])) == [1, 2]


def test_a_grid_of_values_says_how_far_it_is(heard):
    mapped(lambda a, b: [a * b], {"product": ("product", "1")}, a=[1, 2], b=[3, 4])
    assert heard == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("measure", "options"),
    [
        (landing.measure, {"throws": 200}),
        (
            coarse_steps.measure,
            {"throws": 200, "omega_h": [1.5, 0.9], "finest": 0.6, "paths": 4, "path_omega_h": [1.0]},
        ),
    ],
)
def test_throws_of_dice_say_how_far_they_are(heard, measure, options, monkeypatch):
    monkeypatch.setattr(throws, "_BATCH", 64)
    measure(scenes.from_mapping(die.SCENE), **options)
    assert all(after > before - 1e-9 for before, after in itertools.pairwise(heard))
    assert 0 < heard[0] < 1
    assert heard[-1] == pytest.approx(1)
