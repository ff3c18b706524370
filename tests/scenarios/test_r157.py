"""Cut-ins of UN Regulation 157: the grid against the public ALKS scenario, verdicts and worlds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.driving.drivers import HUMAN_MODEL as HUMAN
from care_sim.scenarios import make_scenario
from care_sim.scenarios.r157 import (
    GAP_STEP_M,
    KINDS,
    RELATIVE_KPH,
    SIDES,
    CutInCase,
    cases,
    kinds_in_turn,
    verdicts,
)
from care_sim.world.bodies import CATALOGUE


@pytest.mark.parametrize(
    ("case", "possible"),
    [
        (CutInCase(20, 10, 10, 2.7), True),
        (CutInCase(20, 11, 10, 2.0), False),  # 9 km/h
        (CutInCase(20, 10, 10, 2.8), False),  # as fast across as along
        (CutInCase(60, 36, 60, 1.0), True),
        (CutInCase(60, 36, 60.1, 1.0), False),  # more than 6 s
    ],
)
def test_what_is_possible(case, possible):
    assert case.possible is possible


def test_every_combination_once_and_all_kinds_and_sides_alike():
    grid = kinds_in_turn()
    numbers = [(case.ego_kph, case.relative_kph, case.gap_m, case.lateral_mps) for case in grid]
    assert len({*numbers}) == len(numbers) == len(cases()) == 587
    shares = [
        sum((case.kind, case.side) == (kind, side) for case in grid)
        for kind in KINDS
        for side in SIDES
    ]
    assert max(shares) - min(shares) <= 1


EGO_LENGTH, EGO_WIDTH, _ = CATALOGUE["ego"].size
STEP_S = 0.001


def case(relative_kph, gap_m, lateral_mps, kind="car"):
    return CutInCase(60.0, relative_kph, gap_m, lateral_mps, kind)


def verdict(*values, **kind):
    (word,) = verdicts([case(*values, **kind)])
    return word


def simulated(cut_in, never_brakes):
    """Whether boxes overlap, driver and vehicles stepped on by a millisecond for 40 s."""
    gap, closing, side_m = cut_in.gap_m, cut_in.relative_kph / 3.6, HUMAN.lane_m
    deviating_s = danger_s = 0.0
    acceleration = 0.0
    in_danger = False
    for _ in range(round(40 / STEP_S)):
        side_m = max(side_m - cut_in.lateral_mps * STEP_S, 0.0)
        deviating_s += STEP_S if HUMAN.lane_m - side_m > HUMAN.wander_m else 0.0
        ahead = gap > -cut_in.length_m
        near = gap <= closing * HUMAN.danger_s
        in_danger |= deviating_s >= HUMAN.evaluation_s and ahead and near and not never_brakes
        danger_s += STEP_S if in_danger else 0.0
        if danger_s > HUMAN.delay_s:
            acceleration = min(acceleration + HUMAN.jerk_mps3 * STEP_S, HUMAN.brake_mps2)
        closing = max(closing - acceleration * STEP_S, 0.0)
        gap -= closing * STEP_S
        beside = side_m < (EGO_WIDTH + cut_in.width_m) / 2
        if beside and -(EGO_LENGTH + cut_in.length_m) < gap < 0:
            return True
        if side_m == closing == 0.0 or gap < -(EGO_LENGTH + cut_in.length_m):
            return False
    return False


@given(
    relative_kph=st.floats(5, 50),
    ttc_s=st.floats(0.2, 6),
    lateral_mps=st.floats(0.4, 3),
    kind=st.sampled_from(KINDS),
)
@settings(max_examples=40)
def test_the_closed_form_says_what_small_steps_say(relative_kph, ttc_s, lateral_mps, kind):
    cut_in = case(relative_kph, ttc_s * relative_kph / 3.6, lateral_mps, kind)
    word = verdicts([cut_in])[0]
    # Where 2 cm decide, a millisecond's step may be on the other side.
    near = [
        verdicts([case(relative_kph, cut_in.gap_m + off, lateral_mps, kind)])[0]
        for off in (-0.02, 0.02)
    ]
    if near == [word, word]:
        assert simulated(cut_in, never_brakes=True) == (word != "harmless")
        if word != "harmless":
            assert simulated(cut_in, never_brakes=False) == (word == "unpreventable")


def test_a_boundary_by_hand():
    """36 km/h slower, 1 m/s across: perceived after 0.375 + 0.4 s, braking 0.75 s later. From there
    1.52 m are saved while the deceleration grows, and 7.59 m/s^2 take the rest of the 10 m/s.
    """
    brake, ramp = HUMAN.brake_mps2, 0.6
    begun = 0.375 + 0.4 + 0.75
    left = 10 - brake * ramp / 2
    grows = 10 * ramp - brake * ramp**2 / 6
    boundary = 10 * begun + grows + left**2 / (2 * brake)
    assert verdict(36.0, boundary + 0.01, 1.0) == "preventable"
    assert verdict(36.0, boundary - 0.01, 1.0) == "unpreventable"


def test_an_ego_that_passes_before_the_sides_meet_is_not_touched():
    """The sides meet after 1.66 m at 0.5 m/s: by then 10 m/s have carried the ego 33 m on."""
    meeting_s = (3.5 - (EGO_WIDTH + CATALOGUE["car"].size[1]) / 2) / 0.5
    passed = 10 * meeting_s - EGO_LENGTH - CATALOGUE["car"].size[0]
    assert verdict(36.0, passed - 0.01, 0.5) == "harmless"
    assert verdict(36.0, passed + 0.01, 0.5) == "unpreventable"


def build(seed=0, **parameters):
    return make_scenario("r157", **parameters).build(np.random.default_rng(seed))


def driven_on(world, seconds):
    """The least clearance, and whether the ego, which never brakes, touched anything."""
    passage = world.advance(0.0, seconds)
    return passage.clearance_m, passage.impact_speed_mps is not None


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_world_is_the_case(kind, side):
    """At the begin of the lane change the bumpers are 25 m apart; 1.5 s later the other has moved
    1.5 m across, and the ego, 10 m/s faster, is 15 m nearer.
    """
    world = build(
        ego_kph=57.6, relative_kph=36.0, gap_m=25.0, lateral_mps=1.0, kind=kind, side=side,
        lead_s=(1.0, 1.0),
    )  # fmt: skip
    other, turn = world.first_sighting, 1 if side == "left" else -1
    half_lengths = (world.ego_kind.size[0] + other.kind.size[0]) / 2
    assert (other.kind.name, world.ego_motion.speed) == (kind, pytest.approx(16.0))
    for seconds, gap, y in ((0.0, 35.0, 3.5), (1.0, 25.0, 3.5), (2.5, 10.0, 2.0), (6.0, -25.0, 0)):
        if seconds > world.time:
            world.advance(0.0, seconds - world.time)
        x, other_y, heading = other.pose_at(world.time)
        assert x - world.ego.pose[0] - half_lengths == pytest.approx(gap, abs=1e-6)
        assert (other_y, heading) == (pytest.approx(turn * y), 0.0)
    world.close()


@pytest.mark.parametrize("side", SIDES)
def test_an_ego_that_never_brakes_is_touched_unless_the_case_is_harmless(side):
    for gap_m in (5.0, 15.0, 25.0, 40.0):
        numbers = {"ego_kph": 60.0, "relative_kph": 40.0, "gap_m": gap_m, "lateral_mps": 0.5}
        axes = {name: [value] for name, value in numbers.items()}
        (word,) = verdicts(cases(**axes, kind="car", side=side))
        world = build(**numbers, kind="car", side=side)
        _, touched = driven_on(world, 10.0)
        world.close()
        assert touched == (word != "harmless")
        assert (word == "harmless") == (gap_m <= 25)


def test_a_world_tells_what_was_drawn_of_its_case():
    world = build(seed=3)
    case = make_scenario("r157").draw_case(np.random.default_rng(3))
    assert world.drawn == vars(case)
    world.close()
    world = build(seed=3, kind="van", ego_kph=60.0)
    assert set(world.drawn) == {"relative_kph", "gap_m", "lateral_mps", "side"}
    given = {"kind": "van", "ego_kph": 60.0} | dict(world.drawn)
    world.close()
    world = build(seed=3, **given)
    assert world.drawn == {}
    world.close()


def test_what_is_not_given_is_drawn_among_the_preventable_cases():
    drawn = [make_scenario("r157").draw_case(np.random.default_rng(seed)) for seed in range(200)]
    assert {*verdicts(drawn)} == {"preventable"}
    assert {case.kind for case in drawn} == {*KINDS}
    assert {case.side for case in drawn} == {*SIDES}
    assert len({*drawn}) > 150


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"ego_kph": 5.0}, r"ego_kph of r157 must lie in \[10.1, 130\], got 5.0"),
        ({"gap_m": "near"}, "gap_m of r157 must lie in"),
        ({"kind": "tram"}, "unknown kind of r157 'tram'; known: bus, car, motorcycle, truck, van"),
        ({"side": "above"}, "unknown side of r157 'above'; known: left, right"),
        (
            {"ego_kph": 20.0, "relative_kph": 15.0},
            "no cut-in of r157 has these speeds and this gap: the other must drive at least",
        ),
        ({"relative_kph": 10.0, "gap_m": 60.0}, "be reached in 6 s"),
    ],
)
def test_impossible_cases_are_refused_in_one_line(parameters, line):
    with pytest.raises(InvalidInput, match=line):
        make_scenario("r157", **parameters)


def test_of_cars_the_careful_human_agrees_with_the_regulations_short_form():
    """Paragraph 5.2.5.2: the lateral movement has been visible for 0.72 s, and at the lane
    intrusion, when the side of the vehicle crosses a line 0.3 m beyond the marking, the time to
    collision is above v_rel / (2 * 6 m/s^2) + 0.35 s. At 1 m/s both are within a step of the gap.
    """
    fine_m = np.arange(0.1, 90.0, 0.1)
    for relative_kph in RELATIVE_KPH:
        made = [case(relative_kph, gap, 1.0) for gap in fine_m]
        closing = relative_kph / 3.6
        intrusion_s = (HUMAN.lane_m - made[0].width_m) / 2 + 0.3
        assert intrusion_s > 0.72
        least_m = closing * (intrusion_s + closing / 12 + 0.35)
        assert abs(fine_m[verdicts(made).index("preventable")] - least_m) <= GAP_STEP_M
