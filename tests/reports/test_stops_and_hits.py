"""A stop for nothing, and a collision that another body causes, as tables count them."""

from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import levels
from care_sim.reports.engine.measures import AVOIDED
from care_sim.reports.findings import collisions
from care_sim.reports.tables.ncap import impact_of
from care_sim.reports.tables.r157 import r157_tables
from care_sim.study.rows.reading import preventable
from tests.helpers.made_rows import cut_ins, rows
from tests.reports.tables.test_ncap import played

STOPPED = {"braked_before_view": True}


def test_a_stop_for_nothing_is_no_detection():
    (cell,) = levels(Frame([*rows("care", [15.0, 16.0]), *rows("care", [14.0], changes=STOPPED)]))
    assert (cell.met, cell.never, cell.braked) == (3, 1, 3)


def test_a_stop_for_nothing_avoids_no_collision():
    honest, stopped = rows("care", [15.0]), rows("fan", [15.0], changes=STOPPED)
    assert contrast_of_rows(AVOIDED, honest, stopped).mean == 100.0
    assert preventable(stopped, honest) == []
    outcomes, speeds = r157_tables(cut_ins("care", [None] * 4, **STOPPED))
    assert outcomes.rows[1][1:5] == ("4", "0.0%", "0", "4")
    assert speeds.rows[1][1:] == ("0/2", "0/2")
    (row,) = played("care", "CPNCO-50", [None])
    assert impact_of(row) == (None, 20.0 / 3.6)
    assert impact_of(row | STOPPED) == (20.0 / 3.6, 20.0 / 3.6)


def test_stops_for_nothing_and_who_ran_into_the_car_are_counted():
    hit_by = {"collision": True, "hit_at_front": False}
    study = [*rows("care", [9.0, 9.0], changes=STOPPED), *rows("full", [9.0], changes=hit_by)]
    assert collisions(study) == [
        "Collisions: 1 in 3 episodes; in 1 another body ran into the car; 2 stops for nothing, "
        "which avoid none."
    ]
