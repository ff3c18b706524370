"""Who is chosen, who leads whom, and whether a world discriminates, on rows made by hand."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.reports.validation import played_worlds
from tests.helpers.made_worlds import (
    MIRRORED,
    SATURATED,
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


def test_each_world_stands_alone_the_unchanged_one_first():
    plain, mirrored = played_worlds(STUDY)
    assert plain.setting.label == "dartout"
    assert mirrored.setting.label == "dartout, mirrored drawn"
    assert len(plain.test_rows) == len(mirrored.test_rows) == len(TELLING) * SEEDS


def test_fewest_collisions_are_the_best_and_then_the_earliest_detection():
    rows = [
        *cell("fan", [18.0] * 5, 1, training=True),
        *cell("rows", [12.0, 13.0, 14.0, 15.0, 16.0], training=True),
        *cell("stride", [12.0, 13.0, 14.0, 15.0, 15.9], training=True),
    ]
    rows = [each | {"tags": "causal+control"} for each in rows]
    assert only(rows).best_control(0.03) == "rows"


def test_a_stop_for_nothing_counts_as_a_collision_where_the_best_is_chosen():
    rows = [*cell("rows", [9.0] * 5, training=True), *cell("fan", [14.0] * 5, training=True)]
    assert only(rows).best_control(0.03) == "fan"
    rows[-1]["braked_before_view"] = True
    assert only(rows).best_control(0.03) == "rows"


def test_the_choice_hangs_on_training_seeds_alone_and_the_memoriser_is_no_control():
    """On the test seeds `fan` is better than `rows`, and `seed-finder` than both."""
    played = only(world(TELLING, TRAINING))
    assert played.best_control(0.03) == "rows"
    assert played.best_camera(0.03) == "care"
    assert only(world(TELLING, {})).best_control(0.03) is None


def test_the_choice_in_hindsight_hangs_on_test_seeds_alone_and_leaves_the_verdict():
    played = only(world(TELLING, TRAINING))
    assert played.hindsight_control(0.03) == "fan"
    assert played.hindsight_lead(0.03).avoided.mean == pytest.approx(0.0)
    assert played.failings(0.03) == []
    assert only(world({}, TRAINING)).hindsight_control(0.03) is None


def test_a_control_that_lacks_a_bad_seed_does_not_win_by_that():
    rows = [
        *cell("fan", [15.0, 15.0], training=True),
        *cell("rows", [16.0, 16.0, 2.0], 1, training=True),
    ]
    assert only(rows).best_control(0.03) == "rows"


def test_collisions_count_where_the_full_scan_avoids_them():
    """The full scan hits somebody on the last of six seeds, `rows` on the last four."""
    lead = only(world(TELLING, TRAINING)).camera_lead(0.03)
    assert lead.avoided.mean == pytest.approx(100 * 3 / 5)
    assert lead.avoided.difference.pairs == 5
    assert lead.detection.mean == pytest.approx(5.0)
    assert lead.leads


def test_a_lead_in_one_measure_is_none_where_the_other_counts_against_it():
    test = {"full": (16.0, 0), "care": (15.0, 0), "rows": (10.0, 0)}
    assert only(world(test, TRAINING)).camera_lead(0.03).leads
    worse = test | {"care": (15.0, 6)}
    lead = only(world(worse, TRAINING)).camera_lead(0.03)
    assert lead.is_told
    assert not lead.leads


@pytest.mark.parametrize(("distance", "leads"), [(12.4, False), (12.5, True)])
def test_the_gate_is_two_and_a_half_metres(distance, leads):
    test = {"full": (16.0, 0), "care": (distance, 0), "rows": (10.0, 0)}
    assert only(world(test, TRAINING)).camera_lead(0.03).leads is leads


@pytest.mark.parametrize(("hits", "leads"), [(1, False), (2, False), (5, True)])
def test_collisions_need_an_interval_without_zero(hits, leads):
    """Two of 20 are 10 points, and chance; five are not."""
    rows = [
        *world({}, TRAINING),
        *cell("full", [16.0] * 20),
        *cell("care", [10.0] * 20),
        *cell("rows", [10.0] * 20, hits),
    ]
    assert only(rows).camera_lead(0.03).leads is leads


def test_a_saturated_world_does_not_discriminate_and_the_reasons_are_named():
    assert only(world(SATURATED, TRAINING)).verdict == (
        "dartout: does not discriminate, because at 3% care does not lead rows, a full scan leaves "
        "nothing to win, care and all-camera are not told apart."
    )


def test_a_world_that_tells_all_apart_discriminates_at_its_budgets():
    saturated = {policy: level for policy, level in SATURATED.items() if policy != "full"}
    telling = only(
        [
            *world(TELLING, TRAINING, parameters=MIRRORED),
            *world(saturated, TRAINING, parameters=MIRRORED, budget=0.1),
        ]
    )
    assert telling.failings(0.03) == []
    assert len(telling.failings(0.1)) == 3
    assert telling.verdict == "dartout, mirrored drawn: discriminates at 3%."


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"rows": (13.0, 1)}, "care does not lead rows"),
        ({"full": (10.0, 4)}, "a full scan leaves nothing to win"),
        ({"all-camera": (15.0, 1)}, "care and all-camera are not told apart"),
        ({"all-camera": (5.0, 6)}, "all-camera and history are not told apart"),
    ],
)
def test_each_question_can_fail_alone(changed, reason):
    """Whoever becomes as good or bad as another is named, and nobody else."""
    assert only(world(TELLING | changed, TRAINING)).failings(0.03) == [reason]


@pytest.mark.parametrize(("seeds", "verdict"), [(4, "no verdict"), (5, "discriminates at 3%")])
def test_there_is_no_verdict_below_five_test_seeds(seeds, verdict):
    rows = [each for each in world(TELLING, TRAINING) if not seeds <= each["seed"] < SEEDS]
    assert only(rows).verdict.startswith(f"dartout: {verdict}")


def test_two_are_apart_whichever_of_them_is_ahead():
    test = TELLING | {"full": (19.0, 1), "history": (18.5, 1)}
    assert only(world(test, TRAINING)).failings(0.03) == []


def test_without_training_nobody_is_chosen():
    assert only(world(TELLING, {})).failings(0.03) == ["nobody was chosen on training seeds"]


@settings(max_examples=15, deadline=None)
@given(st.permutations(range(len(STUDY))))
def test_the_sequence_of_rows_within_a_world_decides_nothing(order):
    shuffled = [STUDY[n] for n in order]
    by_name = {played.setting.label: played.verdict for played in played_worlds(shuffled)}
    assert by_name == {played.setting.label: played.verdict for played in played_worlds(STUDY)}
