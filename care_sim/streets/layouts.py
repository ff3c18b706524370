"""Road layouts: the roads of a scene and their cross-sections. They are drawn first, and everything
else is placed on them.

A road's reference line (d = 0) is the middle of the lane that leads along it; traffic keeps right.
Widths follow the German RASt 06 (directives for urban streets).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose

Range = tuple[float, float]
"""Low and high. The seed draws uniformly between them."""

SPEED_LIMIT_MPS = 30 / 3.6
"""All scenarios take place in a 30 km/h zone, the residential default of many European cities."""
LANE_WIDTH_M = 3.5
"""Width of a traffic lane (German RASt 06)."""
PARKING_WIDTH_M = 2.5
"""Width of a parking lane that lorries may use (RASt 06)."""
PAVEMENT_WIDTH_M = 2.5
"""Width between parking lane and houses (RASt 06)."""


def draw(rng: np.random.Generator, values: Range) -> float:
    """A uniform draw from a range (low, high)."""
    return float(rng.uniform(*values))


@dataclass(frozen=True)
class Curve:
    """A straight, one bend, and a straight again. Metres and radians.

    Road coordinates: `s` along the line, `d` to its left, headings relative to its own. The line
    begins at the world pose `start` with s = 0; it bends from `bend_at` on for `bend_length` with
    `curvature` (1/m, positive to the left). Before 0 and after the bend it goes on straight.
    """

    start: Pose = (0.0, 0.0, 0.0)
    bend_at: float = 0.0
    bend_length: float = 0.0
    curvature: float = 0.0

    def heading(self, s: Floats | float) -> Floats:
        """World heading of the line at `s`."""
        along = np.clip(np.asarray(s) - self.bend_at, 0.0, self.bend_length)
        return np.asarray(self.start[2] + self.curvature * along)

    def curvature_at(self, s: float) -> float:
        """Curvature of the line at `s`, 1/m."""
        return self.curvature if self.bend_at <= s < self.bend_at + self.bend_length else 0.0

    def to_world(self, places: Floats) -> Floats:
        """World poses (..., 3: x, y, heading) of places (..., 3: s, d, heading) on the road."""
        rows = np.ascontiguousarray(places, dtype=float)
        return place_on(self.line, rows.reshape(-1, 3)).reshape(rows.shape)

    @cached_property
    def line(self) -> Floats:
        """(1, 8) `bend_at`, `bend_length`, `curvature`, x, y and heading of the `start`, and the
        heading's cosine and sine.
        """
        turn = np.cos(self.start[2]), np.sin(self.start[2])
        return np.array([(self.bend_at, self.bend_length, self.curvature, *self.start, *turn)])


def place_on(lines: Floats, rows: Floats) -> Floats:
    """World poses (n, 3) of places (n, 3) on roads, as `Curve.to_world`. The places are on the
    roads' `lines` (m, 8) in turn, again and again.
    """
    turns = _AHEAD
    if lines[:, 2].any():
        along = rows[:, 0].reshape(-1, len(lines)) - lines[:, 0]
        turns = _turns((lines[:, 2] * np.minimum(np.maximum(along, 0.0), lines[:, 1])).ravel())
    return np.asarray(_placed(rows, turns, lines))


def _turns(turns: Floats) -> Floats:
    """Return (6, n) the `turns` (n,) of a line since its start, and the ratios of chord to arc.
    Then come cosine and sine of half of each turn, and of the turn.
    """
    # The chord of a circle's arc is 2 R sin(turn / 2) with the radius R = along / turn. NumPy's
    # sinc(x) is sin(pi x) / (pi x) and 1 at 0, where the road is straight and R infinite.
    half = turns / 2
    shares = np.sinc(turns / (2 * np.pi))
    return np.array([turns, shares, np.cos(half), np.sin(half), np.cos(turns), np.sin(turns)])


_AHEAD = _turns(np.zeros(1))
"""The line of a straight road turns nowhere."""


@compiled()
def _placed(rows: Floats, turns: Floats, lines: Floats) -> Floats:
    """Return `place_on`. The columns of `turns` are those of `_turns` at each row, or one for
    all.
    """
    world = np.empty(rows.shape)
    for n in range(len(rows)):
        s, d, heading = rows[n]
        at, length, _, start_x, start_y, ahead, cos_ahead, sin_ahead = lines[n % len(lines)]
        turn, share, cos_half, sin_half, cos, sin = turns[:, min(n, turns.shape[1] - 1)]
        # Three parts, one after the other: the straight before lies along x, the chord at half the
        # turn, the straight after at the whole turn. d goes to the left of where the line points.
        chord = min(max(s - at, 0.0), length) * share
        after = max(s - at - length, 0.0)
        x = min(s, at) + chord * cos_half + after * cos - d * sin
        y = chord * sin_half + after * sin + d * cos
        world[n, 0] = cos_ahead * x - sin_ahead * y + start_x
        world[n, 1] = sin_ahead * x + cos_ahead * y + start_y
        world[n, 2] = ahead + turn + heading
    return world


PAVEMENT_M: Range = (PAVEMENT_WIDTH_M, 4.0)
"""From the least of RASt 06 to that of a shopping street."""
CYCLE_LANE_M = 1.5
"""An advisory cycle lane (RASt 06)."""
CONTRAFLOW_M = 2.0
"""A cycle lane against a one-way street, with the strip that keeps clear of car doors (RASt 06)."""
GARDEN_M: Range = (3.0, 6.0)
"""Front gardens: the usual set-back of a building line."""
BEND_RADIUS_M: Range = (30.0, 60.0)
"""At 30 km/h a sideways acceleration of 2.3 to 1.2 m/s^2: what drivers take in an urban bend."""
BEND_TURN: Range = (np.deg2rad(30.0), np.deg2rad(90.0))
"""From a bend with free sight to a corner without."""
BEND_AT_M: Range = (15.0, 60.0)
JUNCTION_AT_M: Range = (25.0, 80.0)
"""Distance ahead of the ego's start, so that the ego passes it within the scene."""
JUNCTION_ANGLE: Range = (np.deg2rad(75.0), np.deg2rad(105.0))
"""Angle of a junction: RASt 06 wants nearly square ones."""
EVEN_CHANCE = 0.5
"""Chance of either of two equal forms."""


