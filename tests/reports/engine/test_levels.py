"""The cells of episodes: medians, counts, and regret against the full scan."""

import pytest

from care_sim.evaluation.censoring import Bound
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level, levels
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.formatting import spread
from care_sim.study.episode_config import grid
from care_sim.study.rows.reading import with_added_columns
from tests.helpers.made_rows import NEAREST_M, STUDY, row, rows


def cell(policy, study=STUDY):
    return next(cell for cell in levels(Frame(study)) if cell.policy == policy)


def test_regret_is_what_the_full_scan_has_over_a_policy():
    assert cell("care").regret.mean == pytest.approx(0.1)
    assert cell("care").as_full == 4
    history = cell("history")
    assert (history.regret.bound, history.as_full, history.never) == (Bound.AT_LEAST, 0, 2)
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


def test_a_drive_that_meets_nobody_has_no_first_detection():
    nobody = {"undetected_to_m": None}
    ours, theirs = (
        [
            row(config, distance, **(nobody if config.seed == 1 else {}))
            for config, distance in zip(
                grid(["drive"], [policy], [budget], range(3)), distances, strict=True
            )
        ]
        for policy, budget, distances in (
            ("care", 0.03, [15.0, None, None]),
            ("full", 1.0, [16.0, None, 16.0]),
        )
    )
    care, _ = levels(Frame([*ours, *theirs]))
    assert (care.episodes, care.met, care.never, care.as_full) == (3, 2, 1, 0)
    assert (care.detection.count, care.regret.difference.pairs) == (2, 2)
    assert [each["regret_m"] for each in with_added_columns(ours + theirs)][:3] == [
        1.0,
        None,
        16.0 - NEAREST_M,
    ]
    (alone,) = levels(Frame(theirs[1:2]))
    assert (alone.met, spread(alone.detection)) == (0, "-")


def test_levels_in_words():
    hit = [one | {"collision": one["seed"] == 1} for one in rows("care", [9.0, 8.0, None])]
    assert level(AVOIDED, AVOIDED.units(hit)) == "2/3"
    assert level(DETECTION, DETECTION.units(hit)) == "8.0"
    assert level(DETECTION, DETECTION.units(hit[2:])) == "not detected"
    assert level(DETECTION, {}) == ""
