"""Dense street: the same dart-out in a street lined with tracked vehicles.

The reckoning, from geometry and the shares of Algorithm 1 alone (full scan, perfect tracks, at the
keyframe the person first returns three rays): eight tracked hulls compete for the exploitation
share round-robin, six wedges for the reserve. The person's wedge is about 54 cells. Of those a
reserve for every camera box fires, on average over seeds 0-7, 24 at 3%, 34 at 3.5%, 45 at 4% and
all 54 at 5%. Wedges fill from the top row down; the camera stands below the LiDAR, so that the
first three rows of the wedge pass over the person's head, and three hits need four rows, about 32
cells. So at 3% (where six wedges share 148 cells) the all-camera reserve must be late, and from 4%
on the two reserves agree.

Two choices of the street carry this. The rows go on beside the ego, where the LiDAR sees them and
the camera does not: their hulls are large and take their turns. And neither the ego's lane nor the
right kerb beyond the person's line holds a vehicle: a person in front of a tracked vehicle lies
inside its hull, where every policy fires, and would be no first sighting to tell policies apart.

How this layout was chosen: docs/environments/dense.md.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import bounded
from care_sim.scenarios.base import LEFT_PARKING_Y, RIGHT_PARKING_Y
from care_sim.scenarios.crossing import CrossingScenario
from care_sim.streets.dimensions import LANE_WIDTH_M, Range, draw
from care_sim.world.bodies import CATALOGUE
from care_sim.world.world import World

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
    """The street of `CrossingScenario` lined with `vehicles` standing vehicles, and a driver who
    follows the ego. The camera sees five of the vehicles when the person appears.
    """

    vehicles: int = bounded(7, 0, len(VEHICLE_PLACES))
    place_jitter_m: Range = bounded((-0.4, 0.4), -3, 3)
    """How far a standing vehicle is off its place along the street; across, a quarter of that."""

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
