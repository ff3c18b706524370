"""Dense street: the same dart-out in a street lined with tracked vehicles.

The reckoning, made from geometry alone (seeds 0-29, full scan and perfect tracks, at the keyframe the
person first returns three rays): the hulls of the five vehicles ask for 512 cells on average, hulls and
wedges together for 630 (537-735), the person's wedge for about 60. With rho = 0.3 a budget of

- 3% (492 cells) lets exploitation cover 344. Some 290 vehicle cells stay open and share a reserve of
  148 with the person in six wedges: about 25 cells for the person, from the top of the wedge down, which
  is the margin row and the head. A reserve for every camera box must be late; the residual is not.
- 5% (819 cells) covers 573, more than the hulls. The 120 cells that the wedges add fit into the reserve
  of 246 together with the person's 60. Both reserves must agree.

The right kerb beyond the person's line is free for 20 m: a person in front of a tracked vehicle lies
inside its hull, where every policy fires, and would be no first sighting to tell policies apart.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.errors import InvalidInput
from care_sim.scenarios.base import LEFT_PARKING_Y, RIGHT_PARKING_Y, Range, draw
from care_sim.scenarios.crossing import CrossingScenario
from care_sim.world.bodies import CATALOGUE
from care_sim.world.world import World

DRIVING = "driving"
LEFT, RIGHT = "left", "right"

PLACES = (
    ("car", DRIVING, 12.0),
    ("van", LEFT, -3.0),
    ("car", LEFT, 3.5),
    ("car", LEFT, 9.5),
    ("truck", LEFT, 17.0),
    ("car", RIGHT, 22.0),
    ("car", LEFT, -9.5),
    ("van", RIGHT, 28.5),
    ("car", LEFT, 24.5),
    ("car", LEFT, -16.0),
    ("truck", RIGHT, 36.5),
    ("car", LEFT, 31.0),
)
"""Kind, side, and metres beyond the person's line; the first `vehicles` are taken. Parked bumper to
bumper with 1.5 to 2 m between. The driving one is ahead of the ego in its lane and past the line."""


@dataclass(frozen=True)
class Dense(CrossingScenario):
    """The street of `CrossingScenario` with `vehicles` tracked vehicles in the camera's view: one drives
    ahead (IDM), the others line both kerbs."""

    vehicles: int = 5
    place_jitter_m: Range = (-0.4, 0.4)
    """How far a parked vehicle stands off its place, along and across (a fifth of that)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.vehicles <= len(PLACES):
            raise InvalidInput(f"vehicles must lie in 0..{len(PLACES)}, got {self.vehicles}")

    def furnish(self, world: World, crossing_x: float, rng: np.random.Generator) -> None:
        """Line the street."""
        speed = world.ego.speed
        for number, (kind, side, beyond) in enumerate(PLACES[: self.vehicles]):
            along, across = draw(rng, self.place_jitter_m), draw(rng, self.place_jitter_m) / 5
            name = f"{kind} {number}"
            if side == DRIVING:
                x = ENCOUNTER_M + beyond + along
                world.add(name, kind, world.traffic.add_driver(x, 0, speed, CATALOGUE[kind]))
            else:
                y = LEFT_PARKING_Y if side == LEFT else RIGHT_PARKING_Y
                world.add(name, kind, (crossing_x + beyond + along, y + across, 0.0))


ENCOUNTER_M = 15.0
"""About how far the ego is from the person's line when the person comes into view."""
