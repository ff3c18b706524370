"""Every number of the table of tests is that of the public OpenSCENARIO files of the protocols."""

import pytest

from care_sim.scenarios.ncap.table import (
    LARGE_HEIGHT_M,
    LARGE_LENGTH_M,
    LARGE_WIDTH_M,
    SMALL_HEIGHT_M,
    SMALL_LENGTH_M,
    SMALL_WIDTH_M,
    TESTS,
    Across,
    AcrossExit,
    Ahead,
    Oncoming,
)
from care_sim.world.bodies import CATALOGUE
from tests.helpers.openscenario import declared, limits, sizes, variation
from tests.helpers.places import ROOT

VRU = "AEB_VRU_2023/Variations/NCAP_AEB_VRU_"
CAR = "CA-FC_2026/Variations/StandardRange/"
FILES = {
    **{
        name: [f"{VRU}{name}_Variation_2023.xosc"]
        for name in TESTS
        if name.startswith(("CP", "CB")) and not name.startswith("CPTAn")
    },
    "CPTAns-50": [f"{VRU}CPTAns-50_10kph_2023.xosc"],
    "CPTAno-50": [f"{VRU}CPTAno-50_10kph_2023.xosc"],
    "CCRs": [f"{CAR}CCRs.xosc", f"{CAR}CCRs_FCW.xosc"],
    "CCRm": [f"{CAR}CCRm.xosc"],
    "CCRb": [f"{CAR}CCRb.xosc"],
    "CCFtap": [f"{CAR}CCFtap.xosc"],
    "CCCscp-far": [f"{CAR}CCCscp.xosc"],
    "CCCscp-near": [f"{CAR}CCCscp.xosc"],
}
SIDES = {"CCCscp-far": 1.0, "CCCscp-near": -1.0}
MIDDLE = 50.0


@pytest.fixture(scope="session")
def files():
    """The folder with the protocols' files; tests are skipped where it is absent."""
    for folder in (ROOT, ROOT.parent):
        found = folder / "shared/data/openscenario/ncap/OpenSCENARIO/NCAP"
        if found.is_dir():
            return found
    pytest.skip("no OpenSCENARIO files in shared/data")


def cases(files, name):
    """The cases of a test: of the car tests those that hit the middle."""
    found = [case for path in FILES[name] for case in variation(files / path).cases()]
    if name.startswith("CC"):
        found = [case for case in found if case.get("ImpactLocation", MIDDLE) == MIDDLE]
    return [case for case in found if case.get("ImpactSide", 0.0) in (0.0, SIDES.get(name, 0.0))]


def speeds(case):
    targets = ("VRU_finalSpeed_kph", "Target_init_speed_kph", "Target_final_speed_kph")
    return case["Ego_speed_kph"], next(case[name] for name in targets if name in case)


def names(kind):
    return [name for name in TESTS if isinstance(TESTS[name].way, kind)]


def test_every_test_has_its_files(files):
    assert set(FILES) == set(TESTS)
    assert all((files / path).is_file() for paths in FILES.values() for path in paths)


@pytest.mark.parametrize("name", TESTS)
def test_every_pair_of_speeds_is_the_protocols(files, name):
    theirs = [speeds(case) for case in cases(files, name)]
    ours = [(each.ego_kph, each.target_kph) for each in TESTS[name].variations]
    assert sorted(ours) == sorted(theirs)
    assert len(set(ours)) == len(ours)


@pytest.mark.parametrize("name", [name for name in names(Across) if name.startswith("CP")])
def test_pedestrians_cross_as_in_the_files(files, name):
    way, target = TESTS[name].way, TESTS[name].target
    for case in cases(files, name):
        assert way.start_m == case["VRU_initLatDist"]
        assert way.run_up_m == case["VRU_accelerationDist"]
        assert way.overlap * 100 == case["Overlap"]
        assert way.far == (case["VRU_trajectoryOrientation"] == -1)
        assert target.point_m == pytest.approx(-case["VRU_collisionPointOffset"])
        assert CATALOGUE[target.body].size[1] == case["VRU_width"]


