"""Kerbs of a street: the lines that pictures show."""

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.core.frames import turned
from care_sim.streets.layouts import Plan, Range, Road

KERB_STEP_M = 0.5
"""Distance between the points of a kerb, and so the accuracy of its openings."""


def kerb_lines(plan: Plan, span: Range, joining_m: float) -> tuple[Floats, ...]:
    """Return the kerbs of all roads as lines (n, 2) in the world, open where roads meet. `span` is
    that of the main road; side streets are `joining_m` long.
    """
    roads = [(plan.main, span), *((each.road, (0.0, joining_m)) for each in plan.joinings)]
    lines: list[Floats] = []
    for road, reach in roads:
        s = np.arange(*reach, KERB_STEP_M)
        for side in road.sides:
            d = np.full_like(s, side.sign * side.kerb_m)
            line = road.curve.to_world(np.column_stack([s, d, np.zeros_like(s)]))[:, :2]
            is_open = np.zeros(len(s), bool)
            for other, length in roads:
                if other is not road:
                    is_open |= _between_kerbs(other, length, line)
            parts = np.split(np.arange(len(s)), np.flatnonzero(np.diff(is_open)) + 1)
            lines += [line[part] for part in parts if not is_open[part[0]]]
    return tuple(lines)


def _between_kerbs(road: Road, span: Range, points: Floats) -> Mask:
    """Return (n,) whether world points (n, 2) lie between the kerbs of a road that meets others.
    Such a road is straight.
    """
    x, y, heading = road.curve.start
    s, d = turned(points - [x, y], -heading).T
    half_m = (road.left.kerb_m + road.right.kerb_m) / 2
    holds: Mask = (np.abs(d - road.middle_d) < half_m) & (span[0] <= s) & (s <= span[1])
    return holds