@dataclass(frozen=True)
class Side:
    """One side of a road, from the edge of its outer lane outwards; `sign` is +1 on the left, -1 on
    the right.
    """

    sign: int
    lane_edge_m: float
    cycle_m: float
    parking_m: float
    pavement_m: float
    garden_m: float

    @property
    def cycle_d(self) -> float:
        """Middle of the cycle lane."""
        return self.sign * (self.lane_edge_m + self.cycle_m / 2)

    @property
    def parking_d(self) -> float:
        """Middle of the parking lane."""
        return self.sign * (self.lane_edge_m + self.cycle_m + self.parking_m / 2)

    @property
    def kerb_m(self) -> float:
        """From the reference line to the pavement's inner edge."""
        return self.lane_edge_m + self.cycle_m + self.parking_m

    @property
    def boundary_m(self) -> float:
        """From the reference line to the private ground."""
        return self.kerb_m + self.pavement_m

    @property
    def front_m(self) -> float:
        """From the reference line to the house fronts."""
        return self.boundary_m + self.garden_m


@dataclass(frozen=True)
class Road:
    """A road: its line, the directions of its lanes from right to left (+1 along it), and its two
    sides.
    """

    curve: Curve
    directions: tuple[int, ...]
    right: Side
    left: Side

    @property
    def sides(self) -> tuple[Side, Side]:
        """Right, left."""
        return self.right, self.left

    def side(self, sign: int) -> Side:
        """The left side for +1, the right one for -1."""
        return self.left if sign > 0 else self.right

    @property
    def middle_d(self) -> float:
        """Middle between the kerbs."""
        return (self.left.kerb_m - self.right.kerb_m) / 2


