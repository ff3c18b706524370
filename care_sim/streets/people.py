"""People who walk and cycle: along the pavements, across the street in a gap of the traffic, out of
a yard or a garden.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.draft import Draft
from care_sim.streets.furniture import Span
from care_sim.streets.layouts import EVEN_CHANCE, Curve, Range, Road, Side, draw

WALKING_MPS = 1.34
WALKING_SPREAD_MPS = 0.26
"""Speeds of people on foot: normally distributed (Weidmann 1993, Transporttechnik der Fussgaenger),
cut at two spreads.
"""
CYCLING_MPS = 4.25
CYCLING_SPREAD_MPS = 0.9
"""15.3 km/h, the mean of conventional bicycles in the German Naturalistic Cycling Study (Schleinitz
et al. 2017); the spread is a fifth of it, as that of people on foot. Cut at two spreads."""
PEOPLE_PER_100M: Range = (1.0, 8.0)
"""People on 100 m of one pavement, drawn per scene. nuScenes annotates 6.4 people per keyframe (218
thousand in 34 thousand), not all within 50 m. Two pavements within 50 m are 200 m, and parked
vehicles or other people hide half of the people there. So 6.4 on 100 m would give that number.
"""
STANDING_SHARE = 0.28
"""Annotations of people in nuScenes with attribute standing or sitting: 60 of 218 thousand."""
CROSSERS = 2.5
EMERGING = 2.5
"""Mean numbers of people per scene who cross the main road, and who step out of a yard or a garden.
Most scenes then have a few of both. Both are Poisson.
"""
CYCLISTS_PER_H: Range = (20.0, 100.0)
"""Per hour on a cycle lane: from the 11% of all trips (Mobilitaet in Deutschland 2017) beside weak
traffic to twice that beside strong traffic."""
BICYCLES_PER_100M = 0.2
"""Standing bicycles on 100 m of pavement. In nuScenes 0.26 per keyframe have no rider (8,946 in 34
thousand), on 200 m of pavement. A third of them are hidden.
"""
PERSON_BERTH_M = 0.1
PAVEMENT_MARGIN_M = 0.5
"""People keep off walls and kerbs by half a metre (the shy distance of the Highway Capacity
Manual).
"""
TRIES = 40
"""Most ways drawn for a person until one is free. Without a free one the person is left out."""


@dataclass(frozen=True)
class Walked:
    """A way covered at constant `speed` (m/s): a person's or a cyclist's.

    `corners` (k, 2) are s and d of the way's corners on `curve`. The walker is at the beginning at
    `starts_s`, and stands at either end before and after. Distances are measured in the world, so
    that the speed holds in a bend.
    """

    curve: Curve
    corners: tuple[tuple[float, float], ...]
    speed: float
    starts_s: float = 0.0

    STRIDE_M = 1.0

    def poses(self, times: Floats) -> Floats:
        """World poses (t, 3) at `times` (t,)."""
        points = self._points()
        legs = points[1:] - points[:-1]
        # Metres done at every point of the way, and by the walker at every time.
        covered = np.zeros(len(points))
        np.cumsum(np.hypot(legs[:, 0], legs[:, 1]), out=covered[1:])
        way = np.minimum(np.maximum(self.speed * (times - self.starts_s), 0.0), covered[-1])
        # A walker at the end still faces along the last leg.
        leg = legs[np.minimum(covered[1:].searchsorted(way, side="right"), len(legs) - 1)]
        poses = np.empty((len(times), 3))
        for axis in (0, 1):
            poses[:, axis] = np.interp(way, covered, points[:, axis])
        poses[:, 2] = np.arctan2(leg[:, 1], leg[:, 0])
        return poses

    def _points(self) -> Floats:
        """(n, 2) world points of the way, about a stride apart at most, to follow bends."""
        places = [np.array([(*self.corners[0], 0.0)])]
        for start, end in zip(self.corners, self.corners[1:], strict=False):
            ahead, aside = end[0] - start[0], end[1] - start[1]
            pieces = max(math.ceil(np.hypot(ahead, aside) / self.STRIDE_M), 1)
            shares = np.arange(1, pieces + 1)[:, None] / pieces
            places.append((*start, 0.0) + shares * (ahead, aside, 0.0))
        return self.curve.to_world(np.concatenate(places))[:, :2]


def populate(draft: Draft, road: Road, span: Span) -> None:
    """Put people and standing bicycles on the pavements of a road, cyclists on its cycle lanes."""
    density = draw(draft.rng, PEOPLE_PER_100M)
    for side in road.sides:
        _populate_side(draft, road, side, span, density)
        if side.cycle_m:
            _cycle(draft, road, side, span)


def _populate_side(
    draft: Draft, road: Road, side: Side, span: Span, people_per_100m: float
) -> None:
    hundreds = (span[1] - span[0]) / 100.0
    people = draft.rng.poisson(people_per_100m * hundreds)
    # Standing people come first: they need a place, and walkers can go round them.
    standing = draft.rng.binomial(people, STANDING_SHARE)
    for _ in range(standing):
        _stand(draft, "pedestrian", lambda: _waiting(draft, road, side, span))
    for _ in range(people - standing):
        _walk_about(draft, lambda: _strolling(draft, road, side, span))
    for _ in range(draft.rng.poisson(BICYCLES_PER_100M * hundreds)):
        _stand(draft, "bicycle", lambda: _leaning(draft, road, side, span))


def cross_and_emerge(draft: Draft, road: Road, span: Span) -> None:
    """Let people cross a road between what stands and what drives, and step out from between houses
    and hedges.
    """
    for _ in range(draft.rng.poisson(CROSSERS)):
        _walk_about(draft, lambda: _crossing(draft, road, span))
    for _ in range(draft.rng.poisson(EMERGING)):
        _walk_about(draft, lambda: _emerging(draft, road, span))


def _walk_about(draft: Draft, draw_way: Callable[[], Floats]) -> None:
    # The first free way ends the tries.
    any(draft.move("pedestrian", draw_way(), PERSON_BERTH_M) for _ in range(TRIES))


def _stand(draft: Draft, kind: str, draw_place: Callable[[], Floats]) -> None:
    any(draft.stand(kind, draw_place()) for _ in range(TRIES))


def _speed(rng: np.random.Generator, mean: float, spread: float) -> float:
    return float(np.clip(rng.normal(mean, spread), mean - 2 * spread, mean + 2 * spread))


def _walk(draft: Draft, road: Road, *corners: tuple[float, float], passes: float) -> Floats:
    """Return the path of a person past `corners`; `passes` metres of it are done at a random
    time.
    """
    speed = _speed(draft.rng, WALKING_MPS, WALKING_SPREAD_MPS)
    # Back from that moment to the start, which may lie before the scene.
    starts = draft.rng.uniform(0.0, float(draft.times[-1])) - passes / speed
    return Walked(road.curve, corners, speed, float(starts)).poses(draft.times)


def _waiting(draft: Draft, road: Road, side: Side, span: Span) -> Floats:
    """Draw a place (3,) on a pavement, facing anywhere."""
    place = draft.rng.uniform(*span), _pavement_d(draft, side), draft.rng.uniform(-np.pi, np.pi)
    return road.curve.to_world(np.array(place))


def _strolling(draft: Draft, road: Road, side: Side, span: Span) -> Floats:
    """Along a pavement."""
    s = draft.rng.uniform(*span)
    d = _pavement_d(draft, side)
    ahead = float(draft.rng.choice((-1, 1))) * _far(draft)
    return _walk(draft, road, (s - ahead, d), (s + ahead, d), passes=_far(draft))


def _crossing(draft: Draft, road: Road, span: Span) -> Floats:
    """Along a pavement, straight across, and on along the other one."""
    s = draft.rng.uniform(*span)
    sides = road.sides if draft.rng.random() < EVEN_CHANCE else road.sides[::-1]
    near, far = (_pavement_d(draft, side) for side in sides)
    before, after = (float(way) * _far(draft) for way in draft.rng.choice((-1, 1), 2))
    return _walk(
        draft, road, (s + before, near), (s, near), (s, far), (s + after, far), passes=_far(draft)
    )


def _emerging(draft: Draft, road: Road, span: Span) -> Floats:
    """From between the houses straight to the pavement, and on along it."""
    side = road.sides[int(draft.rng.integers(2))]
    s = draft.rng.uniform(*span)
    d = _pavement_d(draft, side)
    depth = side.sign * (side.front_m + 5.0)
    after = float(draft.rng.choice((-1, 1))) * _far(draft)
    return _walk(draft, road, (s, depth), (s, d), (s + after, d), passes=abs(depth - d))


def _leaning(draft: Draft, road: Road, side: Side, span: Span) -> Floats:
    """A place (3,) for a bicycle along the wall or fence at the pavement's far edge."""
    d = side.sign * (side.boundary_m - PAVEMENT_MARGIN_M)
    return road.curve.to_world(
        np.array([draft.rng.uniform(*span), d, float(draft.rng.choice((0.0, np.pi)))])
    )


