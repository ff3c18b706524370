"""Vehicles of many worlds that keep their lanes, as columns; highway-env moves them one by one.
Bit-identical to a `StraightVehicle` and a `LaneDriver` of `care_sim.world.traffic` that keep a lane
along x. The model is the intelligent driver model with the numbers of highway-env.
"""

import math
from collections.abc import Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.world.lane_flow import (
    BRAKING_MPS2,
    EXPONENT,
    GAINING_MPS2,
    MOST_MPS2,
    STANDING_GAP_M,
    TIME_GAP_S,
)
from care_sim.world.traffic import LaneKeeper

_FASTEST_MPS = 40.0
"""highway-env slows faster vehicles down to this speed."""
_LEAST_APART_M = 0.01
"""Smallest divisor of highway-env."""
_TWO_ROOTS = 2 * math.sqrt(GAINING_MPS2 * BRAKING_MPS2)
_X, _WANTED, _LANE_Y, _START_X, _REACH = 0, 2, 3, 4, 5
SPEED = 1
"""Columns of `LaneColumns.rows`: those of `LaneKeeper`."""


class LaneColumns:
    """The vehicles of each world in the order in which they came to the road, its ego first."""

    counts: Integers
    """(W,) vehicles of each world."""
    rows: Floats
    """(W, V, 6) as `LaneKeeper`."""

    def __init__(self, worlds: int):
        self.counts = np.zeros(worlds, np.int64)
        self.rows = np.zeros((worlds, 2, len(LaneKeeper._fields)))

    def begin(self, world: int, vehicles: Sequence[LaneKeeper]) -> None:
        """Begin an episode with the vehicles of a world."""
        self.rows = filled(self.rows, world, np.array(vehicles, float))
        self.counts[world] = len(vehicles)

    def step(self, moved: Mask, accelerations: Floats, dt: float) -> None:
        """Let the drivers of the worlds that are `moved` (W,) decide, then move all vehicles there
        by `dt` seconds. The egos hold `accelerations` (W,), m/s^2, and do not reverse.
        """
        # The powers are NumPy's, as compiled code may round them differently.
        shares = np.zeros(self.rows.shape[:2])
        ratios = np.zeros(self.rows.shape[:2])
        if self.counts.max() > 1:
            _look_ahead(moved, self.counts, self.rows, shares, ratios)
            shares, ratios = np.power(shares, EXPONENT), np.power(ratios, 2)
        _drive(moved, self.counts, self.rows, accelerations, shares, ratios, dt)


@compiled(brief=True, error_model="numpy")
def _look_ahead(
    moved: Mask, counts: Integers, rows: Floats, shares: Floats, ratios: Floats
) -> None:
    """Write each driver's share of its wanted speed, `shares` (W, V), and the wanted gap over the
    actual one, `ratios` (W, V), 0 with no vehicle ahead.
    """
    for world in range(len(counts)):
        if not moved[world]:
            continue
        for own in range(1, counts[world]):
            row = rows[world, own]
            shares[world, own] = max(row[SPEED], 0.0) / row[_WANTED]
            ahead = _ahead(rows[world], counts[world], own)
            if ahead < 0:
                continue
            other = rows[world, ahead]
            speed = row[SPEED]
            gap = STANDING_GAP_M + speed * TIME_GAP_S + speed * (speed - other[SPEED]) / _TWO_ROOTS
            apart = (other[_X] - row[_START_X]) - (row[_X] - row[_START_X])
            ratios[world, own] = gap / (apart if apart > _LEAST_APART_M else _LEAST_APART_M)


@compiled(brief=True)
def _ahead(rows: Floats, count: int, own: int) -> int:
    """Return the next vehicle ahead in the lane, the last of equally near ones; -1 if none."""
    row = rows[own]
    place = row[_X] - row[_START_X]
    nearest, found = math.inf, -1
    for other in range(count):
        aside = abs(rows[other, _LANE_Y] - row[_LANE_Y])
        there = rows[other, _X] - row[_START_X]
        if other != own and aside <= row[_REACH] and place <= there <= nearest:
            nearest, found = there, other
    return found


@compiled(brief=True)
def _drive(
    moved: Mask,
    counts: Integers,
    rows: Floats,
    accelerations: Floats,
    shares: Floats,
    ratios: Floats,
    dt: float,
) -> None:
    """Move every vehicle. `shares` and `ratios` (W, V) are those of `_look_ahead`, to the powers of
    the model.
    """
    for world in range(len(counts)):
        if not moved[world]:
            continue
        for own in range(counts[world]):
            row = rows[world, own]
            if own == 0:
                held = max(accelerations[world], -row[SPEED] / dt)
            else:
                wish = GAINING_MPS2 * (1 - shares[world, own])
                wish -= GAINING_MPS2 * ratios[world, own]
                held = min(max(wish, -MOST_MPS2), MOST_MPS2)
            if row[SPEED] > _FASTEST_MPS:
                held = min(held, _FASTEST_MPS - row[SPEED])
            elif row[SPEED] < -_FASTEST_MPS:
                held = max(held, -_FASTEST_MPS - row[SPEED])
            row[_X] += row[SPEED] * dt
            row[SPEED] += held * dt
