"""Tables of a sweep."""

import io

import pytest
from rich.console import Console

from care_sim.reports.table import Bold
from care_sim.reports.tables.sweep import sweep_tables
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.rows.reading import setting_of
from tests.helpers.made_rows import STUDY, row, rows

ORACLE = rows(
    "history",
    [9.0, 10.0, 11.0, 12.0, 13.0],
    changes={"policy": "history-oracle", "tags": "privileged"},
)


def levels(study=STUDY):
    table = sweep_tables(study)[0]
    return {line[1]: dict(zip(table.columns, line, strict=True)) for line in table.rows}


def blocks(study=STUDY):
    """Entries of the contrast table by block and policy."""
    found, block = {}, ""
    for line in sweep_tables(study)[1].rows:
        if len(line) == 1:
            block = line[0]
        else:
            found[block, line[0]] = line[1:]
    return found


def test_other_physics_are_another_setting():
    config = EpisodeConfig("dense", "care", scenario_parameters=(("vehicles", 7),))
    assert setting_of(row(config, 1.0)) != setting_of(row(EpisodeConfig("dense", "care"), 1.0))
    assert sweep_tables([row(config, 1.0)])[0].title == "dense, vehicles 7"


def test_levels_stand_beside_the_papers_figures():
    lines = levels()
    assert lines["all-camera"]["first detection m"] == "12.0 [11.0, 13.0]"
    assert lines["all-camera"]["paper"] == "10.3"
    assert (lines["history"]["never"], lines["history"]["regret m"]) == ("2/5", "≥12.3")
    assert (lines["care"]["regret m"], lines["care"]["as full"]) == ("0.1", "4/5")
    assert lines["full"]["regret m"] == ""
    table = sweep_tables(STUDY)[0]
    assert any("10.3 m" in quote for quote in table.quotes)
    assert "| 3% | history | 4.0 [n.d., 6.0] | 2/5 |" in table.markdown()


@pytest.mark.parametrize(
    ("distances", "text"),
    [
        ([None] * 5, "not detected"),
        ([None, None, None, 8.0, 9.0], "not detected [n.d., 8.0]"),
        ([None, 7.0, 8.0, 9.0, 9.5], "8.0 [7.0, 9.0]"),
    ],
)
def test_a_quantile_on_a_miss_reads_not_detected(distances, text):
    assert levels(rows("care", distances))["care"]["first detection m"] == text


def test_care_is_compared_with_every_policy_at_every_budget():
    study = [
        *STUDY,
        *rows("care", [15.0] * 5, budget=0.1),
        *rows("history", [14.0] * 5, budget=0.1),
    ]
    found = blocks(study)
    assert sweep_tables(study)[1].columns == ("care minus", "3%", "10%")
    assert found["First detection, m", "all-camera"] == ("+5.0* [5.0,5.0]", "")
    assert found["First detection, m", "history"][1] == "+1.0 [1.0,1.0]"
    assert [isinstance(entry, Bold) for entry in found["First detection, m", "history"]] == [
        True,
        True,
    ]
    assert found["First detection, m", "history"][0].startswith("≥+12.2* [")
    assert found["First detection, m", "full"][0].startswith("-0.1 [-0.3,0.0]")
    assert not isinstance(found["First detection, m", "full"][0], Bold)
    assert found["Braked, points", "history"] == ("+0 [0,0]",) * 2
    assert found["Detected, points", "history"][0].startswith("+40 [0,80]")


def test_the_full_scan_alone_has_nothing_to_regret():
    (table,) = sweep_tables([row for row in STUDY if row["policy"] == "full"])
    assert table.notes == ()
    (table,) = sweep_tables([row for row in STUDY if row["policy"] == "history"])
    assert table.notes == ("Regret: full not run.",)


def test_a_full_scan_that_was_run_is_not_said_to_be_missing():
    """On other seeds than the policy, so that there is no regret."""
    history, full = ([one for one in STUDY if one["policy"] == p] for p in ("history", "full"))
    table, *_ = sweep_tables([*history[:2], *full[2:]])
    assert table.notes == ()


def test_a_drive_that_meets_nobody_is_told():
    nobody = {"detection_distance_m": None, "undetected_to_m": None}
    met, row = rows("full", [9.0, 9.0], scenario="drive")
    table, *_ = sweep_tables([met, row | nobody])
    (note,) = table.notes
    assert note.startswith("1 of 2 episodes have no first-sighting actor: first detection")


def test_what_is_learned_is_compared_with_every_policy_too():
    learned = rows(
        "learned-scorer", [14.0, 15.0, 16.0, 17.0, 18.0], changes={"tags": "causal+learned"}
    )
    found = {table.title: table for table in sweep_tables([*STUDY, *learned])}
    assert [title for title in found if "minus" in title] == [
        "dense: care minus each policy",
        "dense: learned-scorer minus each policy",
    ]
    of_care, of_learned = (
        {line[0]: line[1:] for line in reversed(found[f"dense: {name} minus each policy"].rows)}
        for name in ("care", "learned-scorer")
    )
    assert of_care["learned-scorer"] == ("+1.0 [1.0,1.0]",)
    assert of_learned["care"] == ("-1.0 [-1.0,-1.0]",)
    assert "full" in of_learned
    assert "learned-scorer" not in of_learned


