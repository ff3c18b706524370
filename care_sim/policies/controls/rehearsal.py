"""Episodes that a control plays by itself before it is asked: the generator and the seeds are
public.
"""

from dataclasses import replace

import numpy as np

from care_sim.base.checks import check_known
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.seeds import EpisodeSeeds
from care_sim.scenarios import SCENARIOS, make_scenario
from care_sim.scenarios.base import Scenario

FALLBACK_SCENARIO = "dense"
"""What is rehearsed where no scenario is told, as in the open loop."""


def known_scenario(told: Scenario | str | None) -> Scenario:
    """The scenario of the environment, or one by name with its default arguments.

    Raises InvalidInput for an unknown name.
    """
    if isinstance(told, Scenario):
        return told
    name = FALLBACK_SCENARIO if told is None else told
    check_known("scenario", name, SCENARIOS)
    return make_scenario(name)


def rehearsal(scenario: Scenario, seed: int, rig: Rig) -> ClosedLoop:
    """The episode of a seed before its first keyframe, as an environment without faults builds it.

    The caller closes its world.
    """
    seeds = EpisodeSeeds.of(seed)
    world = scenario.make_world(np.random.default_rng(seeds.scenario))
    # A rig that was made alone may have no camera; the scenario's environment has these.
    equipped = rig if rig.cameras else replace(rig, cameras=scenario.cameras)
    return ClosedLoop(world, equipped, ClosedLoopConditions(), seeds.sensors)
