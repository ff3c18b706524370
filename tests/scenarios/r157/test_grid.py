"""The grid against the public ALKS scenario from which it is."""

from xml.etree import ElementTree

import numpy as np
import pytest

from care_sim.scenarios.r157 import (
    EGO_KPH,
    GAP_M,
    GAP_STEP_M,
    KINDS,
    LATERAL_MPS,
    RELATIVE_KPH,
    SIDES,
    CutInCase,
    cases,
    kinds_in_turn,
)
from tests.helpers.places import ROOT

SCENARIOS = "openscenario/alks/logical_scenarios"
VARIATION = f"{SCENARIOS}/alks_scenario_4_4_1_cut_in_no_collision_variation.xosc"


@pytest.fixture
def published():
    """Values of every parameter of the published variation, by the end of its name; the test is
    skipped where the file is absent.
    """
    for folder in (ROOT / "shared" / "data", ROOT.parent / "shared" / "data"):
        if (folder / VARIATION).is_file():
            break
    else:
        pytest.skip("no ALKS scenarios in shared/data")
    values = {}
    variation = ElementTree.parse(folder / VARIATION)
    for one in variation.iter("DeterministicSingleParameterDistribution"):
        name = one.get("parameterName")
        values[name] = [element.get("value") for element in one.iter("Element")]
        for steps in one.iter("DistributionRange"):
            limits = steps.find("Range")
            least, most = (float(limits.get(end)) for end in ("lowerLimit", "upperLimit"))
            step = float(steps.get("stepWidth"))
            values[name] = [*np.arange(least, most + step / 2, step)]
    return {name.split("_", 1)[1]: each for name, each in values.items()}


def test_speeds_kinds_and_sides_are_those_that_were_published(published):
    assert published["InitSpeed_Ve0_kph"] == [*EGO_KPH]
    assert sorted(-v for v in published["RelativeInitSpeed_Ve0_Vo0_kph"]) == [*RELATIVE_KPH]
    assert published["LaneChange_MaxLateralVelocity_Vy_mps"] == [*LATERAL_MPS]
    assert len(published["InitPosition_RelativeLaneId"]) == len(SIDES)
    names = [kind.replace("motorcycle", "motorbike") for kind in KINDS]
    assert published["Model"] == names


def test_gaps_have_half_the_published_step_and_leave_out_none(published):
    gaps = published["HeadwayDistanceTrigger_dx0_m"]
    assert gaps == [0.0, *GAP_M[1::2]]
    assert gaps[1] == 2 * GAP_STEP_M


@pytest.mark.parametrize(
    ("case", "possible"),
    [
        (CutInCase(20, 10, 10, 2.7), True),
        (CutInCase(20, 11, 10, 2.0), False),  # 9 km/h
        (CutInCase(20, 10, 10, 2.8), False),  # as fast across as along
        (CutInCase(60, 36, 60, 1.0), True),
        (CutInCase(60, 36, 60.1, 1.0), False),  # more than 6 s
    ],
)
def test_what_is_possible(case, possible):
    assert case.possible is possible


def test_every_combination_once_and_all_kinds_and_sides_alike():
    grid = kinds_in_turn()
    numbers = [(case.ego_kph, case.relative_kph, case.gap_m, case.lateral_mps) for case in grid]
    assert len({*numbers}) == len(numbers) == len(cases()) == 587
    shares = [
        sum((case.kind, case.side) == (kind, side) for case in grid)
        for kind in KINDS
        for side in SIDES
    ]
    assert max(shares) - min(shares) <= 1
