"""Orders under realistic conditions, on rows made by hand."""

import pytest

from care_sim.reports.page.build import Findings
from care_sim.reports.realism import episodes, plays
from care_sim.reports.realism.orders import Order, Standing, Verdict, changes, of_plays
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
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


def lines(table):
    return {line[0]: dict(zip(table.columns, line, strict=True)) for line in table.rows}


@pytest.fixture(scope="module")
def tables():
    return episodes.realism_tables(ROWS)


def test_an_order_holds_is_lost_flips_or_arises(tables):
    entries = lines(tables[0])
    led = "dense, 3%: care : history"
    assert entries["ideal"][led] == Bold("+6.0* [6.0,6.0]")
    assert isinstance(entries["ideal"][led], Bold)
    assert entries[LATE_CAMERA.label][led] == "-1.0 [-1.0,-1.0] flips"
    assert entries["fires tiles:4x8"][led].endswith("] lost")
    assert entries["sweep of 0.1 s"][led] == "+6.0* [6.0,6.0] holds"
    tie = "dense, 3%: care : fan"
    assert entries["ideal"][tie] == "+0.0 [0.0,0.0]"
    assert entries["sweep of 0.1 s"][tie] == "-2.0 [-2.0,-2.0] arises"
    assert entries["range 40 m"][tie] == "+0.0 [0.0,0.0] tied"


def test_a_line_a_condition_and_a_column_an_order(tables):
    assert [line[0] for line in tables[0].rows] == [level.label for level in CONDITIONS]
    assert tables[0].columns[1:3] == ("dartout, 10%: care : history", "dartout, 10%: care : fan")
    assert tables[0].columns[-1] == "drive, 1%: care : history"


def test_collisions_tell_the_order_of_tests_and_drives(tables):
    entries = lines(tables[0])["ideal"]
    assert entries["drive, 1%: care : history"] == "+100* [100,100]"
    # Four of the 19 tests.
    assert entries["ncap, 1%: care : history"].startswith("+21* [")


def test_what_was_not_played_is_left_empty(tables):
    entries = lines(tables[0])["fires rows"]
    assert entries["drive, 1%: care : history"] == entries["ncap, 1%: care : history"] == ""
    assert entries["ncap, 3%: care : history"]


def test_orders_that_change_stand_by_themselves_the_flipped_ones_first(tables):
    found = [line[-1] for line in tables[1].rows]
    assert found == sorted(found, key=["flips", "lost", "arises"].index)
    assert {*found} == {"flips", "lost", "arises"}
    assert tables[1].rows[0] == (
        "dartout, 10%: care : history",
        LATE_CAMERA.label,
        "+6.0* [6.0,6.0]",
        "-1.0 [-1.0,-1.0]",
        "flips",
    )


def test_the_second_column_is_that_of_the_camera(tables):
    second = tables[2]
    assert second.columns == ("policy", "ideal", LATE_CAMERA.label, "change, m or points")
    start = second.rows.index(("dense, 3%",))
    assert second.rows[start + 1] == ("history", "9.0", "9.0", "+0.0 [0.0,0.0]")
    assert second.rows[start + 3] == ("care", "15.0", "8.0", "-7.0* [-7.0,-7.0]")
    start = second.rows.index(("drive, 1%",))
    assert second.rows[start + 1][:3] == ("history", "0/6", "0/6")
    assert second.rows[start + 3][:3] == ("care", "6/6", "6/6")


def test_every_figure_stands_under_every_condition(tables):
    entries = tables[3]
    assert entries.columns == ("policy", *(level.label for level in CONDITIONS))
    start = entries.rows.index(("dense, 3%",))
    assert entries.rows[start + 5] == ("full", *["15.0"] * len(CONDITIONS))


def test_fewer_than_five_seeds_carry_no_verdict():
    few = [each for each in ROWS if each["seed"] % 100 < 4]
    first, *others = episodes.realism_tables(few)
    words = " ".join(entry for line in first.rows for entry in line[1:] if "ncap" not in entry)
    assert "flips" not in words
    # The tests of Euro NCAP are nineteen worlds of one seed.
    entries = lines(first)["range 40 m"]
    assert entries["ncap, 1%: care : history"].endswith("holds")
    assert entries["dense, 3%: care : history"] == "+6.0 [6.0,6.0]"
    assert [table.title for table in others] == [
        "Closed loop: the ideal and a realistic camera, median first detection, m, or collisions "
        "avoided",
        "Closed loop: every condition, median first detection, m, or collisions avoided",
    ]


