"""A person who runs across the ego's lane from behind an occluder: the physics of two scenarios."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import bounded, one_of
from care_sim.base.errors import InvalidInput
from care_sim.scenarios.base import (
    EGO_SPEED_BOUNDS_MPS,
    LEFT_PARKING_Y,
    NO_LIMIT_MPS,
    RIGHT_PARKING_Y,
    USUAL_EGO_SPEED_MPS,
    line_with_terraces,
)
from care_sim.scenarios.mirroring import MirrorableScenario
from care_sim.streets.dimensions import (
    LANE_WIDTH_M,
    PARKING_WIDTH_M,
    PAVEMENT_WIDTH_M,
    Range,
    draw,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

SHADE_M = 0.4
"""The person waits this far inside the occluder's shade: half a body's width and a little."""
OCCLUDERS = ("trailer", "truck", "van", "hoarding")


@dataclass(frozen=True)
class CrossingScenario(MirrorableScenario):
    """A two-way street with a parking lane on each side. The occluder stands in the right one. The
    person waits hidden behind its far end, then runs straight across to the far kerb.

    Perception does not report the occluder: a trailer or a hoarding is none of the five classes.
    With `occluder="truck"` (or "van") and `occluder_reported=True` it does, and the person emerges
    inside that track's dilated hull: the second reading of the scene. Ranges are drawn uniformly by
    the seed.
    """

    occluder: str = one_of("trailer", OCCLUDERS)
    occluder_reported: bool = False
    ego_speed_mps: Range = bounded(USUAL_EGO_SPEED_MPS, *EGO_SPEED_BOUNDS_MPS)
    crossing_m: Range = bounded((37.0, 41.0), 5, 200)
    """From the ego's first position to the person's line. That is four to five seconds of approach,
    in which every track settles."""
    gap_m: Range = bounded((0.8, 1.2), 0.05, 20)
    """From the end of the occluder to the person's line: about a step."""
    run_mps: Range = bounded((2.6, 2.8), 0.1, 12.5)
    """A run of 6 mph, the ten-minute mile (Compendium of Physical Activities 2011, code 12050). No
    sprinter exceeds 12.5."""
    run_up_mps2: float = bounded(5.0, 0.1, 20)
    """Full speed after half a second and 0.7 m, all of it in the occluder's shade."""
    kerb_offset_m: Range = bounded((-0.2, 0.2), -1, 1)
    """How far the occluder stands off the middle of the parking lane."""
    encroachment_s: Range = bounded((0.3, 0.6), -10, 10)
    """Post-encroachment time (Allen, Shin and Cooper 1978) of an ego that never brakes: a near
    miss. Above 0 nobody is hit by a car that does nothing, so a collision can only come from the
    braking. Below 0 is a collision course. Both bounds were picked, from geometry alone, so that a
    full scan sees the person at about the paper's distance, 15 m.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.occluder_reported and CATALOGUE[self.occluder].label is None:
            raise InvalidInput(
                f"occluder_reported needs occluder='truck' or 'van', a {self.occluder} has no class"
            )

    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero."""
        # The order of the draws is part of what a seed means.
        ego_speed = draw(rng, self.ego_speed_mps)
        crossing_x = draw(rng, self.crossing_m)
        traffic = Traffic((1, -1), ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=NO_LIMIT_MPS)
        world = self.empty_world(traffic, ego_speed, rng)
        start_y = self._add_occluder(world, crossing_x, rng)
        self._add_person(world, start_y, crossing_x, ego_speed, rng)
        self.furnish(world, crossing_x, rng)
        # Houses stand behind the pavements, as far from the street's middle on either side.
        front = LEFT_PARKING_Y + PARKING_WIDTH_M / 2 + PAVEMENT_WIDTH_M
        line_with_terraces(world, LANE_WIDTH_M - front, front)
        return world

    @abstractmethod
    def furnish(self, world: World, crossing_x: float, rng: np.random.Generator) -> None:
        """Add what else stands or drives in the street."""

    def _add_occluder(self, world: World, crossing_x: float, rng: np.random.Generator) -> float:
        """Park the occluder. Returns the y from which a person behind it is in its shade."""
        length, width, _ = CATALOGUE[self.occluder].size
        y = RIGHT_PARKING_Y + draw(rng, self.kerb_offset_m)
        x = crossing_x - draw(rng, self.gap_m) - length / 2
        world.add("occluder", self.occluder, (x, y, 0.0), reported=self.occluder_reported)
        return y - width / 2 + SHADE_M

    def _add_person(
        self,
        world: World,
        start_y: float,
        crossing_x: float,
        ego_speed: float,
        rng: np.random.Generator,
    ) -> None:
        speed = draw(rng, self.run_mps)
        encroachment = draw(rng, self.encroachment_s)
        ego_length, ego_width, _ = world.ego_kind.size
        person_length, person_width, _ = CATALOGUE["pedestrian"].size
        # The way from the start until the person's back has left the ego's path, whose middle is 0.
        clear = -start_y + (ego_width + person_length) / 2
        walk = Walk(
            start=(crossing_x, start_y),
            heading=np.pi / 2,
            speed=speed,
            acceleration=self.run_up_mps2,
            length_m=LEFT_PARKING_Y - start_y + PARKING_WIDTH_M,
        )
        # An ego that never brakes arrives with its bumper at the person's line. The person has then
        # been out of its path for the drawn time.
        arrival = (crossing_x - (person_width + ego_length) / 2) / ego_speed
        walk = walk.setting_off(arrival - encroachment - walk.duration_to(clear))
        world.first_sighting = world.add("person", "pedestrian", walk.pose)
