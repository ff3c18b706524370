"""The bounds of B90: whom they fire at in a film made by hand, in which order, and who may play
them.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.envs.open_loop import FilmEnv
from care_sim.policies import tags_of
from care_sim.reports.budgets import budgets_table
from care_sim.study.benchmark.bounds import BOUNDS, marginal_gains
from tests.helpers.commands import run
from tests.helpers.handmade_film import (
    AHEAD,
    BEHIND,
    BESIDE,
    BUS,
    WALKER,
    handmade_film,
    returns_of,
)
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, made_budgets

BODIES, SHOWN = BOUNDS


def demanded(entry, budget=0.2):
    """The cells that a bound demands at each of the three keyframes, in its order."""
    with FilmEnv(handmade_film(), budget=budget, detector="centerpoint", floor=False) as env:
        policy = care_sim.make_policy(entry.policy, env)
        observation, _ = env.reset(seed=0)
        policy.reset()
        cells = []
        for _ in range(3):
            observation, *_ = env.step(policy(observation))
            cells.append(policy.demanded.layers[0][0].tolist())
    return cells


def cells_of(numbers, index):
    return {cell for number in numbers for cell in returns_of(number, index).tolist()}


def test_it_fires_at_all_bodies_that_count_now_or_at_the_next_keyframe():
    """The bus enters the range at the third keyframe."""
    told = demanded(BODIES)
    present = [AHEAD], [AHEAD, WALKER, BUS], [AHEAD, WALKER, BESIDE, BEHIND, BUS]
    for index, (cells, numbers) in enumerate(zip(told, present, strict=True)):
        assert {*cells} == cells_of(numbers, index)


def test_boxes_and_tracks_do_not_show_the_person_behind():
    bodies, shown = demanded(BODIES), demanded(SHOWN)
    assert [{*cells} for cells in shown[:2]] == [{*cells} for cells in bodies[:2]]
    assert {*bodies[2]} - {*shown[2]} == cells_of([BEHIND], 2) - cells_of([AHEAD, BUS], 2)


def test_a_newcomer_on_foot_comes_before_a_car_that_is_known():
    _, cells, _ = demanded(BODIES)
    assert {*cells[:2]} <= cells_of([WALKER], 1) | cells_of([BUS], 1)
    assert cells[0] in cells_of([WALKER], 1)


def test_a_bus_that_enters_comes_before_a_person_who_is_known():
    *_, cells = demanded(BODIES)
    bus, person = cells_of([BUS], 2), cells_of([WALKER], 2)
    assert next(cell for cell in cells if cell in bus ^ person) in bus


def test_three_returns_that_a_detector_needs_gain_a_third_each():
    gains = marginal_gains(np.array([0.0, 0.0, 0.0, 0.9, 0.95]))
    assert gains.tolist() == pytest.approx([0.3, 0.3, 0.3, 0.05])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_gains_never_rise_and_add_up_to_all(steps):
    chances = np.cumsum([0.0, *steps])
    gains = marginal_gains(chances)
    assert (np.diff(gains) <= 1e-12).all()
    assert gains.sum() == pytest.approx(chances[-1])
    # Every first few returns together gain at least what they add.
    assert (np.cumsum(gains) >= chances[1:] - 1e-9).all()


@pytest.mark.parametrize("bound", BOUNDS)
def test_nobody_enters_a_bound(bound, capsys, tmp_path):
    assert tags_of(bound.policy) == ("privileged",)
    code, _, err = run(capsys, "benchmark", "--policy", bound.policy, "--out", tmp_path)
    assert code != 0
    assert "knows the truth, and the benchmark plays none" in err


def test_a_bound_stands_in_the_table_by_its_label_without_a_rank():
    told = made_budgets(BODIES, ALWAYS, tags=("privileged",))
    table = budgets_table([told, made_budgets("care-sector", HALF_WAY)])
    assert [row[:2] for row in table.rows] == [
        ("1", "care-sector"),
        ("", "bound: all bodies †"),
    ]