# The line of the ego's lane on the target's way, and the ego's front when they meet, by test.
LINES = {"CBNA-50": ("AE", "BE"), "CBNAO-50": ("AM", "BM"), "CBFA-50": ("AQ", "BQ")}


@pytest.mark.parametrize("name", LINES)
def test_bicyclists_cross_as_in_the_files(files, name):
    test = TESTS[name]
    for case in cases(files, name):
        point = case[f"_Road_collisionPoint{LINES[name][0]}"]
        # Their rear axle starts there; the middle of the bicycle is 0.605 m before it.
        assert point - case["_VRU_initS"] - 0.605 == pytest.approx(test.way.start_m)
        crank = case["VRU_collisionPointOffset"]
        way = point - crank - case["_VRU_initS"]
        assert way - case["VRU_steadyStateDist"] == pytest.approx(test.way.run_up_m)
        assert 0.605 - crank == pytest.approx(test.target.point_m)
        assert CATALOGUE[test.target.body].size[1] == case["VRU_width"]
    assert test.way.overlap == 0.5
    assert test.way.far == (name == "CBFA-50")


@pytest.mark.parametrize("name", names(Ahead))
def test_what_goes_ahead_does_so_as_in_the_files(files, name):
    way = TESTS[name].way
    for case in cases(files, name):
        overlap = case.get("Overlap", case.get("ImpactLocation"))
        assert way.overlap * 100 == overlap
        assert way.run_up_m == case.get("VRU_accelerationDist", 0.0)
        assert way.steady_m == case.get("VRU_steadyStateDist", 0.0)
        assert case.get("isTargetbraking", "false") == "false"


def test_the_car_ahead_brakes_as_in_the_files(files):
    way = TESTS["CCRb"].way
    for case in cases(files, "CCRb"):
        assert case["isTargetbraking"] == "true"
        assert way.headway_s == case["Target_time_headway"]
        assert way.delay_s == case["Target_braking_delay"]
        assert way.deceleration == case["Target_deceleration"]
        assert way.final_kph == case["Target_final_speed_kph"]


@pytest.mark.parametrize("name", names(AcrossExit | Oncoming))
def test_the_ego_turns_as_in_the_files(files, name):
    bends = TESTS[name].way.bends
    found = cases(files, name)
    assert set(bends) == {case["Ego_speed_kph"] for case in found}
    for case in found:
        bend = bends[case["Ego_speed_kph"]]
        assert case["Trajectory_R1"] == 1500.0
        assert bend.radius_m == case["Trajectory_R2"]
        assert bend.clothoid_deg == case["Trajectory_alpha"]
        assert bend.arc_deg == case["Trajectory_beta"]
        assert case["Road_laneWidth"] == 3.5


@pytest.mark.parametrize("name", names(AcrossExit))
def test_pedestrians_cross_the_exit_as_in_the_files(files, name):
    way = TESTS[name].way
    for case in cases(files, name):
        assert way.offset_m == case["VRU_centerlineOffset"]
        assert way.distance_m == case["VRU_collisionDist"]
        assert way.run_up_m == case["VRU_accelerationDist"]
        assert way.right == (case["Ego_turningDirection"] == -1)
        assert way.along == (case["VRU_trajectoryDirection"] == -1)
        assert TESTS[name].start_s == case["Ego_initTTC"]
        # The middle of the dummy, from the middle of the road; the lane is half its width aside.
        lane = case["Ego_turningDirection"] * case["Road_laneWidth"] / 2
        starts = abs(case["_Trajectory_tStart"] - lane)
        assert starts == pytest.approx(way.distance_m - TESTS[name].target.point_m)


@pytest.mark.parametrize("name", [name for name in TESTS if TESTS[name].start_s == 4.0])
def test_what_starts_later_than_in_the_files_is_by_then_at_its_speed(files, name):
    for case in cases(files, name):
        assert TESTS[name].start_s > case.get("Target_steadyStateTTC", 0.0)


