"""Which cut-ins the careful human driver of UN Regulation 157 prevents from ending in a collision.

Both vehicles are boxes along the road. The other moves at even speed, along and across; the ego
keeps its speed until its driver brakes, as `care_sim.driving.drivers` says, and then slows down
to the other's speed. So the distance between them follows in closed form, and no step of time
enters.
"""

from collections.abc import Sequence

import numpy as np

from care_sim.driving.drivers import HUMAN_MODEL
from care_sim.scenarios.r157.grid import KPH, CutInCase
from care_sim.world.bodies import CATALOGUE

HARMLESS = "harmless"
"""A car that never brakes is not touched: it has passed before the other is in its way."""
PREVENTABLE = "preventable"
"""A car that never brakes is touched, and the careful human is not."""
UNPREVENTABLE = "unpreventable"
_EGO_LENGTH_M, _EGO_WIDTH_M, _ = CATALOGUE["ego"].size


def verdicts(cases: Sequence[CutInCase]) -> list[str]:
    """For every case `HARMLESS`, `PREVENTABLE` or `UNPREVENTABLE`."""
    human = HUMAN_MODEL
    gap = np.array([case.gap_m for case in cases])
    closing = np.array([case.relative_kph * KPH for case in cases])
    lateral = np.array([case.lateral_mps for case in cases])
    length = np.array([case.length_m for case in cases])
    width = np.array([case.width_m for case in cases])

    # Without braking: where is the ego when the sides of both meet?
    meeting_s = (human.lane_m - (_EGO_WIDTH_M + width) / 2) / lateral
    passed = gap - closing * meeting_s <= -(_EGO_LENGTH_M + length)

    # The gap is least when the ego has come down to the other's speed, and then it stays. An ego
    # that would not have passed is touched as soon as it is beside the other, before or after that.
    danger_s = human.wander_m / lateral + human.evaluation_s
    danger_s = np.maximum(danger_s, gap / closing - human.danger_s)
    braking_s = human.time_to_lose(closing)
    least = gap - closing * (danger_s + braking_s) + human.distance_saved(braking_s)
    words = np.where(passed, HARMLESS, np.where(least > 0, PREVENTABLE, UNPREVENTABLE))
    return [str(word) for word in words]


def preventable(cases: Sequence[CutInCase]) -> list[CutInCase]:
    """Those of the cases that are preventable: they are what is scored."""
    marked = zip(cases, verdicts(cases), strict=True)
    return [case for case, verdict in marked if verdict == PREVENTABLE]
