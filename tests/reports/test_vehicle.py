"""The tables of the vehicle study, of rows whose answers are known."""

from itertools import product

import pytest

from care_sim.evaluation.censoring import Bound
from care_sim.reports.engine.contrasts import contrast_of_rows
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.figures.closed_loop import vehicle_figures
from care_sim.reports.vehicle.rows import outcome
from care_sim.reports.vehicle.tables import vehicle_tables
from care_sim.study.designs.vehicle import (
    BLACKOUTS,
    DENSE,
    DRIVES,
    EVIDENCE_LEVELS,
    TURNS,
    vehicle_study,
)
from tests.helpers.made_rows import vehicle_row

SEEDS = range(5)


def noted(config):
    """A made-up law: compensation saves every late turn of 3 cases in 11; the camera's absence
    costs 4 m; an error of the position makes forecasts 1 m wrong.
    """
    late = bool(config.camera_latency or config.camera_latency_s)
    kept = dict(config.policy_parameters).get("yaw_compensation", True)
    test = dict(config.scenario_parameters).get("test")
    return {
        "collision": late and test == "CPTAfs-50" and not kept,
        "evidence_ages_ms": (round(1e3 * config.camera_latency_s),) * 19 + (1000,),
        "boxes": 40,
        "turned_boxes": 10 if late else 0,
        "turned_held": 9 if late else 0,
        "unturned_held": 5 if late else 0,
        "dark_keyframes": 10 if config.blackout_s else 0,
        "dark_alike": 10 if config.blackout_s else 0,
        "dark_entries_alike": (1, 1) if config.blackout_s else (),
        "dark_entry_cells": (2, 30) if config.blackout_s else (),
        "dark_entry_covered": (0, 1) if config.blackout_s else (),
        "apart_after_s": 0.2 if config.blackout_s == 1.0 else None,
        "forecasts": 20,
        "forecast_error_m": 1.0 if config.ego_position_sigma_m else 0.0,
        "forecast_error_p95_m": 2.0 if config.ego_position_sigma_m else 0.0,
        "forecasts_in_eq4": 10,
        "forecasts_in_margin": 15,
        "standing_keyframes": 3,
        "standing_guard_least_m": 4.0,
        "standing_guard_most_m": 4.0,
        "released_cells": 100,
        "released_cells_vehicle": 10,
        **({"progress": 0.5} if config.scenario == "drive" else {}),
    }


def row(seed, distance, most=None):
    return {"seed": seed, "detection_distance_m": distance, "undetected_to_m": most}


def distance(config):
    return 12.0 if config.blackout_s else 16.0


@pytest.fixture(scope="module")
def rows():
    return [
        vehicle_row(config, distance(config), tags="causal", **noted(config))
        for config in vehicle_study(SEEDS)
    ]


NAMES = (
    "evidence", "compensation", "fallback", "cost", "cost in the dart-out", "cost in drives",
    "forecasts", "pose in drives", "pose", "guard",
)  # fmt: skip


@pytest.fixture(scope="module")
def tables(rows):
    return named(rows)


def named(rows):
    return dict(zip(NAMES, vehicle_tables(rows), strict=True))


def block(table, group):
    """The lines under a group's heading, by their first entry."""
    start = table.rows.index((group,)) + 1
    lines = {}
    for line in table.rows[start:]:
        if len(line) == 1:
            break
        lines[line[0]] = line[1:]
    return lines


def test_ages_are_those_of_all_keyframes_and_shares_those_of_all_boxes(tables):
    lines = block(tables["evidence"], TURNS.name)
    # 19 of 20 pictures are 0.42 s old, one is 1 s old.
    assert lines["0.42 s late"] == ("0.45", "0.45", "25.0%", "90.0%", "50.0%")
    assert lines["newest picture"] == ("0.05", "0.05", "0.0%", "", "")


def test_compensation_is_paired_by_case_and_seed_and_resampled_by_case(tables):
    lines = block(tables["compensation"], TURNS.name)
    worlds = len(TURNS.places) * len(SEEDS)
    care, without, *others, metres, points = lines["0.42 s late"]
    assert (care, without) == (f"16.0, 0/{worlds}", f"16.0, {3 * len(SEEDS)}/{worlds}")
    assert others == [f"16.0, 0/{worlds}"] * 2
    assert metres == "+0.0 [0.0,0.0]"
    # 3 cases of 11: of the resamples 3% have none of them, (8/11)^11, and 1% more than 6.
    assert points == "+27 [0,55]"
    assert lines["newest picture"][1] == "", "without lag nothing is played twice"


