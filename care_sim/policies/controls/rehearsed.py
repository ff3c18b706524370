"""Controls that know the scenario: from training seeds, where it hides its actor, or from the
played seed itself.
"""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_flag, check_known, check_whole
from care_sim.base.seeds import training_seeds
from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.loops.episode import EpisodeSeeds
from care_sim.loops.one_world import OneWorld
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import Pattern, likeliest_first
from care_sim.policies.controls.patterns_and_tracks import HistoryPattern
from care_sim.scenarios import SCENARIOS, make_scenario
from care_sim.scenarios.base import Scenario
from care_sim.world.world import World

FALLBACK_SCENARIO = "dense"
"""Scenario rehearsed by default, as in the open loop."""


def known_scenario(told: Scenario | str | None) -> Scenario:
    """Return the environment's scenario, or a named one with its default arguments.

    Raises InvalidInput for an unknown name.
    """
    if isinstance(told, Scenario):
        return told
    name = FALLBACK_SCENARIO if told is None else told
    check_known("scenario", name, SCENARIOS)
    return make_scenario(name)


def rehearsal(scenario: Scenario, seed: int, rig: Rig) -> OneWorld:
    """Return the episode of a seed before its first keyframe, as an environment without faults
    builds it.

    The caller closes its world.
    """
    seeds = EpisodeSeeds.of(seed)
    world = scenario.make_world(np.random.default_rng(seeds.scenario))
    # A rig made without an environment may have no camera; the scenario's environment has these.
    equipped = rig if rig.cameras else replace(rig, cameras=scenario.cameras)
    given = equipped, ClosedLoopConditions(), seeds.sensors, scenario.duration_s
    return OneWorld.begun(world, *given)


class LearnedPlace(Pattern):
    """Fires the cells in which the same scenario hid its actor in other seeds.

    In these cells a full scan first detected the first-sighting actor, in the first `seeds`
    training seeds of the scenario.

    `make_policy` passes the environment's `scenario`, with its parameters. Raises InvalidInput for
    an unknown scenario.
    """

    name = "learned-place"
    tags = ("causal", "learned", "control")
    source = "own: a map of the scenario's training seeds that never changes"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}

    def __init__(self, rig: Rig, scenario: Scenario | str | None = None, seeds: int = 10):
        super().__init__(rig, learned_cells(rig, scenario, seeds))


def learned_cells(rig: Rig, scenario: Scenario | str | None, seeds: int) -> Cells:
    """Return (N,) all cells, those with most detected actors first.

    Raises InvalidInput for an unknown scenario, or `seeds` beyond 1 to 1,000.
    """
    check_whole("seeds", seeds, 1, 1000)
    # All budgets share a map, learned with a full scan.
    return _learned(replace(rig, budget=rig.grid.size), known_scenario(scenario), seeds)


@lru_cache(maxsize=8)
def _learned(rig: Rig, scenario: Scenario, seeds: int) -> Cells:
    sightings = np.zeros(rig.grid.size)
    for seed in training_seeds(seeds):
        # A hull is dilated by the paper's margins, its guess of how far off a box can be.
        sightings[_first_hull(rig, scenario, seed)] += 1
    return likeliest_first(rig, sightings)


def _first_hull(rig: Rig, scenario: Scenario, seed: int) -> Cells:
    """Return the hull of the first-sighting actor at its first detection by a full scan; no cells
    without one.
    """
    everything = np.arange(rig.grid.size)
    loop = rehearsal(scenario, seed, rig)
    with closing(loop.world) as world:
        over = False
        while (target := world.first_sighting) and not over:
            # The actor's place at the scan: the keyframe moves the world on.
            boxes = loop.sensor.boxes_to_local(loop.world.boxes([target]))
            record = loop.keyframe(everything)
            if record.detected:
                (hull,) = rig.hulls(boxes)
                return hull
            hit, now = record.impact_speed_mps is not None, loop.world
            over = hit or now.is_over() or now.time >= scenario.duration_s
    return np.zeros(0, np.int64)


class HistoryLearnedPlace(HistoryPattern):
    """History, with the reserve spent on the map of `learned-place`, with that policy's
    parameters.
    """

    name = "history-learned-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map of the scenario's training seeds that never changes"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}

    def __init__(self, rig: Rig, scenario: Scenario | str | None = None, seeds: int = 10):
        super().__init__(LearnedPlace(rig, scenario, seeds))


