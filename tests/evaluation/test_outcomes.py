"""Results of episodes and drives, from keyframes made by hand; scores of collisions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.evaluation.outcomes import collision_outcome, drive_outcome_of, outcome, score
from care_sim.loops.records import Keyframe, Outcome, Records, Sight
from care_sim.world.approach import Impact
from care_sim.world.motions import Crosser, Meeting, Walk

NO_IMPACT = (False, None, None, None)
"""No brake for nothing, and no contact."""


def quiet_keyframe(index=0, **changes):
    quiet = {
        "time_s": index / 10, "fired": np.arange(100), "speed_mps": 8.0, "impact_speed_mps": None,
        "in_view": False, "detected": False, "braking": False,
        "distance_m": 30.0 - index, "nearest_m": 30.0 - index, "clearance_m": 25.0 - index,
    }  # fmt: skip
    return Keyframe(index=index, **{**quiet, **changes})


def test_an_episode_worked_by_hand():
    episode = [
        quiet_keyframe(0, nearest_m=1.0, clearance_m=0.1),
        quiet_keyframe(1, in_view=True, nearest_m=9.0, clearance_m=7.5),
        quiet_keyframe(
            2,
            in_view=True,
            detected=True,
            distance_m=14.4,
            braking=True,
            nearest_m=8.0,
            clearance_m=6.0,
        ),
        quiet_keyframe(
            3,
            detected=True,
            distance_m=12.0,
            braking=True,
            nearest_m=5.5,
            clearance_m=3.25,
            fired=np.arange(7),
        ),
        quiet_keyframe(4, in_view=True, nearest_m=6.0, clearance_m=4.0),
    ]
    assert outcome(episode) == Outcome(14.4, None, True, 5.5, 3.25, False, None, 407, *NO_IMPACT)


def test_a_missed_actor_is_censored_at_the_nearest_scan_since_it_came_into_view():
    passing = [
        quiet_keyframe(n, in_view=n in (1, 2), distance_m=d)
        for n, d in enumerate([5.0, 20.0, 12.0, 15.0])
    ]
    assert (outcome(passing).detection_distance_m, outcome(passing).undetected_to_m) == (None, 12.0)
    assert outcome([*passing, quiet_keyframe(4, detected=True)]).undetected_to_m is None


def test_the_first_contact_gives_the_impact_speed():
    result = outcome(
        [
            quiet_keyframe(0),
            quiet_keyframe(1, impact_speed_mps=3.5),
            quiet_keyframe(2, impact_speed_mps=2.0),
        ]
    )
    assert (result.collision, result.impact_speed_mps) == (True, 3.5)


def test_without_an_actor_nobody_could_be_detected():
    result = outcome([quiet_keyframe(0, distance_m=np.inf), quiet_keyframe(1, distance_m=np.inf)])
    assert (result.detection_distance_m, result.undetected_to_m) == (None, None)


KINDS = {4: "child", 5: "bicycle", 6: "car"}


def meeting(body, course, went):
    crosser = Crosser(Walk((0.0, 0.0), 0.0, 1.0, 1.0, 1.0), 1.0, lambda _walk: True)
    crosser.went = went
    return Meeting(body, KINDS[body], "right", 50.0, "turn", course, "van", True, crosser)


def keyframe(index, sights, impact=None, needless=False):
    return Keyframe(
        index=index,
        time_s=index / 10,
        fired=np.arange(100),
        in_view=False,
        detected=False,
        braking=needless,
        speed_mps=8.0,
        distance_m=30.0 - index,
        nearest_m=30.0,
        clearance_m=30.0,
        impact_speed_mps=impact.speed_mps if impact else None,
        impact=impact,
        sights=tuple(Sight(*sight) for sight in sights),
        needless=needless,
    )


MEETINGS = [meeting(4, "conflict", True), meeting(5, "stop", None)]
FRAMES = [
    keyframe(0, [(30.0, False, False), (70.0, False, False)]),
    keyframe(1, [(29.0, True, False), (69.0, False, False)], needless=True),
    keyframe(2, [(28.0, True, True), (68.0, False, False)]),
    keyframe(3, [(27.0, True, True), (67.0, False, False)], needless=True),
]


def drive_outcome(frames, meetings, progress):
    """The result of a drive with these keyframes."""
    sights = [frame.sights for frame in frames]
    return drive_outcome_of(Records.of(frames), frames[-1].impact, sights, meetings, progress)


def test_each_encounter_has_its_first_view_and_detection():
    result = drive_outcome(FRAMES, MEETINGS, 0.4)
    first, second = result.encounters
    assert (first.view_keyframe, first.detection_keyframe, first.detection_distance_m) == (
        1,
        2,
        28.0,
    )
    assert (second.view_keyframe, second.detection_keyframe) == (None, None)
    assert second.detection_distance_m is None
    assert (first.set_off, second.set_off) == (True, False)
    assert (first.hit, second.hit) == (False, False)
    assert (first.who, first.way, first.course) == ("child", "turn", "conflict")
    assert first.occluder_reported


def test_a_drive_without_a_collision():
    result = drive_outcome(FRAMES, MEETINGS, 1.02)
    assert (result.collision, result.hit_kind, result.hit_at_front, result.hit_standing) == (
        False,
        None,
        None,
        None,
    )
    assert result.needless_braking == 2
    assert result.progress == 1.0


@pytest.mark.parametrize("body", [4, 6])
def test_a_collision_says_who_and_how(body):
    last = keyframe(
        4, [(2.0, True, True), (66.0, False, False)], Impact(body, 3.0, True, KINDS[body], 3.5)
    )
    result = drive_outcome([*FRAMES, last], MEETINGS, 0.5)
    assert (result.hit_kind, result.hit_at_front, result.hit_standing) == (KINDS[body], True, False)
    assert [one.hit for one in result.encounters] == [body == 4, False]
    assert (result.collision, result.impact_speed_mps) == (True, 3.0)
    assert result.closing_speed_mps == 3.5


def test_a_standing_car_that_is_run_into():
    last = keyframe(
        4, [(2.0, True, True), (66.0, False, False)], Impact(4, 0.0, False, "child", 2.0)
    )
    result = drive_outcome([*FRAMES, last], MEETINGS, 0.5)
    assert (result.hit_at_front, result.hit_standing) == (False, True)


SPEEDS = st.floats(0.1, 60.0)


@pytest.mark.parametrize(
    ("impact", "expected"),
    [
        (None, 5.0),
        (0.0, 4.0),
        (2.5, 3.0),
        (5.0, 2.0),
        (10.0, 0.0),
        (10.2, 0.0),
    ],
)
def test_the_score_falls_from_four_to_nothing_with_the_speed_of_the_impact(impact, expected):
    assert score(impact, 10.0) == pytest.approx(expected)


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_slower_impact_never_scores_less(one, other, reference):
    slow, fast = sorted((one, other))
    assert 0.0 <= score(fast, reference) <= score(slow, reference) <= 4.0 < score(None, reference)


@pytest.mark.parametrize(
    ("impact_kph", "outcome"),
    [
        (None, "avoided"),
        (0.0, "mitigated"),
        (48.9, "mitigated"),
        (49.1, "hit"),
        (50.0, "hit"),
    ],
)
def test_a_kilometre_per_hour_is_no_mitigation(impact_kph, outcome):
    impact_mps = None if impact_kph is None else impact_kph / 3.6
    assert collision_outcome(impact_mps, 50 / 3.6) == outcome
