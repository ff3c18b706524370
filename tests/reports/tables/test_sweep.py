"""Tables of a sweep."""

from care_sim.reports.table import Bold
from care_sim.reports.tables.sweep import sweep_tables
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers.made_rows import STUDY, row, rows


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


def collided(policy, seeds):
    """Five episodes, of which those of `seeds` end in a collision."""
    return [each | {"collision": each["seed"] in seeds} for each in rows(policy, [15.0] * 5)]


COLLISIONS = [*collided("care", {4}), *collided("history", {1, 2, 4})]


def test_preventable_are_the_collisions_that_the_full_scan_avoids_on_the_same_seed():
    """It collides on seeds 3 and 4: of the other three, history collides on two."""
    found = blocks([*COLLISIONS, *collided("full", {3, 4})])
    assert found["Preventable collisions avoided, points", "history"][0].startswith("+67 [")
    assert found["Preventable collisions avoided, points", "full"] == ("+0 [0,0]",)


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