def test_one_case_on_many_seeds_proves_no_more_than_on_one():
    copies = [{"seed": world, "collision": False} for world in product(range(11), SEEDS)]
    hit = [each | {"collision": each["seed"][0] == 4} for each in copies]
    once = [[each for each in side if each["seed"][1] == 0] for side in (copies, hit)]
    found = contrast_of_rows(AVOIDED, copies, hit, by_cases=True)
    assert (
        found == contrast_of_rows(AVOIDED, *once, by_cases=True) == contrast_of_rows(AVOIDED, *once)
    )
    assert found.mean == pytest.approx(100 / 11)
    assert not found.excludes_zero
    assert contrast_of_rows(AVOIDED, copies, hit).excludes_zero
    assert contrast_of_rows(AVOIDED, copies, [], by_cases=True) is None


def test_a_case_with_a_censored_distance_is_censored():
    ours = [row((case, seed), 10.0) for case in range(5) for seed in (0, 1)]
    theirs = [row((case, 0), None, 4.0) for case in range(5)]
    theirs += [row((case, 1), 8.0) for case in range(5)]
    # The seed 2 of a case that only one side has is no pair.
    found = contrast_of_rows(DETECTION, [*ours, row((0, 2), 99.0)], theirs, by_cases=True)
    assert (found.mean, found.bound, found.difference.pairs) == (4.0, Bound.AT_LEAST, 5)


def test_a_median_of_some_episodes_tells_of_how_many():
    met = row(0, 12.0) | {"collision": False}
    assert outcome([met, met]) == "12.0, 0/2"
    nobody = met | {"detection_distance_m": None, "undetected_to_m": None}
    assert outcome([met, nobody]) == "12.0 (1), 0/2"
    assert outcome([nobody]) == "- (0), 0/1"


def test_a_camera_that_is_away_leaves_one_policy(tables):
    table = tables["fallback"]
    lines = {line[0]: line[1:] for line in table.rows}
    times = BLACKOUTS[DENSE][1].label
    alike = ("50 of 50", "10 of 10", "2 [2, 2] (5)", "30 [30, 30] (5)")
    assert lines[f"{DENSE.name}: {times}"] == (*alike, "0.2 (5 of 5)")
    assert lines[f"{DENSE.name}: away throughout"] == (*alike, "")
    assert f"{DENSE.name}: camera on" not in lines
    assert lines["(paper)"] == ("", "37 of 37", "1 to 5", "117 to 123", "")


def test_the_cost_is_the_camera_on_less_the_camera_away(tables):
    table = tables["cost"]
    assert table.title.startswith(DENSE.name)
    (care, *_) = table.rows
    assert care == ("care", "16.0, 0/5", "12.0, 0/5", "12.0, 0/5", "+4.0* [4.0,4.0]", "+0 [0,0]")


def test_forecasts_and_what_is_released_are_means(tables):
    lines = block(tables["forecasts"], DRIVES.name)
    told = ("50.0%", "75.0%", "10.0", "1.0", "50%", "30.0%")
    assert lines["exact pose"] == ("0.00", "0.00", *told)
    assert lines["0.4 m, anew"] == ("1.00", "2.00", *told)
    assert block(tables["forecasts"], DENSE.name)["exact pose"][-2:] == ("", "")


def test_the_guard_is_told_beside_the_papers(tables, rows):
    (here, paper) = tables["guard"].rows
    assert here == ("here", f"{3 * len(rows):,}", "4.00 to 4.00")
    assert paper == ("(paper)", "570", "4.00")
    off = [*rows, rows[0] | {"standing_guard_most_m": 4.2}]
    assert named(off)["guard"].rows[0][2] == "4.00 to 4.20"


def test_without_a_forecast_or_a_picture_there_is_no_number():
    bare = named([vehicle_row(config, 9.0) for config in vehicle_study([0])])
    assert block(bare["evidence"], TURNS.name)["0.42 s late"] == ("", "", "", "", "")
    lines = block(bare["forecasts"], DENSE.name)
    assert lines["exact pose"] == ("", "", "", "", "0.0", "0.0", "", "")
    assert len(bare["fallback"].rows) == 1
    assert bare["guard"].rows[0] == ("here", "0", "")


def test_the_figure_shows_every_late_level(rows):
    held, errors = vehicle_figures(rows)["vehicle"].axes
    late = [level.label for level in EVIDENCE_LEVELS if "late" in level.label]
    assert [text.get_text() for text in held.get_xticklabels()] == late
    compensated, without, *_ = held.get_lines()
    assert set(compensated.get_ydata()) == {90.0}
    assert set(without.get_ydata()) == {50.0}
    assert errors.get_lines()[0].get_ydata().max() == 1.0
