"""B90 by hand: crossings with known answers, what is enough, and paired draws of worlds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.evaluation import smallest_budget as module
from care_sim.evaluation.counts import AVOIDED, EPISODE_COUNTS
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    PartCounts,
    budget_ratio,
    names_of,
    reaching,
    resampled_budgets,
    shares,
    smallest_budget,
)

WHOLE = 100.0
LEVELS = st.lists(st.integers(0, 110), min_size=7, max_size=7)


def one_world(*curves, full=WHOLE, names="abcdefgh"):
    """Counts of a world in which each curve has these percents of the full scan at the budgets."""
    got = np.array(curves, float).T[None] * full / WHOLE
    return [PartCounts(tuple(names[: len(curves)]), got, np.full((1, len(curves)), full))]


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        # Exactly 90% is enough; between 2% and 3% half way is the geometric mean.
        ([10, 20, 80, 90, 95, 100, 100], 0.03),
        ([10, 20, 80, 100, 100, 100, 100], math.sqrt(0.02 * 0.03)),
        ([0, 30, 150, 150, 150, 150, 150], 0.01 * 2**0.5),
        # Reached at the smallest budget, at the largest one alone, never.
        ([90, 95, 95, 95, 95, 95, 95], 0.005),
        ([0, 0, 0, 0, 0, 0, 90], 0.2),
        ([0, 0, 0, 0, 0, 80, 89.9], math.inf),
        # It falls below again: the last crossing counts, and a fall at the end is never.
        ([10, 95, 95, 80, 100, 100, 100], math.sqrt(0.03 * 0.05)),
        ([95, 95, 95, 95, 95, 95, 85], math.inf),
        ([95, 80, 95, 95, 95, 95, 95], 0.01 * 2 ** (10 / 15)),
    ],
)
def test_crossings_of_90_percent(curve, expected):
    assert reaching(one_world(curve)) == pytest.approx([expected])


def test_the_count_that_is_last_is_the_score():
    early, late = [95] * 7, [10, 20, 80, 90, 95, 100, 100]
    score = smallest_budget(one_world(early, late, early))
    assert score == (pytest.approx(0.03),) * 3
    never = smallest_budget(one_world(late, [0] * 7))
    assert never == (math.inf,) * 3


def test_every_object_weighs_alike():
    """All of 9 objects in one world and none of 1 in another are detected: 90% of 10."""
    got = np.array([np.full((7, 1), 9.0), np.zeros((7, 1))])
    part = PartCounts(("kept",), got, np.array([[9.0], [1.0]]))
    assert shares([part]).tolist() == [[0.9]] * 7
    score = smallest_budget([part])
    # Half of the draws have one world of each, a quarter the second one alone.
    assert (score.budget, score.low, score.high) == (0.005, 0.005, math.inf)


def test_every_part_draws_worlds_of_its_own():
    """Two worlds as above are enough in three of four draws, two such parts in 9 of 16."""
    got = np.array([np.full((7, 1), 9.0), np.zeros((7, 1))])
    part = PartCounts(("kept",), got, np.array([[9.0], [1.0]]))
    for parts, enough in (([part], 3 / 4), ([part, part], 9 / 16)):
        assert np.isfinite(resampled_budgets(parts)).mean() == pytest.approx(enough, abs=0.02)


def test_needless_stops_may_be_five_in_a_hundred_more():
    avoided = np.full((100, 7, 1), 1.0)
    stops = np.zeros((100, 7, 1))
    for budget, number in enumerate((20, 12, 8, 7, 6, 4, 1)):
        stops[:number, budget] = 1.0
    full = np.zeros((100, 2))
    full[:, 0], full[:2, 1] = 1.0, 1.0
    part = PartCounts(EPISODE_COUNTS, np.concatenate([avoided, stops], axis=2), full)
    # Two of the full scan's and five more are enough: 7 at 3%.
    assert reaching([part]) == pytest.approx([0.005, 0.03])
    assert shares([part])[0].tolist() == pytest.approx([1.0, -0.18])


def test_parts_have_worlds_of_their_own():
    streets = one_world([10, 20, 80, 90, 95, 100, 100])
    drives = [PartCounts((AVOIDED,), np.ones((3, 7, 1)), np.ones((3, 1)))]
    both = [*streets, *drives]
    assert names_of(both) == ("a", AVOIDED)
    assert reaching(both) == pytest.approx([0.03, 0.005])


def test_what_a_full_scan_has_none_of_asks_nothing():
    counts = one_world([0] * 7, full=0.0)
    assert np.isnan(shares(counts)).all()
    assert smallest_budget(counts).budget == BUDGETS[0]


def drawn_counts(seed, worlds=12, shift=0.0):
    rng = np.random.default_rng(seed)
    full = rng.poisson(5, (worlds, 2)) + 1.0
    curve = np.array([0.5, 0.7, 0.85, 0.92, 0.95, 0.99, 1.0])[None, :, None] - shift
    noise = rng.normal(0, 0.05, (worlds, 7, 2))
    return [PartCounts(("a", "b"), full[:, None] * np.clip(curve + noise, 0, 1), full)]


def test_intervals_are_those_of_worlds_drawn_one_by_one(monkeypatch):
    """The same draws, counted by a loop over worlds."""
    monkeypatch.setattr(module, "RESAMPLES", 50)
    module._drawn.cache_clear()
    (part,) = counts = drawn_counts(1)
    budgets = []
    for weights in module._drawn(0, 12):
        rows = np.repeat(np.arange(12), weights.astype(int))
        assert len(rows) == 12
        budgets.append(reaching([PartCounts(part.names, part.got[rows], part.full[rows])]).max())
    assert module.resampled_budgets(counts) == pytest.approx(budgets)
    low, high = np.quantile(budgets, (0.025, 0.975), method="inverted_cdf")
    assert smallest_budget(counts)[1:3] == pytest.approx((low, high))
    module._drawn.cache_clear()


def test_draws_of_worlds_are_the_same_in_every_process():
    scores = []
    for _ in range(2):
        module._drawn.cache_clear()
        scores.append(smallest_budget(drawn_counts(3)))
    assert scores[0] == scores[1]
    assert scores[0].low < scores[0].budget < scores[0].high


def test_rounding_takes_nothing_off_a_share_of_90_percent():
    full = np.arange(1, 200)[:, None] * 0.1
    for world in full:
        got = np.broadcast_to(0.9 * world, (1, 7, 1))
        assert reaching([PartCounts(("kept",), got, world[None])]) == [0.005]


def test_a_ratio_is_paired():
    """An entry that is as good as another at 1.5 times the budget, in every world alike."""
    (good,) = drawn_counts(2)
    logs = np.log(BUDGETS)
    got = np.empty_like(good.got)
    for world, name in np.ndindex(len(got), 2):
        own = good.got[world, :, name]
        got[world, :, name] = np.interp(logs - math.log(1.5), logs, own)
    late = [PartCounts(good.names, got, good.full)]
    ratio, low, high = budget_ratio(late, [good])
    assert ratio == pytest.approx(1.5, rel=0.06)
    assert 1.3 < low <= ratio <= high < 1.7
    # Differences between worlds widen the interval of each alone, and not that of the ratio.
    ours, theirs = smallest_budget(late), smallest_budget([good])
    assert (high - low) < 0.5 * (ours.high / theirs.low - ours.low / theirs.high)
    assert budget_ratio([good], [good]) == (1.0, 1.0, 1.0)


def test_entries_that_never_get_there_are_tied():
    never, sometimes = one_world([0] * 7), one_world([0, 0, 0, 0, 0, 0, 90])
    assert budget_ratio(never, never) == (1.0, 1.0, 1.0)
    assert budget_ratio(never, sometimes) == (math.inf, math.inf, math.inf)
    assert budget_ratio(sometimes, never) == (0.0, 0.0, 0.0)


def test_a_ratio_of_other_worlds_is_refused():
    with pytest.raises(InvalidInput, match="same worlds"):
        budget_ratio(drawn_counts(1), drawn_counts(1, worlds=11))


@pytest.mark.parametrize(
    ("got", "full"),
    [
        (np.zeros((2, 6, 1)), np.zeros((2, 1))),
        (np.zeros((2, 7, 1)), np.zeros((3, 1))),
        (np.zeros((0, 7, 1)), np.zeros((0, 1))),
        (np.full((2, 7, 1), np.nan), np.zeros((2, 1))),
        (np.zeros((2, 7, 1)), -np.ones((2, 1))),
    ],
)
def test_counts_that_do_not_fit_are_refused(got, full):
    with pytest.raises(InvalidInput, match="counts must be"):
        PartCounts(("a",), got, full)


@given(LEVELS, st.integers(0, 6), st.integers(1, 50))
def test_a_better_count_never_needs_more_and_from_there_on_it_holds(curve, place, more):
    worse = reaching(one_world(curve))[0]
    better = list(curve)
    better[place] += more
    assert reaching(one_world(better))[0] <= worse * (1 + 1e-12)
    held = [level >= 90 for budget, level in zip(BUDGETS, curve, strict=True) if budget >= worse]
    assert all(held)


@given(LEVELS, st.floats(0.5, 1000))
def test_how_many_there_are_does_not_matter(curve, full):
    assert reaching(one_world(curve, full=full)) == pytest.approx(reaching(one_world(curve)))