def _cycle(draft: Draft, road: Road, side: Side, span: Span) -> None:
    """Add cyclists on one cycle lane. They keep right: along the line on its right side, against it
    on its left.
    """
    per_m = draw(draft.rng, CYCLISTS_PER_H) / 3600.0 / CYCLING_MPS
    along = -side.sign
    reach = along * 2 * CYCLING_MPS * float(draft.times[-1])
    # Also cyclists who enter the span during the scene: they start before it by the way that they
    # ride.
    for _ in range(draft.rng.poisson(per_m * (span[1] - span[0] + abs(reach)))):
        s = draft.rng.uniform(min(span[0], span[0] - reach), max(span[1], span[1] - reach))
        speed = _speed(draft.rng, CYCLING_MPS, CYCLING_SPREAD_MPS)
        way = Walked(road.curve, ((s, side.cycle_d), (s + reach, side.cycle_d)), speed)
        draft.move("bicycle", way.poses(draft.times), PERSON_BERTH_M)


def _pavement_d(draft: Draft, side: Side) -> float:
    return side.sign * float(
        draft.rng.uniform(side.kerb_m + PAVEMENT_MARGIN_M, side.boundary_m - PAVEMENT_MARGIN_M)
    )


def _far(draft: Draft) -> float:
    """Return a distance that nobody walks in a scene."""
    return (WALKING_MPS + 2 * WALKING_SPREAD_MPS) * float(draft.times[-1] + 1.0)
