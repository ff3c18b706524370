"""Orders under realistic conditions, on rows made by hand."""

import pytest

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.scene_contrasts import OVERALL
from care_sim.reports.engine.contrasts import of_interval
from care_sim.reports.engine.measures import Recall
from care_sim.reports.page.build import Findings
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.realism import Order, Standing, Verdict, realism_tables
from care_sim.study.designs.realism import (
    CONDITIONS,
    FILM_CONDITIONS,
    IDEAL,
    LATE_CAMERA,
    realism_study,
)
from tests.helpers.made_plays import study
from tests.helpers.made_rows import row

SCATTERED = (-2.0, 2.0, -1.0, 1.0, -3.0, 3.0)
"""By seed: a difference with no sign."""


def distance(config):
    """With an ideal camera CARE is 6 m before history and beside the fan. With a late one it is a
    metre behind history; on tiles neither leads; in the sweep the fan is 2 m before all.
    """
    if config.policy == "history":
        return 9.0
    if config.policy == "fan" and config.lidar_sweep_s and config.camera_profile == "ideal":
        return 17.0
    if config.policy == "care" and config.camera_latency_s and not config.lidar_sweep_s:
        return 8.0
    if config.policy == "care" and config.firing == "tiles:4x8":
        return 9.0 + SCATTERED[config.seed % 100]
    return 15.0


def hit(config):
    """History hits in every drive, and the bicyclists of four tests of Euro NCAP."""
    if config.policy != "history" or config.scenario not in ("drive", "ncap"):
        return False
    return config.scenario == "drive" or dict(config.scenario_parameters)["test"].startswith("CB")


CONFIGS = realism_study(range(6))
ROWS = [row(config, distance(config), collision=hit(config)) for config in CONFIGS]
STREETS = [each for each in ROWS if each["scenario"] in ("dartout", "dense")]


def titled(tables, part):
    (table,) = (table for table in tables if part in table.title)
    return table


def lines(tables, part="by condition"):
    table = titled(tables, part)
    named = (line for line in table.rows if len(line) > 1)
    return {line[0]: dict(zip(table.columns, line, strict=True)) for line in named}


@pytest.fixture(scope="module")
def tables():
    return realism_tables(ROWS)


def test_an_order_holds_is_lost_flips_or_arises(tables):
    led = lines(tables)["dense, 3%: care : history"]
    assert isinstance(led["ideal"], Bold)
    assert led["ideal"] == "+6.0* [6.0,6.0]"
    assert led[LATE_CAMERA.label] == "-1.0 [-1.0,-1.0] flips"
    assert led["fires tiles:4x8"].endswith("] lost")
    assert led["sweep of 0.1 s"] == "+6.0* [6.0,6.0] holds"
    tie = lines(tables)["dense, 3%: care : fan"]
    assert tie["ideal"] == "+0.0 [0.0,0.0]"
    assert tie["sweep of 0.1 s"] == "-2.0 [-2.0,-2.0] arises"
    assert tie["range 40 m"] == "+0.0 [0.0,0.0] tied"


def test_collisions_tell_the_order_of_tests_and_drives(tables):
    entries = lines(tables)
    assert [*entries["drive, 1%: care : history"]] == ["order", *(c.label for c in CONDITIONS)]
    assert entries["drive, 1%: care : history"]["ideal"] == "+100* [100,100]"
    # Four of the 19 tests.
    assert entries["ncap, 1%: care : history"]["ideal"].startswith("+21* [")
    # What was not played is empty.
    assert entries["drive, 1%: care : history"]["fires rows"] == ""
    assert entries["ncap, 3%: care : history"]["fires rows"]


def test_orders_that_change_stand_by_themselves_the_flipped_ones_first(tables):
    changed = titled(tables, "that change")
    found = [line[-1] for line in changed.rows]
    assert found == sorted(found, key=["flips", "lost", "arises"].index)
    assert changed.rows[0] == (
        "dartout, 10%: care : history",
        LATE_CAMERA.label,
        "+6.0* [6.0,6.0]",
        "-1.0 [-1.0,-1.0]",
        "flips",
    )
    counts = lines(tables, "by verdict")[""]
    assert {each: counts[each] for each in ("flips", "lost", "arises")} == {
        each: str(found.count(each)) for each in ("flips", "lost", "arises")
    }
    every = [e for line in lines(tables).values() for e in line.values() if e.endswith("holds")]
    assert counts["holds"] == str(len(every))


def test_the_second_column_is_that_of_the_camera(tables):
    second = titled(tables, "realistic camera")
    assert second.columns == ("policy", "ideal", LATE_CAMERA.label, "change, m or points")
    start = second.rows.index(("dense, 3%",))
    assert second.rows[start + 1] == ("history", "9.0", "9.0", "+0.0 [0.0,0.0]")
    assert second.rows[start + 3] == ("care", "15.0", "8.0", "-7.0* [-7.0,-7.0]")
    start = second.rows.index(("drive, 1%",))
    assert second.rows[start + 1][:3] == ("history", "0/6", "0/6")
    assert second.rows[start + 3][:3] == ("care", "6/6", "6/6")


def test_every_figure_stands_under_every_condition(tables):
    entries = titled(tables, "every condition")
    assert entries.columns == ("policy", *(level.label for level in CONDITIONS))
    start = entries.rows.index(("dense, 3%",))
    assert entries.rows[start + 5] == ("full", *["15.0"] * len(CONDITIONS))


