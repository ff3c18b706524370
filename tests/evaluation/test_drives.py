"""The result of a drive, from keyframes made by hand."""

import numpy as np
import pytest

from care_sim.evaluation.outcomes import drive_outcome
from care_sim.loops.records import Keyframe, Sight
from care_sim.world.approach import Impact
from care_sim.world.motions import Crosser, Meeting, Walk

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


def test_a_drive_may_meet_nobody():
    frames = [keyframe(0, [])]
    assert drive_outcome(frames, [], 0.1).encounters == ()
