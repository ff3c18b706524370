"""The tables of the vehicle study, of rows with known answers. The published rows hold the
numbers.
"""

from itertools import product

import pytest

from care_sim.evaluation.censoring import Bound
from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.figures.closed_loop import vehicle_figures
from care_sim.reports.tables.vehicle import vehicle_tables
from care_sim.study.designs.vehicle import DENSE, TURNS, vehicle_study
from tests.helpers.made_rows import vehicle_row

SEEDS = range(5)


def noted(config):
    """A made-up law: compensation saves every late turn of 3 cases in 11; the camera's absence
    costs 4 m; an error of the position makes forecasts wrong, by 82 m where there is but one.
    """
    late = bool(config.camera_latency or config.camera_latency_s)
    kept = dict(config.policy_parameters).get("yaw_compensation", True)
    test = dict(config.scenario_parameters).get("test")
    few = config.seed == 0
    return {
        "collision": late and test == "CPTAfs-50" and not kept,
        "turned_boxes": 10 * late,
        "turned_held": 9 * late,
        "unturned_held": 5 * late,
        "forecasts": 1 if few else 20,
        "forecast_error_m": (82.0 if few else 1.0) * bool(config.ego_position_sigma_m),
        "forecast_error_p95_m": 2.0,
        "standing_keyframes": 3,
        "standing_guard_least_m": 4.0,
        "standing_guard_most_m": 4.2 if few else 4.0,
    }


@pytest.fixture(scope="module")
def rows():
    return [
        vehicle_row(config, 12.0 if config.blackout_s else 16.0, **noted(config))
        for config in vehicle_study(SEEDS)
    ]


def lines(rows, title, heading):
    """The lines under a heading of a table, by their first entry."""
    (table,) = (table for table in vehicle_tables(rows) if table.title.startswith(title))
    start = table.rows.index((heading,)) + 1 if heading else 0
    end = next((n for n, line in enumerate(table.rows) if n > start and len(line) == 1), None)
    return {line[0]: line[1:] for line in table.rows[start:end]}


def test_compensation_is_paired_by_case_and_seed_and_resampled_by_case(rows):
    found = lines(rows, "What compensation", TURNS.name)
    worlds = len(TURNS.places) * len(SEEDS)
    late = found["0.42 s late"]
    assert late[:2] == (f"16.0, 0/{worlds}", f"16.0, {3 * len(SEEDS)}/{worlds}")
    # 3 cases of 11: of the resamples 3% have none of them, (8/11)^11, and 1% more than 6.
    assert late[-2:] == ("+0.0 [0.0,0.0]", "+27 [0,55]")
    assert found["newest picture"][1] == "", "without lag nothing is played twice"


def test_one_case_on_many_seeds_proves_no_more_than_on_one():
    copies = [{"seed": world, "collision": False} for world in product(range(11), SEEDS)]
    hit = [each | {"collision": each["seed"][0] == 4} for each in copies]
    once = [[each for each in side if each["seed"][1] == 0] for side in (copies, hit)]
    assert contrast_of_rows(AVOIDED, copies, hit, by_cases=True) == contrast_of_rows(AVOIDED, *once)


def test_a_case_with_a_censored_distance_is_censored():
    met = {"detection_distance_m": 10.0, "undetected_to_m": None}
    missed = {"detection_distance_m": None, "undetected_to_m": 4.0}
    ours = [met | {"seed": world} for world in product(range(5), (0, 1))]
    theirs = [(missed if each["seed"][1] else met) | {"seed": each["seed"]} for each in ours]
    # A seed that only one side has is no pair.
    further = met | {"seed": (0, 2), "detection_distance_m": 99.0}
    found = contrast_of_rows(DETECTION, [*ours, further], theirs, by_cases=True)
    assert (found.mean, found.bound, found.difference.pairs) == (3.0, Bound.AT_LEAST, 5)


def test_the_cost_is_the_camera_on_less_the_camera_away(rows):
    cost = lines(rows, f"{DENSE.name}: what a camera", "")["care"]
    assert cost == ("16.0, 0/5", "12.0, 0/5", "12.0, 0/5", "+4.0* [4.0,4.0]", "+0 [0,0]")
    nobody = {"detection_distance_m": None, "undetected_to_m": None}
    some = [each | nobody if each["seed"] else each for each in rows]
    assert lines(some, f"{DENSE.name}: what a camera", "")["care"][0] == "16.0 (1), 0/5"


def test_every_forecast_weighs_the_same(rows):
    forecasts = lines(rows, "Forecasts", DENSE.name)
    assert [forecasts[name][0] for name in ("exact pose", "0.4 m, anew")] == ["0.00", "2.00"]
    told = (f"{3 * len(rows):,}", "4.00 to 4.20")
    assert lines(rows, "The guard", "") == {"here": told, "(paper)": ("570", "4.00")}


def test_without_a_forecast_or_a_picture_there_is_no_number():
    bare = [vehicle_row(config, 9.0) for config in vehicle_study([0])]
    assert lines(bare, "Evidence", TURNS.name)["0.42 s late"] == ("", "", "", "", "")
    assert lines(bare, "Forecasts", DENSE.name)["exact pose"][:5] == ("", "", "", "", "0.0")
    assert [*lines(bare, "Allocations", "")] == ["(paper)"]
    assert lines(bare, "The guard", "")["here"] == ("0", "")


def test_the_figure_shows_every_late_level(rows):
    held, errors = vehicle_figures(rows)["vehicle"].axes
    assert [{*line.get_ydata()} for line in held.get_lines()[:2]] == [{90.0}, {50.0}]
    assert errors.get_lines()[0].get_ydata().max() == 2.0
