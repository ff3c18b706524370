"""Differences of two policies with known answers: by scenes, by events where scenes are few, in
thirds.
"""

import numpy as np
import pytest

from care_sim.evaluation.bootstrap import Interval, paired_difference
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD
from care_sim.reports.protocol.differences import MeasuredDifference, PolicyPair
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.reports.protocol.thirds import DENSE_LESS_SPARSE, SceneThird
from tests.helpers.made_plays import found, play, study

FIRST = PolicyPair("care", "history", FIRST_SIGHTING)


def plays(rows):
    (one,) = plays_by_setting(rows)
    return one


def test_two_events_more_in_every_scene_of_twenty_are_ten_points():
    same = plays(study({"care": (6, 5), "history": (4, 6)}))
    assert FIRST.measured(same, 0.1) == MeasuredDifference(
        FIRST_SIGHTING, pytest.approx(10.0), pytest.approx((10.0, 10.0, 10.0))
    )
    assert PolicyPair("care", "history", OVERALL).measured(same, 0.2).mean == pytest.approx(-10.0)
    assert PolicyPair("care", "history", TTFD).measured(same, 0.35).mean == pytest.approx(
        -2 * 6 / 20
    )
    assert (
        PolicyPair("care", "history", FIRST_SIGHTING, "azimuth/side").measured(same, 0.1).sign == 1
    )
    assert PolicyPair("history", "care", FIRST_SIGHTING).measured(same, 0.1).sign == -1


def test_there_is_no_gap_without_plays():
    assert FIRST.measured(plays(study({"care": (6, 5)})), 0.1) is None


def test_equal_scene_weights_count_scenes():
    rows = [
        play(f"{n}", policy, found(events, sighted), [0] * events)
        for n, (events, ours) in enumerate([(2, 1), (10, 0), (2, 1), (10, 0), (2, 1)])
        for policy, sighted in (("care", ours), ("history", 0))
    ]
    assert FIRST.measured(plays(rows), 0.1).mean == pytest.approx(100 * 3 / 26)
    assert PolicyPair("care", "history", FIRST_SIGHTING, equal_scenes=True).measured(
        plays(rows), 0.1
    ).mean == pytest.approx(30.0)


def test_of_few_scenes_the_interval_comes_from_events_averaged_over_floor_seeds():
    """Of 30 events CARE finds 12 and 6 with its two floors, three more a keyframe late, and history
    none.
    """
    rows = [
        play(
            f"{n}",
            policy,
            found(10, sighted[seed], late=1) if policy == "care" else found(10, 0),
            [1] * 10,
            floor_seed=seed,
        )
        for n in range(3)
        for policy in ("care", "history")
        for seed, sighted in ((0, (4, 2)), (1, (4, 2)))
    ]
    few = plays(rows)
    of_events = np.tile([100.0] * 2 + [50.0] * 2 + [0.0] * 6, 3)
    assert FIRST.measured(few, 0.1) == MeasuredDifference(
        FIRST_SIGHTING,
        pytest.approx(30.0),
        pytest.approx(paired_difference(of_events, np.zeros(30))),
        over_events=True,
    )
    late = PolicyPair("care", "history", TTFD).measured(few, 0.1)
    assert (late.mean, late.sign) == (pytest.approx(-0.3 * 6 - 0.1 * 5), -1)
    assert late.interval.mean == pytest.approx(late.mean)
    for none in (
        PolicyPair("care", "history", OVERALL),
        PolicyPair("care", "history", FIRST_SIGHTING, equal_scenes=True),
    ):
        assert none.measured(few, 0.1).interval is None
    within = PolicyPair("care", "history", FIRST_SIGHTING, "range/below 20 m").measured(few, 0.1)
    assert (within.interval, within.sign) == (None, 0)


def with_events(scenes, played=7):
    """So many scenes with ten events, of all that were played; CARE finds two events more and two
    frames more.
    """
    return plays(
        [
            play(f"{n}", policy, found(events, min(sighted, events)), [sighted] * events)
            for n, events in enumerate([10] * scenes + [0] * (played - scenes))
            for policy, sighted in (("care", 6), ("history", 4))
        ]
    )


