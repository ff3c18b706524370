import pytest

from care_sim.core.conditions import LOCALISATION, RETURN_SETTINGS, Sensing
from care_sim.reports.engine.frames import Frame
from care_sim.reports.figures.closed_loop import fault_figures
from care_sim.reports.studies import STUDIES
from care_sim.reports.table import Bold
from care_sim.reports.tables.faults import fault_tables, order
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, fault_study
from tests.helpers.drawn import heights
from tests.helpers.made_rows import row

MISSED = FAULTS[0]
DARTOUT, DENSE = FAULT_PLACES


def distance(config):
    """A made-up law: CARE falls behind all-camera at 0.6 missed objects and behind history at 1."""
    if config.policy in ("history", "full"):
        return {"history": 8.0, "full": 16.0}[config.policy]
    missed = config.false_negative_rate if config.false_negative_burst == 1 else 0.0
    if config.policy == "all-camera":
        return 14.0
    return None if missed == 1.0 else 11.0 if missed >= 0.6 else 16.0 + config.ego_speed_sigma * 4.0


@pytest.fixture(scope="module")
def rows():
    return [
        row(config, distance(config), braked=config.policy != "history")
        for config in fault_study(range(5), ["care-sbf"])
    ]


def test_the_strength_at_which_the_order_changes_is_found(rows):
    study = Frame(rows)
    assert order(("care", "history"), MISSED, DARTOUT, study) == ">, < from 1"
    # 2 m are no order: the gate is 2.5 m.
    assert order(("care", "all-camera"), MISSED, DARTOUT, study) == "=, < from 0.6"
    assert isinstance(order(("care", "all-camera"), MISSED, DARTOUT, study), Bold)
    unchanged = order(("all-camera", "history"), MISSED, DENSE, study)
    assert unchanged == ">"
    assert not isinstance(unchanged, Bold)


@pytest.mark.parametrize(
    ("left_out", "told"),
    [((0.4,), ">, < from 1"), ((0.0,), ">, < from 1"), ((0.8, 1.0), ">"), (None, "")],
)
def test_strengths_that_were_not_played_are_passed_over(rows, left_out, told):
    def is_kept(row):
        other = left_out is not None and row["false_negative_rate"] not in left_out
        return row["policy"] != "care" or other

    kept = Frame([row for row in rows if is_kept(row)])
    assert order(("care", "history"), MISSED, DARTOUT, kept) == told


def test_a_further_policy_is_ordered_and_shown(rows):
    orders, first, *others = fault_tables(rows)
    assert orders.columns[-1] == "care : care-sbf"
    assert len(others) == len(FAULTS) - 1
    assert first.rows[19][:2] == ("history", "+8.0* [8.0,8.0]")
    assert sum(line[0] == "care-sbf" for line in first.rows) == 4 * len(FAULT_PLACES)


def test_every_fault_of_the_sensing_grows_from_none_in_some_panel():
    varied = {name for fault in FAULTS for level in fault.levels for name in level.changes}
    faults = set(Sensing.__dataclass_fields__) - {"engine", "min_returns", "camera_confidence"}
    # The vehicle study varies the pose; returns, the camera's profile and seconds, the tracker
    # have pages.
    elsewhere = {
        *LOCALISATION,
        *RETURN_SETTINGS,
        "camera_profile",
        "camera_latency_s",
        "sweep_mask",
        "clutter",
        "velocity_keyframes",
    }
    assert varied == faults - elsewhere
    for fault in FAULTS:
        values = [float(level.label) for level in fault.levels]
        assert values == sorted(set(values))
        assert values[0] == (1 if "burst" in fault.title else 0)


def test_the_full_scan_is_played_only_where_it_feels_the_fault():
    full = [config for config in fault_study([0]) if config.policy == "full"]
    assert len(full) == len(set(full)) == 2 * (1 + 4 + 3 + 4 + 3)


def test_a_figure_for_every_place_and_measure(rows):
    figures = fault_figures(rows)
    assert tuple(figures) == STUDIES["faults"].figure_names
    missed, *_ = figures["faults-dartout-detection"].axes
    assert heights(missed)["care"] == [16.0, 16.0, 16.0, 11.0, 11.0, 0.0]
    hollow = [line for line in missed.lines if line.get_markerfacecolor() == "none"]
    assert {tuple(line.get_xdata()) for line in hollow} == {(5,)}