def test_one_seed_has_no_interval():
    one = [each for each in ROWS if each["seed"] % 100 == 0 and each["scenario"] == "dense"]
    first, *others = episodes.realism_tables(one)
    assert lines(first)["range 40 m"]["dense, 3%: care : history"] == "+6.0"
    assert not any("[" in entry for table in others for line in table.rows for entry in line)


def test_policies_that_join_in_are_set_beside_care():
    joined = [each | {"policy": "rows"} for each in STREETS if each["policy"] == "fan"]
    columns = episodes.realism_tables([*STREETS, *joined])[0].columns
    assert columns[1:4] == tuple(
        f"dartout, 10%: care : {other}" for other in ("history", "fan", "rows")
    )
    assert "dense, 5%: care : rows" in columns


def test_the_closing_counts_verdicts():
    (said,) = [each for each in episodes.realism_closing(STREETS) if "leads" in each]
    orders = episodes.RealismEpisodes(STREETS).orders()[""]
    found = [*changes(orders)]
    flips = sum(verdict is Verdict.FLIPS for _, _, verdict in found)
    # CARE falls behind history in the three tables with a late camera alone.
    assert flips == 3
    assert f"and {flips} flip; of" in said


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
    orders, changed, second, _ = plays.realism_tables(PLAYS)
    assert orders.columns == ("condition", "3%: care : history", "3%: care : place")
    assert orders.rows == (
        ("first-sighting recall",),
        ("ideal", "+30.0 [30.0,30.0]", "+0.0 [0.0,0.0]"),
        ("yolox camera, 0.5 s late", "-5.0 [-5.0,-5.0] flips", "-35.0 [-35.0,-35.0] arises"),
        ("overall recall",),
        ("ideal", "+40.0 [40.0,40.0]", "+40.0 [40.0,40.0]"),
        ("yolox camera, 0.5 s late", "+10.0 [10.0,10.0] holds", "+10.0 [10.0,10.0] holds"),
    )
    assert changed.rows[0] == ("first-sighting recall",)
    assert len(changed.rows) == 3
    assert second.columns[:3] == ("policy", "ideal", "yolox camera, 0.5 s late")
    assert second.rows[0] == ("first-sighting recall, 3%",)
    assert second.rows[1] == ("care", "40.0", "5.0", "-35.0 [-35.0,-35.0]")
    assert second.rows[4] == ("full", "45.0", "45.0", "+0.0 [0.0,0.0]")


def test_the_open_loop_closes_with_a_sentence_a_measure():
    said = plays.realism_closing(PLAYS)
    assert said[-2].startswith("first-sighting recall: of 1 leads under a condition 0 hold")
    assert said[-1].startswith("overall recall: of 2 leads under a condition 2 hold")


def test_plays_with_another_sensor_are_found_too():
    other = {"sensor": "os1-64", "sensor_hash": "abcdef012345"}
    tables = plays.realism_tables([each | other for each in PLAYS])
    assert tables[0].rows == plays.realism_tables(PLAYS)[0].rows


def test_the_ceiling_is_that_of_the_films_own_returns():
    """What comes back in fog is less for a full scan, too; another film is no changed data."""
    fog = BY_LABEL["range 40 m, visibility 50 m"]
    rows = [
        *PLAYS,
        *of_condition(fog, {"care": (1, 1)}, film_hash="fog"),
        *study({"full": (3, 3)}, film_hash="fog", **dict(fog.changes)),
    ]
    entries = {line[0]: line for line in plays.realism_tables(rows)[3].rows[1:5]}
    assert entries["full"] == ("full", "45.0", "45.0", "15.0")


def test_four_scenes_carry_no_verdict():
    few = [each for each in PLAYS if each["scene"] < "scene 004"]
    words = " ".join(entry for line in plays.realism_tables(few)[0].rows for entry in line)
    assert not {*words.split()} & {*map(str, Verdict)}


def test_an_interval_that_ends_at_zero_is_no_lead():
    class Difference:
        interval = (0.0, 0.0, 1.0)
        sign = 0

    assert of_plays(Difference()).sign == 0
    standing = {"ideal": Standing(Difference(), 1), "here": Standing(Difference(), 0)}
    assert Order("", ("a", "b"), standing).verdict("here") is Verdict.LOST
