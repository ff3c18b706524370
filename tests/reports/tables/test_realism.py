"""Orders under realistic conditions, on rows made by hand. The published rows hold the numbers."""

import pytest

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.scene_contrasts import OVERALL
from care_sim.reports.engine.contrasts import of_interval
from care_sim.reports.engine.measures import Recall
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.realism import Order, realism_tables
from care_sim.study.designs.realism import (
    FILM_CONDITIONS,
    HEADLINES,
    IDEAL,
    LATE_CAMERA,
    realism_study,
)
from tests.helpers.made_plays import study
from tests.helpers.made_rows import row


def distance(config):
    """With an ideal camera CARE is 6 m before history, with a late one a metre behind."""
    late = config.camera_latency_s and not config.lidar_sweep_s
    return 9.0 if config.policy == "history" else 8.0 if config.policy == "care" and late else 15.0


DENSE = [each for each in HEADLINES if each.name == "dense, 3%"]
ROWS = [row(each, distance(each)) for each in realism_study(range(5), ["rows"], DENSE)]
LATE = LATE_CAMERA.label


def titled(tables, part):
    (table,) = (table for table in tables if part in table.title)
    return table


def lines(tables, part):
    table = titled(tables, part)
    named = (line for line in table.rows if len(line) > 1)
    return {line[0]: dict(zip(table.columns, line, strict=True)) for line in named}


@pytest.mark.parametrize(
    ("before", "here", "pairs", "verdict"),
    [
        ((1.0, 3.0), (1.0, 2.0), 5, "holds"),
        # An interval that ends at zero is no lead.
        ((1.0, 3.0), (0.0, 2.0), 5, "lost"),
        ((1.0, 3.0), (-2.0, -1.0), 5, "flips"),
        ((-1.0, 3.0), (-2.0, -1.0), 5, "arises"),
        ((-1.0, 3.0), (-2.0, 1.0), 5, "tied"),
        ((1.0, 3.0), (1.0, 2.0), 4, None),
    ],
)
def test_an_order_holds_is_lost_flips_or_arises(before, here, pairs, verdict):
    standings = {
        name: of_interval(Recall(OVERALL), Interval(sum(ends) / 2, *ends), pairs)
        for name, ends in (("ideal", before), ("here", here))
    }
    order = Order("", ("a", "b"), standings)
    assert order.verdict("here") == verdict
    assert order.verdict("ideal") is order.verdict("not played") is None


def test_a_change_of_the_order_is_told_with_the_figures_behind_it():
    # Full scans of another scenario alone make no table of it.
    alone = [each | {"scenario": "cutin", "budget": 1.0} for each in ROWS]
    alone = [each for each in alone if each["policy"] == "full"]
    tables = realism_tables([*ROWS, *alone])
    orders = lines(tables, "by condition")
    assert [*orders] == [
        f"dense, 3%: care : {each}" for each in ("history", "all-camera", "fan", "rows")
    ]
    led = orders["dense, 3%: care : history"]
    assert isinstance(led["ideal"], Bold)
    assert (led["ideal"], led[LATE]) == ("+6.0* [6.0,6.0]", "-1.0 [-1.0,-1.0] flips")
    changed = titled(tables, "that change").rows
    assert changed[0] == (
        *("dense, 3%: care : history", LATE),
        *("+6.0* [6.0,6.0]", "-1.0 [-1.0,-1.0]", "flips"),
    )
    assert [line[-1] for line in changed] == ["flips", "arises", "arises", "arises"]
    second = lines(tables, "realistic camera")
    assert [*second["care"].values()] == ["care", "15.0", "8.0", "-7.0* [-7.0,-7.0]"]
    assert titled(tables, "every condition").rows[0] == ("dense, 3%",)
    assert sum(len(line) == 1 for line in titled(tables, "every condition").rows) == 1


def test_a_map_is_made_of_the_same_rows():
    (figure,) = STUDIES["realism"].figures(ROWS).values()
    assert figure.axes[0].texts[0].get_text() == "+6.0*"
    assert STUDIES["realism"].figures([]) == {}


def test_recalls_of_the_open_loop_have_their_own_blocks():
    late, fog = (
        next(each for each in FILM_CONDITIONS if each.label == label)
        for label in ("yolox camera, 0.5 s late", "range 40 m, visibility 50 m")
    )
    common = {"budgets": (0.03,), "seeds": (0,)}
    plays = [
        *study({"care": (8, 8), "history": (2, 4)}, **common),
        *study({"care": (1, 5), "history": (2, 4)}, **common, **late.changes),
        *study({"full": (9, 9)}),
        # Fog returns less to a full scan, too; another film is no changed data.
        *study({"care": (1, 1)}, **common, film_hash="fog", **fog.changes),
        *study({"full": (3, 3)}, film_hash="fog", **fog.changes),
    ]
    # Another sensor is no condition.
    other = {"sensor": "os1-64", "sensor_hash": "abcdef012345"}
    tables = realism_tables([each | other for each in plays])
    orders = titled(tables, "by condition")
    assert orders.columns == ("order", IDEAL.label, late.label, fog.label)
    assert orders.rows == (
        ("First sightings",),
        ("3%: care : history", "+30.0 [30.0,30.0]", "-5.0 [-5.0,-5.0] flips", ""),
        ("Overall recall",),
        ("3%: care : history", "+40.0 [40.0,40.0]", "+10.0 [10.0,10.0] holds", ""),
    )
    assert titled(tables, "by verdict").rows[0] == ("First sightings", "0", "1", "0", "0", "0")
    every = titled(tables, "every condition").rows
    assert every[0] == ("First sightings, 3%",)
    assert every[3] == ("full", "45.0", "45.0", "15.0")
