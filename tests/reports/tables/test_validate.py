"""The chosen policies, who leads whom, and whether a world discriminates, on rows made by hand."""

import pytest

from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.table import Bold
from care_sim.reports.tables.validate import (
    BEST_CAMERA,
    HINDSIGHT,
    played_worlds,
    validation_closing,
    validation_tables,
)
from tests.helpers.made_worlds import (
    SEEDS,
    STUDY,
    TELLING,
    TRAINING,
    cell,
    world,
)


def only(rows):
    (played,) = played_worlds(rows)
    return played


def camera_lead(rows):
    return only(rows).lead(BEST_CAMERA, BEST_CONTROL, 0.03)


@pytest.mark.parametrize(
    "training",
    [
        # Fewest collisions first, then the earliest detection: the mean, over seeds that all have.
        {"fan": ([18.0] * 5, 1), "stride": ([13.0] * 5, 0), "rows": ([13.0, *[13.1] * 4], 0)},
        {"fan": ([15.0, 15.0], 0), "rows": ([16.0, 16.0, 2.0], 1)},
        # A stop for nothing counts as a collision.
        {"learned-place": ([18.0] * 5, 0), "rows": ([9.0] * 5, 0)},
    ],
)
def test_the_best_control_avoids_most_and_then_detects_earliest(training):
    rows = [
        each | {"tags": "causal+control", "braked_before_view": policy == "learned-place"}
        for policy, (distances, hits) in training.items()
        for each in cell(policy, distances, hits, training=True)
    ]
    assert only(rows).best_control(0.03) == "rows"


@pytest.mark.parametrize(
    ("care", "counting", "leads"),
    [
        # The gate is 2.5 m.
        ((12.4, 0), 0, False),
        ((12.5, 0), 1, True),
        # A lead in one measure is none where the other counts against it.
        ((15.0, 6), 2, False),
    ],
)
def test_a_lead_reaches_the_gate_and_is_not_lost_elsewhere(care, counting, leads):
    test = {"full": (16.0, 0), "care": care, "rows": (10.0, 0)}
    lead = camera_lead(world(test, TRAINING))
    assert (len(lead.counting), lead.leads) == (counting, leads)


def test_the_choice_depends_on_training_seeds_alone_and_in_hindsight_on_test_seeds():
    """On the test seeds `fan` is better than `rows`, and `seed-finder`, no control, than both."""
    played = only(world(TELLING, TRAINING))
    roles = (BEST_CAMERA, BEST_CONTROL, HINDSIGHT)
    assert [played.named(role, 0.03) for role in roles] == ["care", "rows", "fan"]
    assert played.lead(BEST_CAMERA, HINDSIGHT, 0.03).avoided.mean == pytest.approx(0.0)
    assert only(world(TELLING, {})).best_control(0.03) is None
    assert only(world({}, TRAINING)).named(HINDSIGHT, 0.03) is None
    # Without training nobody is chosen, and nobody leads.
    assert only(world(TELLING, {})).answers(0.03) == (False, False, True)


@pytest.mark.parametrize(
    ("changed", "answers"),
    [
        ({}, (True, True, True)),
        ({"rows": (13.0, 1)}, (False, True, True)),
        ({"full": (10.0, 4)}, (True, False, True)),
        ({"all-camera": (15.0, 1)}, (True, True, False)),
        ({"all-camera": (5.0, 6)}, (True, True, False)),
        # Two are apart whichever of them is ahead.
        ({"full": (19.0, 1), "history": (18.5, 1)}, (True, True, True)),
    ],
)
def test_each_question_can_fail_alone(changed, answers):
    assert only(world(TELLING | changed, TRAINING)).answers(0.03) == answers


def test_a_line_per_budget_says_who_was_chosen_and_answers_the_questions():
    verdicts, hits, *_ = validation_tables(STUDY)
    assert verdicts.rows == (
        ("dartout",),
        ("3%", "care", "rows", "fan", "no", "+0.0", "+0", "no", "no", "no"),
        ("dartout, mirrored drawn",),
        # The full scan hits somebody on the last of six seeds, `rows` on the last four.
        ("3%", "care", "rows", "fan", "yes", "+5.0*", "+60*", "yes", "yes", "yes"),
    )
    assert isinstance(verdicts.rows[3][-1], Bold)
    # CARE hits on 1 seed of 6, `fan` too, `rows` on 4.
    found = ("1/6", "1/6", "1/6", "4/6", "1/6", "3/6", "1/6", "6/6", "6/6", "1/6")
    assert hits.rows[3] == ("3%", *found, "")


def test_the_full_scan_loses_what_it_never_detects_and_is_run_into():
    rows = [*world({}, TRAINING), *cell("full", [16.0, None, 16.0, 16.0, 16.0], 1)]
    rows += cell("care", [9.0] * 5)
    assert validation_tables(rows)[1].rows[1][1:3] == ("2/5", "1/5")
    who = {"hit_kind": "van", "hit_at_front": False, "closing_speed_mps": 6.25}
    hit = [r | who if r["policy"] == "full" and r["collision"] else r for r in rows]
    assert validation_tables(hit)[1].rows[1][-1] == "1/5 van up to 6.2 m/s"


def test_the_closing_names_the_seeds_and_the_worlds_that_discriminate():
    seeds = "6 test seeds from 0 to 5 and 6 training seeds from 10000 to 10005"
    assert validation_closing(STUDY) == [
        f"Played: {seeds}.",
        "Worlds that discriminate: 1 of 2: dartout, mirrored drawn at 3%.",
    ]
    # Below five test seeds there is no verdict.
    few = [each for each in world(TELLING, TRAINING) if not 4 <= each["seed"] < SEEDS]
    assert validation_tables(few)[0].rows[1][-1] == "too few"
    assert validation_closing(few)[0].endswith("too few for a verdict.")