def test_detection_rates_are_compared_only_where_somebody_missed():
    assert ("Detected, points", "history") in blocks()
    everybody = [row for row in STUDY if row["policy"] != "history"]
    assert ("Detected, points", "all-camera") not in blocks(everybody)


def collided(policy, seeds):
    """Five episodes, of which those of `seeds` end in a collision."""
    return [each | {"collision": each["seed"] in seeds} for each in rows(policy, [15.0] * 5)]


COLLISIONS = [*collided("care", {4}), *collided("history", {1, 2, 4})]


def test_collisions_are_compared_where_somebody_was_hit():
    assert not any("ollision" in block for block, _ in blocks())
    assert blocks(COLLISIONS)["Collisions avoided, points", "history"][0].startswith("+40 [0,80]")


def test_preventable_are_the_collisions_that_the_full_scan_avoids_on_the_same_seed():
    """It collides on seeds 3 and 4: of the other three, history collides on two."""
    found = blocks([*COLLISIONS, *collided("full", {3, 4})])
    assert found["Preventable collisions avoided, points", "history"][0].startswith("+67 [")
    assert found["Preventable collisions avoided, points", "full"] == ("+0 [0,0]",)


@pytest.mark.parametrize(("study", "shown"), [(COLLISIONS, True), (STUDY, False)])
def test_the_terminal_shows_collisions_where_there_are_any(study, shown):
    terminal = io.StringIO()
    Console(width=80, file=terminal).print(sweep_tables(study)[0].rich())
    assert ("collisions" in terminal.getvalue()) is shown


def test_without_care_or_another_policy_there_is_no_contrast():
    assert len(sweep_tables([row for row in STUDY if row["policy"] != "care"])) == 1
    assert len(sweep_tables(rows("care", [15.0]))) == 1


def test_policies_that_no_car_can_have_are_marked():
    table, contrasts = sweep_tables([*STUDY, *ORACLE])
    assert "history-oracle †" in {line[1] for line in table.rows}
    assert "history-oracle †" in {line[0] for line in contrasts.rows}
    assert all(
        "† knows the truth: no policy of a car." in each.notes for each in (table, contrasts)
    )
    assert not any("‡" in note for note in table.notes)


def test_a_pass_that_was_never_in_view_is_said():
    config = EpisodeConfig("cutin", "care")
    seen, unseen = row(config, 9.0), row(config, None, min_distance_m=None, clearance_m=None)
    assert levels([unseen])["care"]["pass m"] == "never in view"
    assert levels([seen, unseen | {"seed": 1}])["care"]["pass m"] == "5.0 (of 1)"


CONTROL = {"tags": "causal+control"}
CONTROLS = [
    *rows("random", [9.0, 9.0, 9.0, 9.0, None], changes={"policy": "fan", **CONTROL}),
    *rows("random", [10.0, 9.0, 10.0, 9.0, 2.0], changes={"policy": "stride", **CONTROL}),
    *rows("random", [19.0] * 5, changes={"policy": "finder", "tags": "generator+control"}),
]


def over_control(study):
    return [table for table in sweep_tables(study) if "best control" in table.title]


def test_every_policy_is_held_against_the_best_control_of_each_budget():
    """At 3% its mean is 8.0 m; the other has 7.8 m, with 3 m for the actor that it missed."""
    scarce = rows("random", [3.0] * 5, budget=0.01, changes={"policy": "fan", **CONTROL})
    late = rows("care", [5.0] * 5, budget=0.01)
    (table,) = over_control([*STUDY, *CONTROLS, *scarce, *late])
    assert table.title == "dense: each policy minus the best control"
    assert table.columns == ("minus the best control", "1%", "3%")
    heading, *others = table.rows
    assert heading == ("First detection, m",)
    lines = {line[0]: line[1:] for line in others}
    assert {*lines} == {"best control", "history", "all-camera", "care", "finder §", "full"}
    assert lines["best control"] == ("fan", "stride")
    assert lines["care"][0] == "+2.0 [2.0,2.0]"
    assert lines["care"][1].startswith("+9.0* [")
    assert lines["full"][1].startswith("+9.1* [")
    assert lines["history"][0] == ""
    assert lines["history"][1].startswith("≤-3.2")
    assert isinstance(lines["care"][1], Bold)
    assert "hindsight favours the control" in table.notes[0]


def test_the_full_scan_of_the_same_worlds_stands_beside_controls_under_a_camera_fault():
    """The full scan asks no camera and is played once, without the fault."""
    blind = {"false_negative_rate": 0.5}
    late = rows("random", [8.0] * 5, changes={"policy": "fan", **CONTROL}, **blind)
    (table,) = over_control([*STUDY, *late])
    assert table.title.startswith("dense, ")
    assert [line[0] for line in table.rows[1:]] == ["best control", "full"]
    assert table.rows[2][1].startswith("+9.1* [")


def test_controls_alone_and_no_control_have_no_such_table():
    assert over_control(STUDY) == []
    assert over_control(CONTROLS[:10]) == []
