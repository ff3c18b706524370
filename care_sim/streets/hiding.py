"""Behind what somebody waits beside a road, and where it stands."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.frames import Pose
from care_sim.streets.dimensions import Range, draw
from care_sim.streets.furniture import CORNER_M
from care_sim.streets.layouts import EVEN_CHANCE, Road, Side
from care_sim.world.bodies import CATALOGUE

GAP_M: Range = (0.4, 0.8)
"""Between the occluder's end and who passes it: about half a step, as in the dart-out."""
AT_KERB = {
    "child": (("car", "van", "truck"), ("skip", "trailer", "hoarding")),
    "pedestrian": (("van", "truck", "bus"), ("trailer", "hoarding")),
}
"""Who comes out between what stands at the kerb: behind what perception reports, and behind what it
does not. A car or a skip is lower than an adult.
"""
AT_GARDEN = ("wall", "hedge", "hoarding")
AT_YARD = ("building",)
"""What stands between pavement and garden, and beside an entrance to a yard where the houses stand
at the pavement; perception reports none of it.
"""


@dataclass(frozen=True)
class Spot:
    """A part of the way where somebody may be met, `within_m` metres along `road`; the ego's place
    on its route is the road's and `offset_m`.

    On a side street `beside` is the side of the main road at which it begins. At a `corner` the ego
    has just turned into it.
    """

    road: Road
    within_m: Range
    offset_m: float = 0.0
    beside: Side | None = None
    corner: bool = False

    @property
    def along_m(self) -> Range:
        """From where to where it lies along the route."""
        return self.within_m[0] + self.offset_m, self.within_m[1] + self.offset_m


@dataclass(frozen=True)
class Hiding:
    """An `occluder` at a world `pose`. Who waits behind it comes out along the line across the road
    at `s`, and shows beyond `edge_m` from the road's reference line.
    """

    occluder: str
    pose: Pose
    s: float
    edge_m: float


def is_reported(occluder: str) -> bool:
    """Whether perception knows the class of a body of the catalogue."""
    return CATALOGUE[occluder].label is not None


def draw_hiding(rng: np.random.Generator, spot: Spot, side: Side, who: str) -> Hiding | None:
    """Somewhere to hide for `who` comes from a side of a spot's road; None where the drawn body may
    not stand.
    """
    at_kerb = who in AT_KERB and rng.random() < EVEN_CHANCE
    beyond = AT_GARDEN if side.garden_m else AT_YARD
    kinds = AT_KERB[who][int(rng.integers(2))] if at_kerb else beyond
    occluder = str(rng.choice(kinds))
    gap = CATALOGUE[who].size[1] / 2 + draw(rng, GAP_M)
    s = draw(rng, spot.within_m)
    length, width, _ = CATALOGUE[occluder].size
    if spot.corner and not at_kerb and rng.random() < EVEN_CHANCE:
        return _at_the_corner(spot, side, occluder, gap)
    middle_d, edge_d = _place(side, width, at_kerb)
    d = side.sign * middle_d
    # A metre along the line of a bend is shorter inside of it and longer outside. A straight body
    # reaches out into a bend whose inner side it stands on.
    curvature = spot.road.curve.curvature_at(s - length / 2)
    bulge = max(curvature * side.sign, 0.0) * (length / 2) ** 2 / 2
    middle = s - (gap + length / 2) / (1 - curvature * d)
    begins = middle - length / 2
    if at_kerb and edge_d - bulge < side.lane_edge_m:
        return None
    if spot.beside and at_kerb and begins < spot.beside.kerb_m + CORNER_M:
        return None
    if spot.beside and not at_kerb and begins < _plot_from(spot, side, width):
        return None
    x, y, heading = spot.road.curve.to_world(np.array([middle, d, 0.0])).tolist()
    return Hiding(occluder, (x, y, heading), s, edge_d)


def _at_the_corner(spot: Spot, side: Side, occluder: str, gap: float) -> Hiding:
    """Along the main road, where the plot at the corner begins, with its end at the side street."""
    length, width, _ = CATALOGUE[occluder].size
    begins = _plot_from(spot, side, length)
    place = np.array([begins + width / 2, side.sign * (side.boundary_m + length / 2), np.pi / 2])
    x, y, heading = spot.road.curve.to_world(place).tolist()
    return Hiding(occluder, (x, y, heading), begins + width + gap, side.boundary_m)


def _plot_from(spot: Spot, side: Side, depth: float) -> float:
    """Where along a side street the plot beside it begins, over a `depth` from its pavement on:
    behind the pavement of the main road, from which the side street may lead off askew.
    """
    assert spot.beside is not None
    edges = np.array([side.boundary_m, side.boundary_m + depth])
    road = np.column_stack([np.zeros(2), side.sign * edges, np.zeros(2)])
    off = spot.beside.sign * spot.road.curve.to_world(road)[:, 1]
    steep = abs(float(np.sin(spot.road.curve.start[2])))
    return float((spot.beside.boundary_m - off.min()) / steep)


def _place(side: Side, width: float, at_kerb: bool) -> tuple[float, float]:
    """How far from the reference line the middle of an occluder is, and its edge to the road."""
    if not at_kerb:
        return side.boundary_m + width / 2, side.boundary_m
    # What is wider than the parking lane stands to the kerb.
    middle = min(abs(side.parking_d), side.kerb_m - width / 2)
    return middle, middle - width / 2
