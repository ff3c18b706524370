"""A control: where this very scenario hid its actor in other seeds, without camera, tracks or
memory.
"""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_known, check_whole
from care_sim.base.seed_ranges import training_seeds
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.episode import EpisodeSeeds
from care_sim.policies.base import FixedPolicy
from care_sim.policies.controls.patterns import likeliest_first
from care_sim.policies.controls.patterns_and_tracks import HistoryPattern
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


class LearnedPlace(FixedPolicy):
    """Fires the cells in which a full scan first detected the first-sighting actor in the first
    `seeds` training seeds of the scenario: the pattern that is learned here, and no other.

    `make_policy` tells it the `scenario` of the environment, with its parameters. Raises
    InvalidInput for an unknown scenario.
    """

    name = "learned-place"
    tags = ("causal", "learned", "control")
    source = "own: a map of the scenario's training seeds that never changes"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}
    is_pattern = True

    def __init__(self, rig: Rig, scenario: Scenario | str | None = None, seeds: int = 10):
        super().__init__(rig)
        self._pattern = learned_cells(rig, scenario, seeds)

    def fixed(self, budget: int) -> Demand:
        """The same cells at every keyframe."""
        return Demand(layers=[[self._pattern[:budget]]])


def learned_cells(rig: Rig, scenario: Scenario | str | None, seeds: int) -> Cells:
    """(N,) all cells, those first in which most of the actors were found.

    Raises InvalidInput for an unknown scenario, or `seeds` beyond 1 to 1,000.
    """
    check_whole("seeds", seeds, 1, 1000)
    # All budgets share a map: it is learned with a full scan.
    return _learned(replace(rig, budget=rig.grid.size), known_scenario(scenario), seeds)


@lru_cache(maxsize=8)
def _learned(rig: Rig, scenario: Scenario, seeds: int) -> Cells:
    sightings = np.zeros(rig.grid.size)
    for seed in training_seeds(seeds):
        # A hull is dilated by the paper's margins, its guess of how far off a box can be.
        sightings[_first_hull(rig, scenario, seed)] += 1
    return likeliest_first(rig, sightings)


def _first_hull(rig: Rig, scenario: Scenario, seed: int) -> Cells:
    """The hull of the first-sighting actor at the first keyframe at which a full scan detects it;
    no cell if it never does.
    """
    everything = np.arange(rig.grid.size)
    loop = rehearsal(scenario, seed, rig)
    with closing(loop.world) as world:
        over = False
        while (target := world.first_sighting) and not over:
            # Where the actor is at the scan: the keyframe moves the world on.
            boxes = loop.sensor.boxes_to_local(world.boxes([target]))
            record = loop.keyframe(everything)
            if record.detected:
                (hull,) = rig.hulls(boxes)
                return hull
            hit = record.impact_speed_mps is not None
            over = hit or world.is_over() or world.time >= scenario.duration_s
    return np.zeros(0, np.int64)


class HistoryLearnedPlace(HistoryPattern):
    """The hulls of the history policy; the reserve goes to the map of `learned-place`, of which it
    has the parameters.
    """

    name = "history-learned-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map of the scenario's training seeds that never changes"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}

    def __init__(self, rig: Rig, scenario: Scenario | str | None = None, seeds: int = 10):
        super().__init__(LearnedPlace(rig, scenario, seeds))
