"""The best control: which policies are controls, and which of them is the best at a budget."""

import pytest

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.engine.controls import is_control, named_by_budget
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import DETECTION, Recall
from care_sim.reports.engine.parts import Part
from care_sim.reports.protocol.contrasts import named_controls, over_controls
from care_sim.reports.protocol.rows import plays_by_setting
from tests.helpers.made_plays import found, play, study
from tests.helpers.made_rows import rows

AT_10 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (4, 8), "place": (5, 3), "full": (8, 8)}
AT_20 = {"care": (6, 5), "seed-finder": (9, 9), "rows": (7, 6), "place": (5, 5)}
PLAYS = [*study(AT_10, budgets=(0.1,)), *study(AT_20, budgets=(0.2,))]


def plays(rows=PLAYS):
    (one,) = plays_by_setting(rows)
    return one


@pytest.mark.parametrize(
    ("tags", "control"),
    [
        (("causal", "control"), True),
        (("causal",), False),
        (("generator", "control"), False),
        (("privileged", "control"), False),
        (("non-causal", "control"), False),
    ],
)
def test_a_control_is_one_that_a_car_can_have(tags, control):
    assert is_control(tags) == control


@pytest.mark.parametrize(
    ("controls", "words"),
    [
        ({0.01: "fan", 0.03: "fan"}, "fan at every budget"),
        ({0.01: "fan", 0.03: "rows", 0.05: "fan"}, "fan at 1%, 5% and rows at 3%"),
    ],
)
def test_each_control_is_named_once(controls, words):
    assert named_by_budget(controls) == words


def test_it_is_chosen_by_the_measure_itself_at_every_budget():
    first, overall = over_controls(plays())
    assert plays().controls == ["rows", "place"]
    assert (first.controls, overall.controls) == (["place", "rows"], ["rows", "rows"])
    assert [*first.differences] == ["care", "seed-finder"]
    assert [each.mean for each in first.differences["care"]] == pytest.approx([5.0, -5.0])
    assert named_controls(plays(), [first, overall]) == (
        "Best control: in first-sighting recall place at 10% and rows at 20%; "
        "in overall recall rows at every budget."
    )


def test_controls_are_compared_on_the_scenes_that_all_of_them_have():
    """`place` found less in the scene that both have; it was not played in the hard one."""
    sighted = {"care": (9, 1), "rows": (6, 0), "place": (5, None)}
    played = [
        play(scene, policy, found(10, count), [count] * 10)
        for policy, counts in sighted.items()
        for scene, count in zip(("easy", "hard"), counts, strict=True)
        if count is not None
    ]
    for ratio in (FIRST_SIGHTING, OVERALL):
        assert plays(played).best_control(Recall(ratio), 0.1) == "rows"
    apart = [row for row in played if (row["policy"], row["scene"]) != ("rows", "easy")]
    assert plays(apart).best_control(Recall(FIRST_SIGHTING), 0.1) is None
    assert over_controls(plays(apart)) == []


def test_a_measure_of_which_there_is_nothing_is_left_out():
    """Scenes without an event have no first sightings; without object frames nothing at all."""
    nothing = dict.fromkeys(("events", "sighted", "delay"), 0.0) | {"ttfds": ()}
    quiet = [row | nothing for row in PLAYS]
    assert [each.ratio for each in over_controls(plays(quiet))] == [OVERALL]
    empty = [row | dict.fromkeys(("frames", "found"), 0.0) for row in quiet]
    assert over_controls(plays(empty)) == []


CONTROL = {"tags": "causal+control"}


def of_seeds(fan, stride):
    played = [
        *rows("random", fan, changes={"policy": "fan", **CONTROL}),
        *rows("random", stride, changes={"policy": "stride", **CONTROL}),
    ]
    frame = Frame(played)
    (setting,) = {key[0] for key in frame.groups}
    return Part(frame, setting).best_control(DETECTION, 0.03)


def test_a_missed_actor_counts_as_in_differences():
    """At 3 m for the actor that it missed the mean of the fan is 7.8 m; at 4.5 m it is 8.1 m."""
    assert of_seeds([9.0, 9.0, 9.0, 9.0, None], [10.0, 9.0, 10.0, 9.0, 2.0]) == "stride"
    assert of_seeds([9.0, 9.0, 9.0, 9.0, 4.5], [10.0, 9.0, 10.0, 9.0, 2.0]) == "fan"
