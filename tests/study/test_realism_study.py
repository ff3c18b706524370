from collections import Counter

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.defaults import CELLS
from care_sim.core.firing.listing import HARDWARE, settled
from care_sim.reports.tables.realism import realism_tables
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.realism import (
    CONDITIONS,
    FILM_CONDITIONS,
    HEADLINES,
    IDEAL,
    film_conditions,
    fitting,
    headline_conditions,
    realism_plays,
    realism_study,
)
from care_sim.study.designs.variants import Variant
from care_sim.study.rows.reading import key_of
from care_sim.study.run_config import FULL
from tests.helpers.made_rows import row

BY_NAME = {headline.name: headline for headline in HEADLINES}
STREETS = Streets("evaluation")
SCENES = [Scene("street-0000", 0), Scene("street-0001", 1)]


@pytest.fixture(scope="module")
def configs():
    return realism_study([3, 4], ["rows"])


def labels(levels):
    return [level.label for level in levels]


def test_a_headline_table_is_played_and_shown_alone():
    """The full scan at its budget is of every table of the street: alone it makes none."""
    alone = realism_study([0], headlines=[BY_NAME["dense, 3%"]])
    assert {config.budget for config in alone} == {0.03, 1.0}
    assert len(alone) < 0.05 * len(realism_study([0]))
    (told,) = {
        line[0]
        for table in realism_tables([row(config, 9.0) for config in alone])
        for line in table.rows
        if len(line) == 1
    }
    assert told == "dense, 3%"
    assert [headline.option for headline in HEADLINES] == [
        "dartout-10",
        "dense-3",
        "dense-5",
        "cutin-10",
        "ncap-1",
        "ncap-3",
        "drive-1",
    ]


@pytest.mark.parametrize("conditions", [CONDITIONS, FILM_CONDITIONS])
def test_the_ideal_comes_first_and_every_hardware_is_among_the_conditions(conditions):
    assert conditions[0] is IDEAL
    assert IDEAL.changes == {}
    assert len({*labels(conditions)}) == len(conditions)
    alone = {level.changes["firing"] for level in conditions if [*level.changes] == ["firing"]}
    assert alone == {*map(settled, HARDWARE)} - {CELLS}


@pytest.mark.parametrize("conditions", [CONDITIONS, FILM_CONDITIONS])
def test_a_realistic_car_is_made_of_what_is_played_alone(conditions):
    car = {level.label: level.changes for level in conditions}["realistic car"]
    alone = [level.changes for level in conditions if level.changes.items() < car.items()]
    assert {name for changes in alone for name in changes} == {*car}


def test_every_pair_is_of_policies_that_its_headline_plays():
    for headline in HEADLINES:
        assert {name for pair in headline.pairs for name in pair} <= {*headline.policies}
        assert {(place.scenario, place.budget) for place in headline.places} == {
            (headline.places[0].scenario, headline.places[0].budget)
        }


def test_every_configuration_stands_in_a_cell_of_the_tables(configs):
    """The keys by which tables look rows up are those that the rows of the study have."""
    assert len(configs) == len(set(configs))
    asked = {
        level.key(place, policy)
        for headline in HEADLINES
        for level in headline_conditions(headline).levels
        for place in headline.places
        for policy in (*headline.policies, "rows")
    }
    assert {key_of(config.row()) for config in configs} == asked


def test_drives_have_the_published_seeds_and_tests_of_euro_ncap_one(configs):
    seeds = {name: set() for name in ("drive", "ncap", "dense")}
    for config in configs:
        if config.scenario in seeds:
            seeds[config.scenario].add(config.seed)
    assert seeds == {"drive": {103, 104}, "ncap": {3}, "dense": {3, 4}}


def test_drives_of_another_split_are_refused():
    with pytest.raises(InvalidInput, match="999 of test and 1099 of calibration"):
        BY_NAME["drive, 1%"].seeds([999])


def test_the_tests_of_euro_ncap_are_each_at_its_highest_speed_up_to_40_kph():
    cases = [dict(place.parameters) for place in BY_NAME["ncap, 1%"].places]
    assert len(cases) == len({case["test"] for case in cases}) == 19
    assert {case["speed_kph"] for case in cases} == {10.0, 20.0, 40.0}
    assert {case.get("occluder_reported") for case in cases} == {None, True}
    by_test = {case["test"]: case["speed_kph"] for case in cases}
    assert (by_test["CPTAns-50"], by_test["CCFtap"], by_test["CPNCO-50"]) == (10.0, 20.0, 40.0)


def test_a_budget_that_buys_no_unit_leaves_the_hardware_out_with_a_line():
    fits = headline_conditions(BY_NAME["drive, 1%"])
    assert {*labels(CONDITIONS)} - {*labels(fits.levels)} == {
        "fires rows",
        "fires vertical-window",
    }
    assert fits.left_out[0].startswith("left out in drive, 1%: fires rows (budget 0.01 leaves no")
    assert headline_conditions(BY_NAME["dense, 3%"]).left_out == ()


def test_ideal_conditions_that_cannot_be_played_are_refused():
    """What is wrong with all of them is no reason to leave each out."""

    def refuse(level: Variant) -> None:
        raise InvalidInput("no such thing")

    with pytest.raises(InvalidInput, match="no such thing"):
        fitting(CONDITIONS, BY_NAME["dense, 3%"].places[0], refuse)


def test_plays_of_a_source_are_those_of_the_protocol_under_every_condition():
    plays = realism_plays(STREETS, SCENES, ["care", "full"], [0.03], [0, 1])
    assert len(plays) == len(set(plays))
    budgeted = Counter(play.policy for play in plays)
    assert budgeted["care"] == len(FILM_CONDITIONS) * 2 * 2
    # The full scan feels what returns, and neither camera, hardware nor order: ideal, sweep, range,
    # fog, rain, and the car.
    assert budgeted[FULL] == 6 * 2


def test_recordings_are_played_without_what_they_cannot_tell(drive):
    source = source_of(f"argoverse2:{drive.parent}")
    fits = film_conditions(source, source.scenes(), 0.1)
    left = {*labels(FILM_CONDITIONS)} - {*labels(fits.levels)}
    assert {"sweep of 0.1 s", "range 40 m", "realistic car"} < left
    assert len(left) == len(fits.left_out) == 6
    assert "yolox camera" in labels(fits.levels)
