"""Studies of one table under every condition: hardware, order of cells, realism."""

from collections import Counter

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.defaults import AS_DEMANDED, CELLS
from care_sim.core.firing.listing import HARDWARE, settled
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import SensorSetup
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs import firing, realism
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.firing import FIRING_BUDGETS, FIRINGS, ORDERS
from care_sim.study.designs.paper import paper_study
from care_sim.study.rows.reading import key_of
from care_sim.study.run_config import FULL

BY_NAME = {headline.name: headline for headline in realism.HEADLINES}
STREETS = Streets("evaluation")
SCENES = [Scene("street-0000", 0), Scene("street-0001", 1)]


def rows_of(configs):
    assert len(configs) == len(set(configs))
    return [config.row() for config in configs]


def labels(levels):
    return {level.label for level in levels}


def test_the_full_scan_is_played_once_and_belongs_to_every_hardware():
    rows = rows_of(firing.firing_study([0], ["fan"]))
    budgeted = len(FIRING_POLICIES) * len(FIRING_BUDGETS)
    assert len(rows) == len(FIRINGS) * budgeted + 1
    by_firing = firing.rows_by_firing(rows)
    assert tuple(by_firing) == FIRINGS
    for own in by_firing.values():
        assert len(own) == budgeted + 1
        assert Counter(row["policy"] for row in own)[FULL] == 1
        assert {row.get("firing") for row in own} == {None}
    plays = firing.firing_plays(STREETS, SCENES, ["care", "full"], [0.1], [0, 1])
    assert len(rows_of(plays)) == 2 * (len(FIRINGS) * 2 + 1)
    # Alone it stands under free cells.
    alone = firing.firing_plays(STREETS, SCENES, ["full"], [0.1])
    assert [*firing.rows_by_firing(rows_of(alone))] == ["cells"]


def test_hardware_and_policies_that_do_not_fit_a_set_up_are_left_out_with_a_line():
    fits = firing.fitting("m1-forward")
    assert fits.firings == ["cells", "rows", "columns", "vertical-window", "energy:4"]
    assert set(FIRING_POLICIES) - {*fits.policies} == {"place"}
    said = " ".join(fits.left_out)
    assert "left out with m1-forward: tiles:4x8 (rows of firing tiles must divide the 126" in said
    assert "place (weights" in said
    assert len(fits.left_out) == 4
    assert firing.fitting("hdl-32e").left_out == []
    # A budget of 3% leaves none of four rows.
    setup = SensorSetup("four", AngularGrid(512, 4, 0.05, -0.05))
    said = " ".join(firing.fitting(setup).left_out)
    assert "left out with four: rows (budget 0.03 leaves no row of 4" in said


def test_every_set_up_is_played_under_what_fits_it():
    configs = firing.firing_study([0], ["fan"], ["hdl-32e", "m1-forward"])
    other = [config for config in configs if config.sensor == "m1-forward"]
    assert len(configs) - len(other) == len(firing.firing_study([0], ["fan"]))
    assert len(other) == 5 * len(FIRING_POLICIES[1:]) * len(FIRING_BUDGETS) + 1
    assert "fan" in {config.policy for config in other}
    streets = Streets("evaluation", sensor="m1-forward")
    plays = firing.firing_plays(streets, SCENES[:1], ["care"], [0.1])
    assert [play.firing for play in plays] == firing.fitting("m1-forward").firings


def test_every_order_holds_the_papers_study_once():
    def alike(rows):
        return Counter(tuple(sorted(row.items())) for row in rows)

    rows = rows_of(firing.order_study([0]))
    assert len(rows) == 6 * 46 + 3
    by_order = firing.rows_by_order(rows)
    assert tuple(by_order) == ORDERS
    paper = alike(rows_of(paper_study([0])))
    assert all(alike(own) == paper for own in by_order.values())
    # They come in one sequence, and only if they were played.
    few = [row for row in rows[::-1] if row["cell_order"] in ("columns", "rows-down")]
    assert [*firing.rows_by_order(few)] == ["rows-down", "columns"]


