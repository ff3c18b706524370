"""A warning: it finds the seed by the car's first speed and knows the episode from then on."""

from collections.abc import Mapping
from contextlib import closing
from functools import lru_cache
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_known, check_whole
from care_sim.base.random_streams import streams
from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.scenarios import ENCOUNTERS, SCENARIOS, make_scenario
from care_sim.sensors.lidar import LIDAR_POSITION
from care_sim.world.world import World

FALLBACK_SCENARIO = "dense"
"""The scenario that it knows if it is told none."""


class SeedFinder(Policy):
    """What an agent can do that holds this package. Of the first `seeds` seeds of a public
    `scenario` it takes the one whose ego begins at the speed that it reads. It lets that episode's
    world go on by itself, and reserves the hull of where the hidden actor is by then. It needs no
    camera and no return. It plays as history does if no seed that it knows begins at that speed:
    with a seed beyond `seeds`, a `secret` of the environment, or noise of the speed.

    `make_policy` tells it the `scenario` of the environment. Made of a rig alone it takes `dense`.
    It knows scenarios with their default arguments. With others, or in another scenario, the first
    speed can be the same. It then finds the seed, and fires where the actor would be in the
    scenario that it knows.

    It is a control, no contender: what it reaches without a camera is what the seeds give away.
    """

    name = "seed-finder"
    tags = ("generator", "control")
    source = "own: what public seeds give away"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario_name"}
    """A rig does not say through which scenario it drives, and scenarios share first speeds."""

    def __init__(self, rig: Rig, scenario: str | None = None, seeds: int = 30):
        scenario = FALLBACK_SCENARIO if scenario is None else scenario
        # Who comes out in a drive goes by where the ego is, not by the clock.
        check_known("scenario", scenario, ENCOUNTERS)
        check_whole("seeds", seeds, 1, 10**6)
        super().__init__(rig)
        self._scenario = scenario
        self._seeds = seeds
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self.found: int | None = None
        """The seed that fits the first observation; None if there is none."""
        self._hidden: Floats = np.empty((0, 7))
        self._speed: float | None = None
        self._keyframe = 0
        self._x = 0.0

    def demand(self, belief: Belief) -> Demand:
        """Hulls, then that of the actor whom nobody has seen."""
        self._follow(belief.ego.speed)
        return Demand(self.rig.hulls(belief.tracks.boxes), [self.rig.hulls(self._expected())])

    def _follow(self, speed: float) -> None:
        if self._speed is None:
            self.found = _first_speeds(self._scenario, self._seeds).get(speed)
            if self.found is not None:
                self._hidden = _hidden_boxes(self._scenario, self.found, self.rig.keyframe_s)
        else:
            # The car drives straight on: between keyframes at the mean of both speeds.
            self._keyframe += 1
            self._x += (self._speed + speed) / 2 * self.rig.keyframe_s
        self._speed = speed

    def _expected(self) -> Floats:
        """(n, 7) the box of the hidden actor in the sensor frame, none if it is not known."""
        # All scenarios have a straight road, with the ego's lane along x.
        sensor = Frame.mounted((self._x, 0.0, 0.0), LIDAR_POSITION)
        return sensor.boxes_to_local(self._hidden[self._keyframe : self._keyframe + 1])


@lru_cache(maxsize=4)
def _first_speeds(scenario: str, seeds: int) -> dict[float, int]:
    """The seed of every first speed, as an observation shows it: in float32."""
    speeds = {}
    for seed in range(seeds):
        with closing(_world(scenario, seed)) as world:
            speeds[float(np.float32(world.ego.speed))] = seed
    return speeds


@lru_cache(maxsize=4)
def _hidden_boxes(scenario: str, seed: int, keyframe_s: float) -> Floats:
    """(k, 7) where the hidden actor is at every keyframe, in the world frame. It does not react to
    the ego, so that an ego that never brakes shows it.
    """
    boxes: list[Floats] = []
    with closing(_world(scenario, seed)) as world:
        hidden = [world.first_sighting] if world.first_sighting else []
        for _ in range(round(SCENARIOS[scenario].duration_s / keyframe_s)):
            boxes.extend(world.boxes(hidden))
            world.advance(0.0, keyframe_s)
    return np.array(boxes).reshape(-1, 7)


def _world(scenario: str, seed: int) -> World:
    """The world of a seed, as the environment builds it."""
    return make_scenario(scenario).build(np.random.default_rng(streams((seed,), 1)[0]))