@dataclass(frozen=True)
class Joining:
    """A side street: it begins at the main road's `at_m`, on the side `sign`, and leads away from
    it.
    """

    road: Road
    at_m: float
    sign: int


@dataclass(frozen=True)
class Plan:
    """The roads of a scene. The ego drives in lane 0 of the main one, along it."""

    main: Road
    joinings: tuple[Joining, ...] = ()


def straight(rng: np.random.Generator) -> Plan:
    """A straight two-way street with parking on both sides."""
    return Plan(_road(rng, Curve()))


def bend(rng: np.random.Generator) -> Plan:
    """A two-way street that bends, left or right, round a corner of houses."""
    radius = draw(rng, BEND_RADIUS_M)
    turn = draw(rng, BEND_TURN)
    side = rng.choice((-1, 1))
    return Plan(
        _road(rng, Curve((0.0, 0.0, 0.0), draw(rng, BEND_AT_M), radius * turn, side / radius))
    )


def junction(rng: np.random.Generator) -> Plan:
    """A two-way street with a T-junction, or a crossing, whose side streets give way."""
    main = _road(rng, Curve())
    at = draw(rng, JUNCTION_AT_M)
    first = int(rng.choice((-1, 1)))
    signs = (first,) if rng.random() < EVEN_CHANCE else (first, -first)
    return Plan(main, tuple(Joining(_joining(rng, at, sign), at, sign) for sign in signs))


def one_way(rng: np.random.Generator) -> Plan:
    """A one-way street with a cycle lane against it, and a side street as often as not."""
    main = _road(rng, Curve(), directions=(1,), cycles=(0.0, CONTRAFLOW_M))
    if rng.random() < EVEN_CHANCE:
        return Plan(main)
    at = draw(rng, JUNCTION_AT_M)
    sign = int(rng.choice((-1, 1)))
    return Plan(main, (Joining(_joining(rng, at, sign), at, sign),))


LAYOUTS: dict[str, Callable[[np.random.Generator], Plan]] = {
    "straight": straight,
    "bend": bend,
    "junction": junction,
    "one-way": one_way,
}
"""Makers of layouts by name. Scenes take them in turn."""


def _joining(rng: np.random.Generator, at: float, sign: int) -> Road:
    """A two-way side street; its carriageway meets the main line at `at`."""
    heading = sign * draw(rng, JUNCTION_ANGLE)
    # The line is the middle of the right lane. Half a lane to the right of `at` it leaves the
    # middle between both lanes at `at`.
    start: Pose = (
        at + LANE_WIDTH_M / 2 * float(np.sin(heading)),
        -LANE_WIDTH_M / 2 * float(np.cos(heading)),
        heading,
    )
    return _road(rng, Curve(start), cycles=(0.0, 0.0))


def _road(
    rng: np.random.Generator,
    curve: Curve,
    directions: tuple[int, ...] = (1, -1),
    cycles: tuple[float, float] | None = None,
) -> Road:
    if cycles is None:
        cycles = (CYCLE_LANE_M,) * 2 if rng.random() < EVEN_CHANCE else (0.0, 0.0)
    # The reference line is the middle of the rightmost lane: half a lane from the right edge. The
    # draws go from right to left.
    right, left = (
        Side(
            sign,
            LANE_WIDTH_M * (0.5 if sign < 0 else len(directions) - 0.5),
            cycle,
            PARKING_WIDTH_M,
            draw(rng, PAVEMENT_M),
            draw(rng, GARDEN_M) if rng.random() < EVEN_CHANCE else 0.0,
        )
        for sign, cycle in zip((-1, 1), cycles, strict=True)
    )
    return Road(curve, directions, right, left)
