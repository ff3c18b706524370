"""The ego's closest approach and its impacts."""

import math
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.cells.boxes import half_extents
from care_sim.core.frames import Frame, Pose

INTO_FRONT_M = 0.5
"""Depth behind the bumper at which a body still counts as ahead, metres: the way of a world step at
36 km/h.
"""


@dataclass(frozen=True)
class Impact:
    """The ego's first contact with a `body` of some `kind`, at the ego's own speed `speed_mps`. If
    `at_front`, the body lay ahead and the ego ran into it. Otherwise the body ran into the ego,
    from the side or from behind. `closing_mps` is the magnitude of the velocity difference.
    """

    body: int
    speed_mps: float
    at_front: bool
    kind: str
    closing_mps: float

    @classmethod
    def on(
        cls, body: int, kind: str, boxes: Floats, ego: int, speed_mps: float, velocity: Floats
    ) -> "Impact":
        """Return the impact of the body `ego` on another body, which moves at `velocity` (2,).
        `boxes` (m, 7) are those of all bodies by id.
        """
        own = boxes[ego]
        x, y, heading = own[[0, 1, 6]].tolist()
        vx, vy = velocity.tolist()
        closing_mps = math.hypot(
            speed_mps * math.cos(heading) - vx, speed_mps * math.sin(heading) - vy
        )
        at_front = lies_ahead(boxes[body], (x, y, heading), float(own[3]))
        return cls(body, speed_mps, at_front, kind, closing_mps)


@dataclass(frozen=True)
class ClosestApproach:
    """How close the ego came to the first-sighting actor while the world advanced.

    `nearest_m` is from centre to centre and `clearance_m` from hull to hull, inf without such an
    actor. `impact` is the ego's first contact with any body, else None.
    """

    nearest_m: float
    clearance_m: float
    impact: Impact | None

    @property
    def impact_speed_mps(self) -> float | None:
        """The ego's speed at the impact, None without one."""
        return self.impact.speed_mps if self.impact else None


def lies_ahead(box: Floats, ego: Pose, length: float) -> bool:
    """Return True if a box (7,) lies wholly ahead of a car's front, less `INTO_FRONT_M`. The car is
    at the pose `ego` and has this length; all is in the world frame.
    """
    local = Frame.mounted(ego, (0.0, 0.0, 0.0)).boxes_to_local(np.asarray(box)[None])
    (half_x,), _ = half_extents(local)
    return bool(local[0, 0] - half_x >= length / 2 - INTO_FRONT_M)
