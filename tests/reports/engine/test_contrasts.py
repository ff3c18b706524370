"""Contrasts with known answers: paired by seed, by case, by scene, by event."""

import numpy as np
import pytest

from care_sim.evaluation.bootstrap import paired_difference
from care_sim.evaluation.censoring import Bound
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD
from care_sim.reports.engine import contrasts
from care_sim.reports.engine.measures import DETECTION, Recall
from care_sim.reports.protocol.comparisons import DENSE_LESS_SPARSE, SceneThird
from care_sim.reports.protocol.rows import plays_by_setting
from tests.helpers.made_plays import found, play, study
from tests.helpers.made_rows import NEAREST_M, rows


def contrast(measure, ours, theirs, **more):
    """The contrast of rows."""
    return contrasts.contrast(measure, measure.units(ours), measure.units(theirs), **more)


FIRST, ALL, DELAY = map(Recall, (FIRST_SIGHTING, OVERALL, TTFD))


def test_differences_are_paired_by_seed():
    gap = contrast(DETECTION, rows("all-camera", [10.0, 11.0]), rows("care", [15.0, 16.0]))
    assert gap.difference.interval == (-5.0, -5.0, -5.0)
    shuffled = rows("care", [15.0, 16.0])[::-1]
    assert contrast(DETECTION, shuffled, rows("full", [15.0, 16.0])).difference.interval == (
        0.0,
        0.0,
        0.0,
    )
    single = contrast(DETECTION, rows("care", [1.0, 9.0]), rows("full", [2.0]))
    assert (single.difference.pairs, single.mean, single.interval) == (1, -1.0, None)
    assert contrast(DETECTION, rows("care", [1.0]), []) is None


@pytest.mark.parametrize(
    ("gain", "excludes", "counts"), [(0.0, False, False), (2.4, True, False), (2.5, True, True)]
)
def test_a_difference_counts_from_the_gate_on(gain, excludes, counts):
    gap = contrast(DETECTION, rows("care", [10.0 + gain] * 5), rows("history", [10.0] * 5))
    assert (gap.excludes_zero, gap.sign, gap.counts) == (excludes, int(excludes), counts)


def test_against_a_miss_the_difference_is_a_bound():
    gap = contrast(DETECTION, rows("care", [15.0] * 5), rows("history", [None] * 5))
    assert (gap.mean, gap.bound, gap.counts) == (15.0 - NEAREST_M, Bound.AT_LEAST, True)
    gap = contrast(DETECTION, rows("history", [None] * 5), rows("care", [15.0] * 5))
    assert (gap.mean, gap.bound, gap.sign) == (NEAREST_M - 15.0, Bound.AT_MOST, -1)
    # A missed actor that may have stood anywhere up to 3 m bears no lead over 2 m out.
    gap = contrast(DETECTION, rows("care", [None] * 5), rows("history", [2.0] * 5))
    assert (gap.mean, gap.excludes_zero) == (1.0, False)


def test_a_difference_counts_whatever_the_censored_were():
    """At 3 m for two missed actors the mean is 2.62 m; at 0 m it is 2.32 m, below the gate."""
    ours = rows("care", [11.8] * 18 + [None] * 2)
    gap = contrast(DETECTION, ours, rows("history", [9.0] * 18 + [2.0] * 2))
    assert gap.mean == pytest.approx(2.62)
    assert (gap.excludes_zero, gap.counts) == (True, False)


def test_cases_count_with_their_means_and_one_case_is_one_pair():
    def cases(policy, by_case):
        return [
            row | {"seed": (case, row["seed"])}
            for case, distances in by_case.items()
            for row in rows(policy, distances)
        ]

    ours = cases("care", {"a": [10.0] * 9, "b": [4.0, 6.0, 90.0]})
    theirs = cases("history", {"a": [9.0] * 9, "b": [2.0, 2.0], "c": [1.0]})
    gap = contrast(DETECTION, ours, theirs, by_cases=True)
    assert (gap.difference.pairs, gap.mean) == (2, (1.0 + 3.0) / 2)
    one = contrast(DETECTION, ours[:9], theirs[:9], by_cases=True)
    assert (one.difference.pairs, one.excludes_zero) == (1, False)


def plays(rows):
    (one,) = plays_by_setting(rows)
    return one


def over_history(measure, played, budget=0.1):
    return played.contrast(measure, "care", "history", budget)