class SeedFinder(Policy):
    """A warning: finds the seed by the first observation and then knows the episode.

    Among the first `seeds` seeds of a public `scenario` it takes the seed with the observed initial
    speed. If several match, the first picture decides. It simulates a twin of that episode's world,
    drives the twin's ego like its own car, and reserves the hulls of all hidden actors in the twin.
    It needs no return. If no known seed has the speed, it plays like history: with a seed beyond
    `seeds`, a `secret` of the environment, or noise of the speed.

    `make_policy` passes the environment's `scenario`, with its parameters. Made with only a rig, it
    takes `dense`. Different scenarios can share an initial speed. With the wrong scenario it may
    find the seed, and fires at the actors of the scenario that it has.

    With `hidden_first` it demands these hulls first and gives its tracks the rest. It ignores the
    traffic, so others may collide less in drives.

    It is a control, no contender: it shows how much the seeds reveal without a camera.
    """

    name = "seed-finder"
    tags = ("generator", "control")
    source = "own: what public seeds give away"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}
    """A rig does not name its scenario, and scenarios share initial speeds."""

    def __init__(
        self,
        rig: Rig,
        scenario: Scenario | str | None = None,
        seeds: int = 30,
        hidden_first: bool = False,
    ):
        check_whole("seeds", seeds, 1, 10**6)
        check_flag("hidden_first", hidden_first)
        super().__init__(rig)
        self._hidden_first = hidden_first
        self._scenario = known_scenario(scenario)
        self._seeds = seeds
        self._twin: World | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self.found: int | None = None
        """The seed that fits the first observation, None without one."""
        if self._twin is not None:
            self._twin.close()
        self._twin = None
        self._speed: float | None = None

    def remember(self, belief: Belief) -> None:
        """Find the seed by the first observation, then let the twin follow the car."""
        speed = belief.ego.speed
        if self._speed is None:
            self.found = self._seed_of(belief)
            if self.found is not None:
                self._twin = rehearsal(self._scenario, self.found, self.rig).world
        elif self._twin is not None:
            # Between keyframes the car holds one acceleration, which follows from both speeds.
            held = (speed - self._speed) / self.rig.keyframe_s
            self._twin.advance(held, self.rig.keyframe_s)
        self._speed = speed

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls of tracked objects, then of hidden ones."""
        tracked = self.rig.hulls(belief.tracks.boxes)
        hidden = self.rig.hulls(self._expected())
        if self._hidden_first:
            return Demand(layers=[hidden, tracked])
        return Demand(tracked, [hidden])

    def _seed_of(self, belief: Belief) -> int | None:
        # The first observation is the same for all budgets.
        rig = replace(self.rig, budget=self.rig.grid.size)
        seen = _picture(belief)
        alike: int | None = None
        for seed in range(self._seeds):
            speed, picture = _first_look(self._scenario, seed, rig)
            if speed == belief.ego.speed:
                if picture == seen:
                    return seed
                # A camera with faults shows another picture: then only the speed decides.
                alike = seed if alike is None else alike
        return alike

    def _expected(self) -> Floats:
        """Return (n, 7) boxes in the sensor frame of all hidden actors, ahead and within the
        sensor's reach; none if unknown.
        """
        if self._twin is None:
            return np.empty((0, 7))
        hidden = {one.body for one in self._twin.meetings}
        if self._twin.first_sighting is not None:
            hidden.add(self._twin.first_sighting.body)
        sensor = Frame.mounted(self._twin.ego.pose, self.rig.sensor_position)
        boxes = sensor.boxes_to_local(self._twin.boxes_of(np.array(sorted(hidden), np.int64)))
        # Actors that were passed or are too far to detect would take the cells of relevant ones.
        near = planar_ranges(boxes) <= self.rig.grid.range_m
        return np.asarray(boxes[near & (boxes[:, 0] > 0)])


@lru_cache(maxsize=10_000)
def _first_look(scenario: Scenario, seed: int, rig: Rig) -> tuple[float, bytes]:
    """Return the initial speed and picture of a seed's episode, as an observation holds them."""
    loop = rehearsal(scenario, seed, rig)
    with closing(loop.world):
        return float(np.float32(loop.belief.ego.speed)), _picture(loop.belief)


def _picture(belief: Belief) -> bytes:
    """Return the camera's boxes as an observation holds them, in float32."""
    return belief.detections.rows().astype(np.float32).tobytes()
