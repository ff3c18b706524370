import numpy as np
import pytest

from care_sim.evaluation.outcomes import outcome
from care_sim.loops.records import Keyframe, Outcome

NO_IMPACT = (False, None, None, None)
"""No brake for nothing, and no contact."""


def keyframe(index=0, **changes):
    quiet = {
        "time_s": index / 10, "fired": np.arange(100), "speed_mps": 8.0, "impact_speed_mps": None,
        "in_view": False, "detected": False, "braking": False,
        "distance_m": 30.0 - index, "nearest_m": 30.0 - index, "clearance_m": 25.0 - index,
    }  # fmt: skip
    return Keyframe(index=index, **{**quiet, **changes})


def test_an_episode_worked_by_hand():
    episode = [
        keyframe(0, nearest_m=1.0, clearance_m=0.1),
        keyframe(1, in_view=True, nearest_m=9.0, clearance_m=7.5),
        keyframe(
            2,
            in_view=True,
            detected=True,
            distance_m=14.4,
            braking=True,
            nearest_m=8.0,
            clearance_m=6.0,
        ),
        keyframe(
            3,
            detected=True,
            distance_m=12.0,
            braking=True,
            nearest_m=5.5,
            clearance_m=3.25,
            fired=np.arange(7),
        ),
        keyframe(4, in_view=True, nearest_m=6.0, clearance_m=4.0),
    ]
    assert outcome(episode) == Outcome(14.4, None, True, 5.5, 3.25, False, None, 407, *NO_IMPACT)


def test_never_seen_never_detected():
    assert outcome([keyframe(0), keyframe(1)]) == Outcome(
        None, 29.0, False, None, None, False, None, 200, *NO_IMPACT
    )


def test_seen_but_never_detected_still_has_a_clearance():
    result = outcome([keyframe(0), keyframe(1, in_view=True)])
    assert (result.detection_distance_m, result.min_distance_m, result.clearance_m) == (
        None,
        29.0,
        24.0,
    )


def test_a_missed_actor_is_censored_at_the_nearest_scan_since_it_came_into_view():
    passing = [
        keyframe(n, in_view=n in (1, 2), distance_m=d)
        for n, d in enumerate([5.0, 20.0, 12.0, 15.0])
    ]
    assert (outcome(passing).detection_distance_m, outcome(passing).undetected_to_m) == (None, 12.0)
    assert outcome([*passing, keyframe(4, detected=True)]).undetected_to_m is None


def test_the_first_contact_gives_the_impact_speed():
    result = outcome(
        [keyframe(0), keyframe(1, impact_speed_mps=3.5), keyframe(2, impact_speed_mps=2.0)]
    )
    assert (result.collision, result.impact_speed_mps) == (True, 3.5)


def test_a_touch_at_standstill_is_a_collision():
    result = outcome([keyframe(0, impact_speed_mps=0.0)])
    assert (result.collision, result.impact_speed_mps) == (True, 0.0)


@pytest.mark.parametrize("count", [1, 5])
def test_rays_are_counted_as_fired(count):
    assert outcome([keyframe(n, fired=np.arange(n)) for n in range(count)]).rays_fired == sum(
        range(count)
    )


def test_without_an_actor_nobody_could_be_detected():
    result = outcome([keyframe(0, distance_m=np.inf), keyframe(1, distance_m=np.inf)])
    assert (result.detection_distance_m, result.undetected_to_m) == (None, None)
