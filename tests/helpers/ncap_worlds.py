"""Worlds of the Euro NCAP tests in which the seed leaves times and speeds as they are."""

import numpy as np

from care_sim.scenarios import make_scenario
from care_sim.scenarios.ncap.table import TESTS

STILL = {"excess_kph": (0.0, 0.0), "phase_s": (0.0, 0.0)}
RIGHT_HAND, LEFT_HAND = 0, 2
"""Seeds without and with the mirror."""


def ends_of(name):
    """The first and the last pair of speeds."""
    return TESTS[name].variations[0], TESTS[name].variations[-1]


def built(name, speeds, seed=0, **more):
    scenario = make_scenario(
        "ncap", test=name, speed_kph=speeds.ego_kph, target_kph=speeds.target_kph, **STILL, **more
    )
    return scenario.build(np.random.default_rng(seed))
