"""Dart-out: a person runs out from behind a parked trailer, into an empty or a dense street."""

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
    MirrorableScenario,
    line_with_terraces,
)
from care_sim.streets.layouts import (
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
    """A person runs out from behind an occluder in a two-way street with parking lanes.

    The occluder stands in the right parking lane. The person waits hidden behind its far end, then
    runs straight across to the far kerb. Perception does not report a trailer or a hoarding, which
    are none of the five classes. `occluder="truck"` (or "van") with `occluder_reported=True` is
    the second reading of the scene: the person emerges inside the dilated hull of a track. The
    seed draws uniformly from ranges.
    """

    occluder: str = one_of("trailer", OCCLUDERS)
    occluder_reported: bool = False
    ego_speed_mps: Range = bounded(USUAL_EGO_SPEED_MPS, *EGO_SPEED_BOUNDS_MPS)
    crossing_m: Range = bounded((37.0, 41.0), 5, 200)
    """From the ego's start to the person's line: four to five seconds, in which tracks settle."""
    gap_m: Range = bounded((0.8, 1.2), 0.05, 20)
    """From the occluder's end to the person's line, about a step."""
    # No sprinter exceeds 12.5 m/s.
    run_mps: Range = bounded((2.6, 2.8), 0.1, 12.5)
    """A run of 6 mph (Compendium of Physical Activities 2011, code 12050)."""
    run_up_mps2: float = bounded(5.0, 0.1, 20)
    """Full speed after half a second and 0.7 m, still hidden."""
    kerb_offset_m: Range = bounded((-0.2, 0.2), -1, 1)
    """Offset of the occluder from the middle of the parking lane."""
    # Picked from geometry alone: a full scan detects the person at about the paper's 15 m.
    encroachment_s: Range = bounded((0.3, 0.6), -10, 10)
    """Post-encroachment time (Allen, Shin and Cooper 1978) of an ego that never brakes. Above 0 the
    person leaves the ego's way in time. Below 0 the ego hits the person."""

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


@dataclass(frozen=True)
class Dartout(CrossingScenario):
    """A person runs out from behind a parked trailer into an empty street."""

    def furnish(self, world: World, crossing_x: float, rng: np.random.Generator) -> None:
        """Leave the street empty."""


# The dense street. The computation, from geometry and the shares of Algorithm 1 alone (full scan,
# perfect tracks, at the keyframe the person first returns three rays): eight tracked hulls compete
# for the exploitation share round-robin, six wedges for the reserve. The person's wedge is about 54
# cells. A reserve for every camera box fires 24 of them at 3%, 34 at 3.5%, 45 at 4% and all 54 at
# 5%, on average over seeds 0-7. Wedges fill from the top row down; the camera stands below the
# LiDAR, so that the first three rows of the wedge pass over the person's head, and three hits need
# four rows, about 32 cells. So at 3% (where six wedges share 148 cells) the all-camera reserve must
# be late, and from 4% on the two reserves agree. Two choices of the street carry this. The rows go
# on beside the ego, where the LiDAR sees them and the camera does not: their hulls are large and
# take their turns. And neither the ego's lane nor the right kerb beyond the person's line holds a
# vehicle: a person in front of a tracked vehicle lies inside its hull, where every policy fires,
# and would be no first sighting to tell policies apart. docs/environments/dense.md says how this
# layout was chosen.

DOUBLE_PARKED_Y = LANE_WIDTH_M
KERBS = {"left": LEFT_PARKING_Y, "right": RIGHT_PARKING_Y, "oncoming": DOUBLE_PARKED_Y}

VEHICLE_PLACES = (
    ("van", "left", -3.8),
    ("car", "left", 3.9),
    ("truck", "left", 11.0),
    ("van", "oncoming", 9.0),
    ("car", "left", -10.0),
    ("car", "left", -16.5),
    ("car", "right", -17.0),
    ("car", "left", -23.0),
    ("car", "right", -23.5),
    ("van", "left", -30.0),
    ("car", "right", -30.0),
    ("car", "left", -36.5),
)
"""Kind, where it stands, and metres beyond the person's line. The first five are in the camera's
view at the encounter: a parked row with a gap to walk through, and a double-parked van. The others
go on beside and behind the ego, where only the LiDAR sees them. The first `vehicles` are taken."""

FOLLOWER_M = -22.5
"""A driver follows the ego at the distance that highway-env's IDM keeps at 30 km/h: 10 m plus 1.5
s.
"""


@dataclass(frozen=True)
class Dense(CrossingScenario):
    """The dart-out in a street lined with tracked vehicles.

    `vehicles` stand along the street, and a driver follows the ego. The camera shows five of them
    when the person appears.
    """

    vehicles: int = bounded(7, 0, len(VEHICLE_PLACES))
    place_jitter_m: Range = bounded((-0.4, 0.4), -3, 3)
    """Offset of a standing vehicle along the street. Across, a quarter of such a draw."""

    def furnish(self, world: World, crossing_x: float, rng: np.random.Generator) -> None:
        """Line the street."""
        # Both jitters of every vehicle are drawn, in this order, as part of what a seed means.
        for number, (kind, kerb, beyond) in enumerate(VEHICLE_PLACES[: self.vehicles]):
            along = draw(rng, self.place_jitter_m)
            across = draw(rng, self.place_jitter_m) / 4
            world.add(
                f"{kind} {number}", kind, (crossing_x + beyond + along, KERBS[kerb] + across, 0.0)
            )
        follower = world.traffic.add_driver(FOLLOWER_M, 0, world.ego.speed, CATALOGUE["car"])
        world.add("follower", "car", follower)