def test_the_parked_cars_stand_as_in_the_files(files):
    ours = TESTS["CPNCO-50"].obstruction
    for case in cases(files, "CPNCO-50"):
        widths = (case["Ego_width"] + case["ObstructionLarge_width"]) / 2
        assert -case["_Obstruction_latDist"] - widths == pytest.approx(ours.beside_m)
        front = case["_ObstructionSmall_initS"] + case["_ObstructionSmall_frontBumperLon"]
        side = case["_VRU_initS"] - case["VRU_width"] / 2
        assert side - front == pytest.approx(ours.gap_m)
        between = -case["_ObstructionLarge_initDist"] - (
            case["_ObstructionSmall_rearBumperLon"] + case["_ObstructionLarge_frontBumperLon"]
        )
        assert between == pytest.approx(ours.gap_m)


@pytest.mark.parametrize("name", LINES)
def test_the_cars_beside_the_bicyclist_stand_as_in_the_files(files, name):
    ours = TESTS[name].obstruction
    for case in cases(files, name):
        end = case.get("Obstruction_distance", case["VRU_steadyStateDist"])
        assert ours.end_m == end
        assert ours.before_m == case["VRU_lateralDist"]
        assert ours.gap_m == case["Obstruction_gap"]


@pytest.mark.parametrize("name", SIDES)
def test_the_crossing_car_and_those_that_wait_are_as_in_the_files(files, name):
    test, side = TESTS[name], SIDES[name]
    for case in cases(files, name):
        middle = case["Road_armLength"] + case["IntersectionLength"] / 2
        # Its front is as far beyond the ego's lane, the ego's front at its side.
        front = case["_Target_syncS"] + case["_Target_frontBumperLon"]
        beyond = front - (middle + side * case["Road_laneWidth"] / 2)
        length, width, _ = CATALOGUE[test.target.body].size
        assert beyond - length / 2 == pytest.approx(test.target.point_m)
        ego_front = case["_Ego_syncS"] + case["_Ego_frontBumperLon"]
        line = middle - side * case["Road_laneWidth"] / 2
        assert line - ego_front == pytest.approx(width / 2)
        assert (length, width) == (case["Target_length"], case["Target_width"])
    # Written in the file's storyboard, as 22.5 m less or more 1.5 and 2 m beside the road or lane.
    assert test.obstruction.before_m == 22.5 - side * 1.5
    assert test.obstruction.beside_m == {1.0: 3.5 + 2.0, -1.0: 2.0}[side]
    assert test.way.far == (side == 1.0)


def test_sizes_are_those_of_the_catalogues(files):
    people = sizes(files / "Catalogs/Pedestrians/Pedestrians.xosc")
    vehicles = sizes(files / "Catalogs/Vehicles/Vehicles.xosc")
    assert CATALOGUE["adult"].size == people["NCAP_Adult"]
    assert CATALOGUE["child"].size == people["NCAP_Child"]
    assert CATALOGUE["target car"].size == vehicles["NCAP_GlobalVehicleTarget"]
    # Theirs is a bicycle without its rider.
    assert CATALOGUE["bicyclist"].size[:2] == vehicles["NCAP_Bicycle"][:2]
    assert vehicles["NCAP_ObstructionVehicle_Small"][2] == SMALL_HEIGHT_M
    assert vehicles["NCAP_ObstructionVehicle_Large"][2] == LARGE_HEIGHT_M


def test_the_cars_that_hide_have_the_sizes_that_the_files_allow(files):
    for base in ("CPNCO", "CBNA", "CBNAO", "CBFA"):
        path = files / f"AEB_VRU_2023/NCAP_AEB_VRU_{base}_2023.xosc"
        assert limits(path, "ObstructionLarge_length") == LARGE_LENGTH_M
        assert limits(path, "ObstructionLarge_width") == LARGE_WIDTH_M
        ours = {"ObstructionSmall_length": SMALL_LENGTH_M, "ObstructionSmall_width": SMALL_WIDTH_M}
        for name in ours.keys() & declared(path).keys():
            assert limits(path, name) == ours[name]
