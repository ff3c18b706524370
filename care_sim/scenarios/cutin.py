"""Cut-in: a car pulls out into the ego's lane from in front of a standing bus."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from care_sim.base.checks import bounded
from care_sim.scenarios.base import (
    EGO_SPEED_BOUNDS_MPS,
    USUAL_EGO_SPEED_MPS,
    MirrorableScenario,
    line_with_terraces,
)
from care_sim.streets.layouts import (
    LANE_WIDTH_M,
    SPEED_LIMIT_MPS,
    Range,
    draw,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

RIGHT_FRONT_Y = -LANE_WIDTH_M - 6.0
LEFT_FRONT_Y = LANE_WIDTH_M + 3.0
"""The house fronts, from the middle of the ego's lane. Beside the two lanes this leaves pavements
of 4.25 m on the right, where the stop is, and of 4.75 m on the left.
"""


@dataclass(frozen=True)
class CutIn(MirrorableScenario):
    """A car pulls out into the ego's lane from in front of a standing bus.

    The street has two lanes in the ego's direction, and the ego drives in the left one. A bus
    stands at its stop in the right lane. A car stands hidden in front of the bus and pulls out
    ahead of the ego (lane change and IDM of highway-env). `occluder_reported=False` hides the bus
    from perception. The seed draws uniformly from ranges.
    """

    occluder_reported: bool = True
    ego_speed_mps: Range = bounded(USUAL_EGO_SPEED_MPS, *EGO_SPEED_BOUNDS_MPS)
    stop_m: Range = bounded((42.0, 46.0), 5, 200)
    """From the ego's first position to the front of the bus, far enough to hide the car."""
    gap_m: Range = bounded((2.0, 3.0), 0.05, 50)
    """Gap between bus and car."""
    pull_out_s: Range = bounded((2.0, 2.5), -10, 20)
    """Time gap from the ego to the car's rear when the car pulls out. By UN Regulation 157
    (5.2.5.2), a cut-in at this closing speed is avoidable down to about 1 s."""

    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero."""
        # The order of the draws is part of what a seed means.
        ego_speed = draw(rng, self.ego_speed_mps)
        stop_x = draw(rng, self.stop_m)
        traffic = Traffic((1, 1), ego_lane=1, lane_width=LANE_WIDTH_M, speed_limit=SPEED_LIMIT_MPS)
        world = self.empty_world(traffic, ego_speed, rng)
        occluder = CATALOGUE["bus"]
        car = CATALOGUE["car"]
        stop = (stop_x - occluder.size[0] / 2, -LANE_WIDTH_M, 0.0)
        world.add("occluder", "bus", stop, reported=self.occluder_reported)

        rear_x = stop_x + draw(rng, self.gap_m)
        driver = traffic.add_parked_driver(
            rear_x + car.size[0] / 2, lane=-1, kind=car, target_speed=SPEED_LIMIT_MPS
        )
        world.first_sighting = world.add("cutting-in car", "car", driver)
        # When the bumper of an ego that never brakes comes to where the rear of the car stands.
        arrival = (rear_x - world.ego_kind.size[0] / 2) / ego_speed
        world.at(arrival - draw(rng, self.pull_out_s), partial(driver.pull_out, lane=0))

        line_with_terraces(world, RIGHT_FRONT_Y, LEFT_FRONT_Y)
        return world
