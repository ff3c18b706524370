"""Which cut-ins paragraph 5.2.5.2 of UN Regulation 157 obliges the system to avoid.

The regulation's own short form of what can be prevented: the other keeps its lower speed, its
lateral movement has been visible for `VISIBLE_S`, and at the lane intrusion the time to collision
is above v_rel / (2 * 6 m/s^2) + 0.35 s. The intrusion is when the outside of its front tyre crosses
a line 0.3 m beyond the lane marking. Here the tyre is the side of the box, and the marking a line.
"""

from care_sim.driving.drivers import HUMAN_MODEL
from care_sim.scenarios.r157.grid import KPH, CutInCase

VISIBLE_S = 0.72
BEYOND_MARKING_M = 0.3
DECELERATION_MPS2 = 6.0
REACTION_S = 0.35


def intrusion_s(case: CutInCase) -> float:
    """Seconds from the begin of the lane change to the lane intrusion."""
    to_marking = (HUMAN_MODEL.lane_m - case.width_m) / 2
    return (to_marking + BEYOND_MARKING_M) / case.lateral_mps


def must_be_avoided(case: CutInCase) -> bool:
    """Whether a collision must be avoided."""
    closing = case.relative_kph * KPH
    intrusion = intrusion_s(case)
    ttc = case.gap_m / closing - intrusion
    return intrusion >= VISIBLE_S and ttc > closing / (2 * DECELERATION_MPS2) + REACTION_S
