"""The standing cars that hide a target, as poses: right-hand traffic, the target from the right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.frames import Pose
from care_sim.scenarios.ncap.forms import Obstruction, ParkedAlong, StandingAcross, WaitingBeside
from care_sim.world.bodies import BodyKind, Triple, sized


@dataclass(frozen=True)
class Sizes:
    """Length, width and height of the small and of the large car."""

    small: Triple
    large: Triple


@dataclass(frozen=True)
class Standing:
    """A car and where it stands."""

    kind: BodyKind
    pose: Pose


def standing_cars(
    obstruction: Obstruction | None,
    sizes: Sizes,
    line_x: float,
    target_width: float,
    ego_width: float,
) -> list[Standing]:
    """The cars of an obstruction. The middle line of the target's way is at x = `line_x`; the ego's
    is y = 0.
    """
    if obstruction is None:
        return []
    match obstruction:
        case ParkedAlong():
            return _parked(obstruction, sizes, line_x - target_width / 2, ego_width / 2)
        case StandingAcross():
            return _standing(obstruction, sizes, line_x - target_width / 2)
        case WaitingBeside():
            return _waiting(obstruction, sizes, line_x)


def _parked(way: ParkedAlong, sizes: Sizes, side_x: float, ego_side: float) -> list[Standing]:
    # Both have the middle line of the large one.
    y = -(ego_side + way.beside_m + sizes.large[1] / 2)
    order = (sizes.small, sizes.large)
    fronts = _fronts(side_x - way.gap_m, order, way.gap_m)
    return [
        _car(size, front - size[0] / 2, y, 0.0) for size, front in zip(order, fronts, strict=True)
    ]


def _standing(way: StandingAcross, sizes: Sizes, side_x: float) -> list[Standing]:
    order = (sizes.large, sizes.small)
    fronts = _fronts(-way.end_m, order, way.gap_m)
    # Their sides towards the target are in line.
    side = side_x - way.before_m
    return [
        _car(size, side - size[1] / 2, front - size[0] / 2, -np.pi / 2)
        for size, front in zip(order, fronts, strict=True)
    ]


def _waiting(way: WaitingBeside, sizes: Sizes, line_x: float) -> list[Standing]:
    order = (sizes.large, sizes.small, sizes.small)
    fronts = _fronts(line_x - way.before_m, order, way.gap_m)
    return [
        _car(size, front - size[0] / 2, -way.beside_m - size[1] / 2, 0.0)
        for size, front in zip(order, fronts, strict=True)
    ]


def _fronts(first: float, order: Sequence[Triple], gap: float) -> list[float]:
    """Where the nearer ends of cars lie that stand one behind the other, from `first` downwards."""
    behind = np.cumsum([0.0, *(size[0] + gap for size in order[:-1])])
    return [first - float(each) for each in behind]


def _car(size: Triple, x: float, y: float, heading: float) -> Standing:
    return Standing(sized("obstructing car", "car", size), (x, y, heading))