def test_two_events_more_in_every_scene_of_twenty_are_ten_points():
    same = plays(study({"care": (6, 5), "history": (4, 6)}))
    gap = over_history(FIRST, same)
    assert gap.interval == pytest.approx((10.0, 10.0, 10.0))
    assert (gap.sign, gap.difference.pairs, gap.asterisk, gap.suffix) == (1, 6, "", "")
    assert over_history(ALL, same, 0.2).mean == pytest.approx(-10.0)
    assert over_history(DELAY, same, 0.35).mean == pytest.approx(-2 * 6 / 20)
    assert over_history(Recall(FIRST_SIGHTING, "azimuth/side"), same).sign == 1
    assert same.contrast(FIRST, "history", "care", 0.1).sign == -1
    assert over_history(FIRST, plays(study({"care": (6, 5)}))) is None


def test_equal_scene_weights_count_scenes():
    rows = [
        play(f"{n}", policy, found(events, sighted), [0] * events)
        for n, (events, ours) in enumerate([(2, 1), (10, 0), (2, 1), (10, 0), (2, 1)])
        for policy, sighted in (("care", ours), ("history", 0))
    ]
    assert over_history(FIRST, plays(rows)).mean == pytest.approx(100 * 3 / 26)
    equal = Recall(FIRST_SIGHTING, equal_scenes=True)
    assert over_history(equal, plays(rows)).mean == pytest.approx(30.0)


def test_of_few_scenes_the_interval_comes_from_events_averaged_over_floor_seeds():
    """CARE finds 12 and 6 of 30 events with its two floors, three more a keyframe late, and history
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
    gap = over_history(FIRST, few)
    assert gap.interval == pytest.approx(paired_difference(of_events, np.zeros(30)))
    assert (gap.mean, gap.over_events, gap.suffix) == (pytest.approx(30.0), True, "°")
    late = over_history(DELAY, few)
    assert (late.mean, late.sign) == (pytest.approx(-0.3 * 6 - 0.1 * 5), -1)
    for measure in (
        ALL,
        Recall(FIRST_SIGHTING, equal_scenes=True),
        Recall(FIRST_SIGHTING, "range/below 20 m"),
    ):
        none = over_history(measure, few)
        assert (none.interval, none.sign, none.over_events) == (None, 0, False)
    # Across settings no events stand in for scenes.
    keys = (few.key("care", 0.1), few.key("history", 0.1))
    assert few.frame.contrast(FIRST, *keys).interval is None


@pytest.mark.parametrize(("scenes", "over_events"), [(3, True), (4, True), (5, False), (7, False)])
def test_scenes_without_events_do_not_count_towards_an_interval_over_scenes(scenes, over_events):
    """So many scenes with ten events, of seven that were played."""
    rows = [
        play(f"{n}", policy, found(events, min(sighted, events)), [sighted] * events)
        for n, events in enumerate([10] * scenes + [0] * (7 - scenes))
        for policy, sighted in (("care", 6), ("history", 4))
    ]
    gap = over_history(FIRST, plays(rows))
    assert (gap.mean, gap.over_events) == (pytest.approx(20.0), over_events)
    assert (gap.interval.low < gap.mean) == over_events


def thirds(scenes, column="tracks"):
    """CARE finds two object frames per event more than all-camera in the highest-ranked scenes."""
    rows = []
    for n in range(scenes):
        more = {column: float(n)}
        frames = 7 if 3 * n >= 2 * scenes else 5
        rows.append(play(f"{n:02d}", "care", found(10, 3), [frames] * 10, **more))
        rows.append(play(f"{n:02d}", "all-camera", found(10, 3), [5] * 10))
    return plays(rows)


@pytest.mark.parametrize("column", ["tracks", "explained"])
def test_thirds_tell_dense_scenes_from_sparse_ones(column):
    dense, sparse, difference = (
        SceneThird(which, column, OVERALL).measured(thirds(15, column), 0.1)
        for which in ("dense", "sparse", DENSE_LESS_SPARSE)
    )
    assert (dense.mean, sparse.mean, difference.mean) == pytest.approx((20.0, 0.0, 20.0))
    assert (dense.sign, sparse.sign, difference.sign) == (1, 0, 1)


def test_small_thirds_have_no_interval_and_smaller_ones_no_gap():
    nine = [
        SceneThird(which, "tracks", OVERALL).measured(thirds(9), 0.1)
        for which in ("dense", DENSE_LESS_SPARSE)
    ]
    assert [(each.mean, each.interval) for each in nine] == [(pytest.approx(20.0), None)] * 2
    assert SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL).measured(thirds(8), 0.1) is None
