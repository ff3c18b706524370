"""Every reason by hand: an object that returns in the cells 10 to 15, of which three are needed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.allocation import allocate
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.evaluation.rays import (
    ELSEWHERE,
    EXPLAINED,
    MISS_REASONS,
    NOT_DEMANDED,
    NOT_IN_PICTURE,
    STARVED,
    TOO_FEW_RETURNS,
    Appearance,
    ServedDemand,
    miss_reason,
)

OBJECT = np.arange(10, 16)
WEDGE = np.array([3, 4, 5, 6, 10, 11, 12, 13, 14, 15])
"""Its upper margin comes first."""
HULL = np.array([20, 21, 22])
BESIDE = np.array([24, 25, 26])
NOTHING = np.array([], np.int64)


def seen(*explained, wedge=WEDGE, returns=OBJECT, tracked=False):
    """An object with an image box for each mark, which says whether a forecast explains it."""
    return Appearance(returns, (wedge,) * len(explained), np.array(explained, bool), tracked)


def reason(appearance, demand, budget, floor=NOTHING):
    fired = allocate(demand, budget, 0.3, floor)
    return miss_reason(appearance, ServedDemand.of(demand, fired, Rig(budget=budget)), 3)


CASES = {
    "outside the pictures": (seen(), Demand([HULL]), 6, NOT_IN_PICTURE),
    "its only box is explained": (seen(True), Demand([HULL], [[BESIDE]]), 6, EXPLAINED),
    "one of two boxes is not": (seen(True, False), Demand([HULL]), 6, NOT_DEMANDED),
    "a policy without camera": (seen(False), Demand(), 6, NOT_DEMANDED),
    # 6 of 8 cells for exploitation, which needs 3; then the wedges take turns, 2 cells each.
    "two cells of the wedge": (
        seen(False), Demand([HULL], [[WEDGE, BESIDE]]), 7, STARVED,
    ),
    "five cells, four of the margin": (seen(False), Demand([HULL], [[WEDGE]]), 8, ELSEWHERE),
    "three of the wedge, all of the margin": (seen(False), Demand([HULL], [[WEDGE]]), 6, ELSEWHERE),
    "exploitation is cut off, too": (seen(), Demand([OBJECT, HULL]), 2, STARVED),
    "the wedge lies beside it": (
        seen(False, wedge=BESIDE), Demand([HULL], [[BESIDE]]), 6, TOO_FEW_RETURNS,
    ),
    "an explained box, asked for all the same": (
        seen(True, wedge=BESIDE), Demand([], [[BESIDE]]), 6, TOO_FEW_RETURNS,
    ),
    "rays enough, and not detected": (seen(), Demand([OBJECT]), 10, TOO_FEW_RETURNS),
    "two returns in all": (seen(returns=OBJECT[:2]), Demand(), 6, TOO_FEW_RETURNS),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_each_reason_by_hand(case):
    appearance, demand, budget, expected = CASES[case]
    assert reason(appearance, demand, budget) == expected


def test_rows_of_a_pattern_that_the_budget_cuts_off_are_starved():
    """Two cells of the object in each row: the first row is fired whole, the second not at all."""
    rows = [[np.array([8, 9, 10, 11])], [np.array([12, 13, 30, 31])]]
    assert reason(seen(), Demand(layers=rows), 4) == STARVED


def test_a_large_set_that_holds_one_cell_does_not_hide_that_its_own_wedge_starved():
    """A neighbour's hull got six cells, and owes one of the object's; the wedge owes six."""
    neighbour = np.array([40, 41, 42, 43, 44, 45, 10, 46])
    assert reason(seen(False), Demand([neighbour], [[WEDGE]]), 9) == ELSEWHERE
    assert reason(seen(False), Demand([neighbour], [[WEDGE]]), 7) == STARVED


def test_rays_of_the_floor_count():
    """Two cells of the wedge and one of the floor would have been enough."""
    assert reason(seen(False), Demand(), 3, floor=OBJECT) == TOO_FEW_RETURNS
    assert reason(seen(False), Demand(), 2, floor=OBJECT) == NOT_DEMANDED


def test_falsely_explained_is_what_forecasts_of_others_alone_explain():
    assert seen(True).falsely_explained
    assert seen(True, True).falsely_explained
    assert not seen(True, False).falsely_explained
    assert not seen(True, tracked=True).falsely_explained
    assert not seen().falsely_explained


@st.composite
def situations(draw):
    some = st.lists(st.integers(0, 19), max_size=6, unique=True).map(
        lambda numbers: np.array(numbers, np.int64)
    )
    sets = st.lists(some, max_size=3)
    boxes = draw(sets)
    marks = np.array([draw(st.booleans()) for _ in boxes], bool)
    appearance = Appearance(draw(some), tuple(boxes), marks)
    return appearance, Demand(draw(sets), draw(st.lists(sets, max_size=2))), draw(st.integers(0, 9))


@given(situations())
def test_a_miss_has_one_reason_and_the_budget_is_blamed_only_where_more_of_it_would_have_helped(
    situation,
):
    appearance, demand, budget = situation
    told = reason(appearance, demand, budget)
    assert told in MISS_REASONS
    # With a budget for everything that is asked, as many returns come as there are to be had.
    hits = np.isin(appearance.returns, allocate(demand, 1000, 0.3)).sum()
    if told in (STARVED, ELSEWHERE):
        assert hits >= 3
    elif told != TOO_FEW_RETURNS:
        assert hits < 3
