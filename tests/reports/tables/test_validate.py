"""The tables of a validation, on rows made by hand."""

import pytest

from care_sim.reports.table import Bold
from care_sim.reports.tables.validate import validation_closing, validation_tables
from tests.helpers.made_worlds import SATURATED, SEEDS, STUDY, TELLING, TRAINING, cell, world

TITLES = (
    "Does the world discriminate?",
    "Who is hit?",
    "dartout: who leads whom",
    "dartout, mirrored drawn: who leads whom",
    "dartout: every policy on the test seeds",
    "dartout, mirrored drawn: every policy on the test seeds",
)


@pytest.fixture(scope="module")
def tables():
    made = validation_tables(STUDY)
    assert tuple(table.title for table in made) == TITLES
    return dict(zip(TITLES, made, strict=True))


def test_a_line_a_budget_says_who_was_chosen_and_answers_the_questions(tables):
    verdicts = tables[TITLES[0]]
    assert verdicts.rows == (
        ("dartout",),
        ("3%", "care", "rows", "fan", "no", "+0.0", "+0", "no", "no", "no"),
        ("dartout, mirrored drawn",),
        ("3%", "care", "rows", "fan", "yes", "+5.0*", "+60*", "yes", "yes", "yes"),
    )
    assert isinstance(verdicts.rows[3][-1], Bold)


def test_answers_on_too_few_seeds_are_neither_yes_nor_no():
    """On four seeds CARE leads and the full scan leaves much to win, but no difference counts."""
    rows = [each for each in world(TELLING, TRAINING) if not 4 <= each["seed"] < SEEDS]
    verdict = validation_tables(rows)[0].rows[1]
    assert verdict[4:7] == ("too few", "+5.0", "+50")
    assert verdict[7:] == ("too few",) * 3
    assert validation_closing(rows)[1] == "dartout: no verdict on 4 test seeds, it takes 5."


def test_collisions_stand_side_by_side_with_those_of_the_full_scan(tables):
    assert tables[TITLES[1]].rows[3] == (
        "3%",
        *("1/6", "1/6", "1/6", "4/6", "1/6", "3/6", "1/6", "6/6", "6/6", "1/6"),
    )


def test_an_actor_that_the_full_scan_never_detects_is_lost():
    rows = [*world({}, TRAINING), *cell("full", [16.0, None, 16.0, 16.0, 16.0], 1)]
    rows += cell("care", [9.0] * 5)
    assert validation_tables(rows)[1].rows[1][1:3] == ("2/5", "1/5")


def test_the_memoriser_is_held_against_the_best_camera_policy(tables):
    leads = {row[0]: row[1] for row in tables[TITLES[3]].rows}
    assert leads["seed-finder minus best camera policy, m"] == "+0.5 [0.5,0.5]"
    assert leads["2: full minus best control, m"] == "+6.0* [6.0,6.0]"
    assert leads["3: care minus history, points"] == "+100* [100,100]"
    assert any("public generator" in note for note in tables[TITLES[3]].notes)


def test_the_choice_in_hindsight_stands_beside_the_one_that_was_made(tables):
    """`fan`, as good as CARE on the test seeds, was not chosen on the training seeds."""
    leads = {row[0]: row[1] for row in tables[TITLES[3]].rows}
    assert leads["1: best camera policy minus best control, points"] == "+60* [20,100]"
    assert leads["1: best camera policy minus control in hindsight, points"] == "+0 [0,0]"
    assert leads["1: best camera policy minus control in hindsight, m"] == "+0.0 [0.0,0.0]"


def test_every_policy_has_its_level_in_every_world(tables):
    levels = {row[0]: row[1] for row in tables[TITLES[5]].rows}
    assert levels["full"] == "16.0, 1/6"
    assert levels["all-camera"] == "11.0, 3/6"
    assert {*levels} == {"seed-finder §", *SATURATED} - {"seed-finder"}


def test_the_closing_tells_the_seeds_and_a_verdict_a_world():
    seeds, plain, mirrored = validation_closing(STUDY)
    assert seeds == "Played: 6 test seeds from 0 to 5 and 6 training seeds from 10000 to 10005."
    assert plain.startswith("dartout: does not discriminate, because at 3% care does not lead rows")
    assert mirrored == "dartout, mirrored drawn: discriminates at 3%."
