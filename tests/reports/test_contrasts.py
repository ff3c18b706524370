import pytest

from care_sim.evaluation.censoring import Bound
from care_sim.reports.cells import summarise
from care_sim.reports.contrasts import BRAKED, DETECTED, DETECTION, contrast
from care_sim.reports.formatting import spread
from care_sim.reports.tables.sweep import sweep_tables
from care_sim.study.episode_config import grid
from care_sim.study.rows.reading import with_added_columns
from tests.helpers.made_rows import NEAREST_M, STUDY, row, rows


def cell(policy, study=STUDY):
    return next(cell for cell in summarise(study) if cell.policy == policy)


def test_differences_are_paired_by_seed():
    gap = contrast(DETECTION, rows("all-camera", [10.0, 11.0]), rows("care", [15.0, 16.0]))
    assert gap.difference.interval == (-5.0, -5.0, -5.0)
    shuffled = rows("care", [15.0, 16.0])[::-1]
    assert contrast(DETECTION, shuffled, rows("full", [15.0, 16.0])).difference.interval == (
        0.0,
        0.0,
        0.0,
    )
    assert contrast(DETECTION, rows("care", [1.0, 9.0]), rows("full", [2.0])).difference.pairs == 1
    assert contrast(DETECTION, rows("care", [1.0]), None) is None


def test_rates_are_compared_in_points():
    ours = rows("care", [9.0] * 4)
    theirs = rows("history", [9.0, 9.0, 9.0, None])
    theirs[0]["braked"] = False
    assert contrast(BRAKED, ours, theirs).mean == 25.0
    assert contrast(DETECTED, ours, theirs).mean == 25.0
    assert contrast(DETECTED, ours, theirs).difference.bound == Bound.EXACT


@pytest.mark.parametrize(
    ("gain", "excludes", "counts"), [(0.0, False, False), (2.4, True, False), (2.5, True, True)]
)
def test_a_difference_counts_from_the_gate_on(gain, excludes, counts):
    gap = contrast(DETECTION, rows("care", [10.0 + gain] * 5), rows("history", [10.0] * 5))
    assert (gap.excludes_zero, gap.counts) == (excludes, counts)


def test_against_a_miss_the_difference_is_a_bound():
    gap = contrast(DETECTION, rows("care", [15.0] * 5), rows("history", [None] * 5))
    assert (gap.mean, gap.difference.bound, gap.counts) == (15.0 - NEAREST_M, Bound.AT_LEAST, True)


def test_a_drive_that_meets_nobody_has_no_first_detection():
    met, nobody = {}, {"undetected_to_m": None}
    ours, theirs = (
        [
            row(config, distance, **(nobody if config.seed == 1 else met))
            for config, distance in zip(
                grid(["drive"], [policy], [budget], range(3)), distances, strict=True
            )
        ]
        for policy, budget, distances in (
            ("care", 0.03, [15.0, None, None]),
            ("full", 1.0, [16.0, None, 16.0]),
        )
    )
    care, _ = summarise([*ours, *theirs])
    assert (care.episodes, care.met, care.never, care.as_full) == (3, 2, 1, 0)
    assert care.detection.count == 2
    assert care.regret.difference.pairs == 2
    assert contrast(DETECTED, ours, theirs).difference.pairs == 2
    assert contrast(BRAKED, ours, theirs).difference.pairs == 3
    assert [each["regret_m"] for each in with_added_columns(ours + theirs)][:3] == [
        1.0,
        None,
        16.0 - NEAREST_M,
    ]
    (table,) = sweep_tables(theirs)
    assert any("1 of 3 episodes have no first-sighting actor" in note for note in table.notes)
    (alone,) = summarise(theirs[1:2])
    assert (alone.met, spread(alone.detection)) == (0, "-")


def test_regret_is_what_the_full_scan_has_over_a_policy():
    assert cell("care").regret.mean == pytest.approx(0.1)
    assert cell("care").as_full == 4
    history = cell("history")
    assert (history.regret.difference.bound, history.as_full, history.never) == (
        Bound.AT_LEAST,
        0,
        2,
    )
    assert history.regret.mean == pytest.approx((11 + 13 + 9 + 12 + 16.5) / 5)
    assert cell("full").regret is None


def test_a_miss_is_never_as_good_as_the_full_scan():
    near = [*rows("care", [None] * 5), *rows("full", [2.0] * 5)]
    assert cell("care", near).as_full == 0


def test_a_fault_is_compared_with_the_full_scan_of_the_faultless_world():
    faulty = rows("care", [14.0] * 5, scenario="dartout", budget=0.1, false_negative_rates=(0.2,))
    study = [*faulty, *rows("full", [15.0] * 5, scenario="dartout")]
    assert cell("care", study).regret.difference.interval == (1.0, 1.0, 1.0)
    assert cell("care", study).setting.label == "dartout, false negative rate 0.2"


def test_medians_rank_the_never_detected_last():
    history = cell("history").detection
    assert (history.low, history.median, history.high) == (None, 4.0, 6.0)