def test_fewer_than_five_seeds_carry_no_verdict():
    few = realism_tables([each for each in ROWS if each["seed"] % 100 < 4])
    entries = lines(few)
    words = [entry for name in entries if "ncap" not in name for entry in entries[name].values()]
    assert not any("flips" in entry for entry in words)
    # The tests of Euro NCAP are nineteen worlds of one seed.
    assert entries["ncap, 1%: care : history"]["range 40 m"].endswith("holds")
    assert entries["dense, 3%: care : history"]["range 40 m"] == "+6.0 [6.0,6.0]"
    assert not any("that change" in table.title for table in few)


def test_one_seed_has_no_interval():
    one = [each for each in ROWS if each["seed"] % 100 == 0 and each["scenario"] == "dense"]
    found = realism_tables(one)
    assert lines(found)["dense, 3%: care : history"]["range 40 m"] == "+6.0"
    others = [table for table in found if "by condition" not in table.title]
    assert not any("[" in entry for table in others for line in table.rows for entry in line)


def test_policies_that_join_in_are_set_beside_care():
    joined = [each | {"policy": "rows"} for each in STREETS if each["policy"] == "fan"]
    orders = [*lines(realism_tables([*STREETS, *joined]))]
    assert orders[:3] == [f"dartout, 10%: care : {other}" for other in ("history", "fan", "rows")]
    assert "dense, 5%: care : rows" in orders


def test_a_page_and_a_map_are_made_of_the_same_rows():
    assert Findings.of(STUDIES["realism"], STREETS).tables
    (figure,) = STUDIES["realism"].figures(STREETS).values()
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts[0] == "+6.0*"
    assert STUDIES["realism"].figures([]) == {}


def of_condition(level, found, **more):
    return study(found, budgets=(0.03,), seeds=(0,), **dict(level.changes), **more)


BASE = {"care": (8, 8), "history": (2, 4), "place": (8, 4)}
LATE = {"care": (1, 5), "history": (2, 4), "place": (8, 4)}
BY_LABEL = {level.label: level for level in FILM_CONDITIONS}
PLAYS = [
    *of_condition(IDEAL, BASE),
    *of_condition(BY_LABEL["yolox camera, 0.5 s late"], LATE),
    *study({"full": (9, 9)}),
]


def test_recalls_of_the_open_loop_have_their_own_blocks():
    tables = realism_tables(PLAYS)
    orders = titled(tables, "by condition")
    assert orders.columns == ("order", "ideal", "yolox camera, 0.5 s late")
    assert orders.rows == (
        ("First sightings",),
        ("3%: care : history", "+30.0 [30.0,30.0]", "-5.0 [-5.0,-5.0] flips"),
        ("3%: care : place", "+0.0 [0.0,0.0]", "-35.0 [-35.0,-35.0] arises"),
        ("Overall recall",),
        ("3%: care : history", "+40.0 [40.0,40.0]", "+10.0 [10.0,10.0] holds"),
        ("3%: care : place", "+40.0 [40.0,40.0]", "+10.0 [10.0,10.0] holds"),
    )
    assert titled(tables, "by verdict").rows == (
        ("First sightings", "0", "1", "0", "1", "0"),
        ("Overall recall", "2", "0", "0", "0", "0"),
    )
    assert [len(line) for line in titled(tables, "that change").rows] == [1, 5, 5]
    second = titled(tables, "realistic camera")
    assert second.columns[:3] == ("policy", "ideal", "yolox camera, 0.5 s late")
    lines = {line[0]: line for line in second.rows[1:5]}
    assert second.rows[0] == ("First sightings, 3%",)
    assert lines["care"] == ("care", "40.0", "5.0", "-35.0 [-35.0,-35.0]")
    assert lines["full"] == ("full", "45.0", "45.0", "+0.0 [0.0,0.0]")


def test_plays_with_another_sensor_are_found_too():
    other = {"sensor": "os1-64", "sensor_hash": "abcdef012345"}
    assert lines(realism_tables([each | other for each in PLAYS])) == lines(realism_tables(PLAYS))


def test_the_ceiling_is_that_of_the_films_own_returns():
    """What comes back in fog is less for a full scan, too; another film is no changed data."""
    fog = BY_LABEL["range 40 m, visibility 50 m"]
    rows = [
        *PLAYS,
        *of_condition(fog, {"care": (1, 1)}, film_hash="fog"),
        *study({"full": (3, 3)}, film_hash="fog", **dict(fog.changes)),
    ]
    every = titled(realism_tables(rows), "every condition")
    entries = {line[0]: line for line in every.rows[1:5]}
    assert entries["full"] == ("full", "45.0", "45.0", "15.0")


def test_four_scenes_carry_no_verdict():
    few = [each for each in PLAYS if each["scene"] < "scene 004"]
    words = " ".join(
        entry for line in lines(realism_tables(few)).values() for entry in line.values()
    )
    assert not {*words.split()} & {*map(str, Verdict)}


def test_an_interval_that_ends_at_zero_is_no_lead():
    ends = of_interval(Recall(OVERALL), Interval(1.0, 0.0, 2.0), 9)
    led = of_interval(Recall(OVERALL), Interval(1.0, 0.5, 2.0), 9)
    standings = {"ideal": Standing.of(led), "here": Standing.of(ends)}
    assert [each.sign for each in standings.values()] == [1, 0]
    assert Order("", ("a", "b"), standings).verdict("here") is Verdict.LOST