@pytest.mark.parametrize(("scenes", "over_events"), [(3, True), (4, True), (5, False), (7, False)])
def test_scenes_without_events_do_not_count_towards_an_interval_over_scenes(scenes, over_events):
    difference = FIRST.measured(with_events(scenes), 0.1)
    assert (difference.mean, difference.over_events) == (pytest.approx(20.0), over_events)
    assert (difference.interval.low < difference.mean) == over_events
    assert not PolicyPair("care", "history", OVERALL).measured(with_events(scenes), 0.1).over_events


def test_five_scenes_are_enough_and_four_events_are_too_few():
    five = FIRST.measured(
        plays(study({"care": (6, 5), "history": (4, 6)}, scenes=5, events=7)), 0.1
    )
    assert five.interval.low == five.interval.high
    assert not five.over_events
    few = plays(
        [play("a", policy, found(4, n), [0] * 4) for policy, n in (("care", 3), ("history", 1))]
    )
    assert FIRST.measured(few, 0.1) == MeasuredDifference(FIRST_SIGHTING, 50.0, None)


@pytest.mark.parametrize(
    ("interval", "sign"),
    [
        (Interval(2, 1, 3), 1),
        (Interval(-2, -3, -1), -1),
        (Interval(0, -1, 1), 0),
        (Interval(1, 0, 2), 0),
        (None, 0),
    ],
)
def test_a_gap_has_a_sign_where_its_interval_excludes_zero(interval, sign):
    assert MeasuredDifference(FIRST_SIGHTING, 2.0, interval).sign == sign


def thirds(scenes, column="tracks"):
    """CARE finds two object frames per event more than all-camera in the highest-ranked scenes."""
    rows = []
    for n in range(scenes):
        more = {column: float(n)}
        rows.append(
            play(f"{n:02d}", "care", found(10, 3), [7 if 3 * n >= 2 * scenes else 5] * 10, **more)
        )
        rows.append(play(f"{n:02d}", "all-camera", found(10, 3), [5] * 10))
    return plays(rows)


@pytest.mark.parametrize("column", ["tracks", "explained"])
def test_thirds_tell_dense_scenes_from_sparse_ones(column):
    played = thirds(15, column)
    dense, sparse, difference = (
        SceneThird(which, column, OVERALL).measured(played, 0.1)
        for which in ("dense", "sparse", DENSE_LESS_SPARSE)
    )
    assert (dense.mean, sparse.mean, difference.mean) == pytest.approx((20.0, 0.0, 20.0))
    assert (dense.sign, sparse.sign, difference.sign) == (1, 0, 1)
    assert SceneThird(DENSE_LESS_SPARSE, column, FIRST_SIGHTING).measured(played, 0.1).mean == 0.0


def test_small_thirds_have_no_interval_and_smaller_ones_no_gap():
    nine = [
        SceneThird(which, "tracks", OVERALL).measured(thirds(9), 0.1)
        for which in ("dense", DENSE_LESS_SPARSE)
    ]
    assert [(difference.mean, difference.interval) for difference in nine] == [
        (pytest.approx(20.0), None)
    ] * 2
    assert SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL).measured(thirds(8), 0.1) is None


def test_scenes_without_events_do_not_make_a_third_large_enough():
    """Of the five scenes with the most tracks two have no events."""
    rows = [
        play(f"{n:02d}", policy, found(events, 0), [frames] * events, tracks=float(n))
        for n, events in enumerate([10] * 13 + [0] * 2)
        for policy, frames in (("care", 6), ("all-camera", 5))
    ]
    dense, sparse, difference = (
        SceneThird(which, "tracks", OVERALL).measured(plays(rows), 0.1)
        for which in ("dense", "sparse", DENSE_LESS_SPARSE)
    )
    assert (dense.interval, difference.interval) == (None, None)
    assert sparse.sign == 1
