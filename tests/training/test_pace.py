"""The estimate of what is left: none from the first round, then that of whole rounds."""

import pytest

from care_sim.training.run import Pace

COMPILING_S = 60.0
ACTING_S, LEARNING_S = 1.0, 3.0
ROUND = 1000


def moments(rounds):
    """(steps, updates, seconds) at every tenth of rounds of acting, after each of which a learner
    learns; the first one compiles.
    """
    seconds, each = COMPILING_S, []
    for number in range(rounds):
        for tenth in range(1, 11):
            seconds += ACTING_S / 10
            each.append((number * ROUND + tenth * ROUND // 10, 4 * number, seconds))
        seconds += LEARNING_S
    return each


def test_nothing_is_said_before_a_whole_round_is_known_and_then_what_comes_true():
    pace = Pace(100 * ROUND)
    told = {steps: pace.told(steps, updates, s) for steps, updates, s in moments(4)}
    # The second round's update shows at the first steps of the third.
    assert {told[steps] for steps in told if steps <= 2 * ROUND} == {""}
    # 4 s a round are 250 steps a second; 97.9 rounds are left, which is 392 s.
    assert told[2100] == told[2400] == "250 steps/s, 7 min left"
    assert told[3100] == "250 steps/s, 6 min left"


def test_a_learner_that_learns_after_every_step_is_known_after_a_second_of_it():
    """Which acts faster until it begins to learn: 100 steps in a second, then 10."""
    pace = Pace(1000)
    told = {
        step: pace.told(step, max(0, step - 100), min(step, 100) / 100 + max(0, step - 100) / 10)
        for step in range(1, 200)
    }
    assert {told[step] for step in range(1, 111)} == {""}
    assert told[150] == "10 steps/s, 85 s left"


@pytest.mark.parametrize("done", [1000, 1200])
def test_beyond_the_last_step_nothing_is_left(done):
    pace = Pace(1000)
    for number in range(3):
        pace.told(100 * number, number, float(number))
    assert pace.told(done, 3, 10.0).endswith(" 0 s left")