def test_what_feels_no_order_is_played_once_and_belongs_to_every_order():
    """History with rows asks for hulls: it feels the order."""
    policies = ["rows", "history-rows", "full"]
    rows = rows_of(firing.order_plays(STREETS, SCENES, policies, [0.03, 0.1]))
    assert len(rows) == 2 * (2 * (1 + 6) + 1)
    for own in firing.rows_by_order(rows).values():
        assert Counter(row["policy"] for row in own) == {"rows": 4, "history-rows": 4, "full": 2}
        assert {row["cell_order"] for row in own} == {AS_DEMANDED}
    assert firing.without_order(rows) == ["full", "rows"]


@pytest.mark.parametrize("conditions", [realism.CONDITIONS, realism.FILM_CONDITIONS])
def test_a_realistic_car_is_made_of_what_is_played_alone(conditions):
    assert conditions[0] is realism.IDEAL
    assert len(labels(conditions)) == len(conditions)
    alone = {level.changes["firing"] for level in conditions if [*level.changes] == ["firing"]}
    assert alone == {*map(settled, HARDWARE)} - {CELLS}
    car = {level.label: level.changes for level in conditions}["realistic car"]
    parts = [level.changes for level in conditions if level.changes.items() < car.items()]
    assert {name for changes in parts for name in changes} == {*car}


def test_every_configuration_stands_in_a_cell_of_the_tables_of_headlines():
    """The keys by which tables look rows up are those that the rows of the study have."""
    rows = rows_of(realism.realism_study([3, 4], ["rows"]))
    asked = set()
    for headline in realism.HEADLINES:
        assert {name for pair in headline.pairs for name in pair} <= {*headline.policies}
        for level in realism.headline_conditions(headline).sound:
            for place in headline.places:
                asked |= {level.key(place, name) for name in (*headline.policies, "rows")}
    assert {key_of(row) for row in rows} == asked
    seeds = {name: set() for name in ("drive", "ncap", "dense", "dartout", "cutin")}
    for row in rows:
        seeds[row["scenario"]].add(row["seed"])
    streets = {name: {3, 4} for name in ("dense", "dartout", "cutin")}
    assert seeds == streets | {"drive": {103, 104}, "ncap": {3}}
    alone = realism.realism_study([0], headlines=[BY_NAME["dense, 3%"]])
    assert {config.budget for config in alone} == {0.03, 1.0}
    with pytest.raises(InvalidInput, match="999 of test and 1099 of calibration"):
        BY_NAME["drive, 1%"].seeds([999])


def test_conditions_that_cannot_be_played_are_left_out_with_a_line(drive):
    fits = realism.headline_conditions(BY_NAME["drive, 1%"])
    left = labels(realism.CONDITIONS) - labels(fits.sound)
    assert left == {"fires rows", "fires vertical-window"}
    assert fits.left_out[0].startswith("left out in drive, 1%: fires rows (budget 0.01 leaves no")
    assert realism.headline_conditions(BY_NAME["dense, 3%"]).left_out == []
    # Recordings cannot tell what returned.
    source = source_of(f"argoverse2:{drive.parent}")
    fits = realism.film_conditions(source, source.scenes(), 0.1)
    left = labels(realism.FILM_CONDITIONS) - labels(fits.sound)
    assert {"sweep of 0.1 s", "range 40 m", "realistic car"} < left
    assert len(left) == len(fits.left_out) == 6
    assert "yolox camera" in labels(fits.sound)
    # A fault of all of them is no reason to leave each out.
    with pytest.raises(InvalidInput, match="budget"):
        realism.film_conditions(STREETS, SCENES, 2.0)


def test_plays_of_a_source_are_those_of_the_protocol_under_every_condition():
    rows = rows_of(realism.realism_plays(STREETS, SCENES, ["care", "full"], [0.03], [0, 1]))
    budgeted = Counter(row["policy"] for row in rows)
    assert budgeted["care"] == len(realism.FILM_CONDITIONS) * 2 * 2
    # The full scan feels what returns, and neither camera, hardware nor order: ideal, sweep, range,
    # fog, rain, and the car.
    assert budgeted[FULL] == 6 * 2
