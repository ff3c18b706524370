"""Clutter beside a street: small objects, walking groups, and bicycles in racks. Clutter is drawn
last and fills remaining room.

Bodies that perception does not report are `Street.clutter`. Groups and parked bicycles are reported
like other bodies. Clutter never blocks anybody's way: kerbs and verges are ground, and people walk
on them.
"""

from collections.abc import Callable, Iterator

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose
from care_sim.streets import clutter_bodies as bodies
from care_sim.streets.draft import Draft
from care_sim.streets.furniture import Span
from care_sim.streets.layouts import EVEN_CHANCE, Range, Road, Side, draw
from care_sim.streets.people import (
    PAVEMENT_MARGIN_M,
    PERSON_BERTH_M,
    TRIES,
    WALKING_MPS,
    Walked,
)
from care_sim.world.bodies import BodyKind

Placed = tuple[BodyKind, Pose]
"""An unreported body and its pose: x, y, heading."""

PIECE_M = 4.0
"""Length of a piece of pavement and verge: in the tightest bend it is 7 cm off the line."""
LOWERED_CHANCE = 0.15
"""Chance of a lowered piece of kerb (choice): a drive every 27 m."""
UNEVEN_M = -0.01, 0.0, 0.01
"""Spread between neighbouring pieces (choice)."""
CLEARANCE_M = 0.05
"""Gap between the kerb and the parking lane's edge, so that pieces in a bend stay off it."""
TREES_APART_M: Range = (8.0, 16.0)
"""Street trees of small to middling crowns are planted 8 to 15 m apart (GALK)."""
TREE_OFF_KERB_M = 0.6
LAMPS_APART_M: Range = (25.0, 40.0)
"""Lamp posts of 4 to 8 m in residential streets (choice, after usual layouts of EN 13201)."""
OFF_KERB_M: Range = (0.3, 0.6)
"""Posts and signs stand half a metre off the carriageway (RASt 06)."""

BUSHES_PER_100M: Range = (5.0, 40.0)
"""In front gardens (choice)."""
BESIDE_WALL_M = 0.45
THINGS_PER_100M: dict[Callable[[np.random.Generator], BodyKind], float] = {
    bodies.bin_: 2.0,
    bodies.cabinet: 1.0,
    bodies.bench: 0.5,
    bodies.board: 0.7,
    bodies.column: 0.2,
    bodies.bush: 2.0,
}
"""Along the walls, mean numbers (choice: nobody counted)."""
SIGNS_PER_100M = 3.0
BOLLARDS_PER_100M = 1.0
"""Rows of them (choice)."""
BOLLARDS_APART_M = 1.5
RELIEF_APART_M: Range = (0.5, 4.0)
"""Windows, doors and bays of a front (choice)."""

GROUPS_PER_100M = 1.0
"""Groups per 100 m of pavement. Including single walkers, seven in ten visible people belong to
one, at medium density (Moussaid et al. 2010, PLoS ONE 5: up to 70%).
"""
GROUP_SIZES = {2: 0.71, 3: 0.21, 4: 0.06, 5: 0.02}
"""James 1953, American Sociological Review 18: freely forming groups of pedestrians."""
ABREAST_M: Range = (0.6, 0.85)
"""Distance of two people who walk together (Moussaid et al. 2010: 0.78 m on average)."""
STANDING_SHARE = 0.4
"""Share of standing groups: of people in nuScenes 28% stand or sit, and those who talk or wait are
groups (choice).
"""
RACKS_PER_100M = 0.6
"""Racks of 2 to 6 bicycles: about two bicycles on 100 m (choice)."""
RACK_APART_M: Range = (0.6, 0.9)
"""FGSV, Hinweise zum Fahrradparken: 0.8 m between bicycles of one height, less in old racks."""


def place_clutter(draft: Draft, roads: list[tuple[Road, Span]]) -> tuple[Placed, ...]:
    """Draw the clutter of roads over their spans (metres along each). Adds groups and parked
    bicycles to the draft, and returns the rest.
    """
    placed: list[Placed] = []
    for road, span in roads:
        for side in road.sides:
            beside = _Beside(draft, road, side, span)
            # Ground first: it takes no room. Then kinds with the fewest possible places first.
            placed += beside.ground()
            placed += beside.row(bodies.lamp, LAMPS_APART_M, OFF_KERB_M)
            if draft.rng.random() < EVEN_CHANCE:
                apart = (TREE_OFF_KERB_M, TREE_OFF_KERB_M)
                placed += beside.row(bodies.tree, TREES_APART_M, apart)
            beside.racks()
            placed += beside.signs()
            placed += beside.along_wall()
            placed += beside.front()
            if side.garden_m:
                placed += beside.garden()
            beside.groups()
    return tuple(placed)


class _Beside:
    """One side of a road over a span, on which clutter is put."""

    def __init__(self, draft: Draft, road: Road, side: Side, span: Span):
        self._draft, self._road, self._side, self._span = draft, road, side, span
        self._rng = draft.rng
        self._kerb_m = round(draw(self._rng, bodies.KERB_M), 2)

    def ground(self) -> Iterator[Placed]:
        """Pavement with its kerb, and the ground of front gardens, piece by piece."""
        side, rng = self._side, self._rng
        wide = side.pavement_m - CLEARANCE_M
        rise = draw(rng, bodies.VERGE_RISE_M)
        for s in np.arange(self._span[0], self._span[1], PIECE_M).tolist():
            height = bodies.LOWERED_M if rng.random() < LOWERED_CHANCE else self._kerb_m
            height += float(rng.choice(UNEVEN_M))
            yield from self._ground(
                bodies.slab(PIECE_M, wide, height), s, side.boundary_m - wide / 2
            )
            if side.garden_m:
                piece = bodies.verge(
                    PIECE_M, side.garden_m, self._kerb_m, rise + float(rng.choice(UNEVEN_M))
                )
                yield from self._ground(piece, s, side.front_m - side.garden_m / 2)

    def _ground(self, kind: BodyKind, s: float, away: float) -> Iterator[Placed]:
        """Return a piece of ground, unless the place must stay free: a side street, its corners."""
        pose = self._pose(s + PIECE_M / 2, away, 0.0)
        if self._draft.is_ground(pose, kind.size[:2]):
            yield kind, _triple(pose)

    def row(
        self, make: Callable[[np.random.Generator], BodyKind], apart: Range, off_kerb: Range
    ) -> Iterator[Placed]:
        """A row along the kerb."""
        s = self._span[0] + draw(self._rng, apart)
        while s < self._span[1]:
            yield from self._put(self._one(make), s, self._side.kerb_m + draw(self._rng, off_kerb))
            s += draw(self._rng, apart)

    def signs(self) -> Iterator[Placed]:
        """Signs, and rows of bollards, along the kerb."""
        rng, kerb = self._rng, self._side.kerb_m
        for s in self._places(SIGNS_PER_100M):
            yield from self._put(self._one(bodies.sign), s, kerb + draw(rng, OFF_KERB_M))
        for s in self._places(BOLLARDS_PER_100M):
            kind, away = self._one(bodies.bollard), kerb + draw(rng, OFF_KERB_M)
            for number in range(int(rng.integers(2, 8))):
                yield from self._put(kind, s + number * BOLLARDS_APART_M, away)

    def along_wall(self) -> Iterator[Placed]:
        """Bins, boards, benches and the like at the pavement's far edge."""
        for make, many in THINGS_PER_100M.items():
            for s in self._places(many):
                away = self._side.boundary_m - BESIDE_WALL_M
                yield from self._put(self._one(make), s, away, draw(self._rng, (-0.2, 0.2)))

    def front(self) -> Iterator[Placed]:
        """Yield parts that jut out of the house fronts."""
        s = self._span[0]
        while s < self._span[1]:
            kind = self._one(bodies.relief)
            # Half of the part is in the wall, so it needs room only on the pavement.
            pose = self._pose(s, self._side.front_m, 0.0)
            if not self._draft.is_way(pose, kind.size[:2]):
                yield kind, _triple(pose)
            s += kind.size[0] + draw(self._rng, RELIEF_APART_M)

    def garden(self) -> Iterator[Placed]:
        """Bushes, now and then a tree."""
        side, rng = self._side, self._rng
        for s in self._places(draw(rng, BUSHES_PER_100M)):
            kind = self._one(bodies.tree) if rng.random() < 0.1 else self._one(bodies.bush)
            away = draw(rng, (side.boundary_m + 0.5, side.front_m))
            yield from self._put(kind, s, away, draw(rng, (-np.pi, np.pi)))

    def racks(self) -> None:
        """Bicycles side by side, across the pavement at its far edge or at the kerb."""
        rng, side = self._rng, self._side
        for s in self._places(RACKS_PER_100M):
            at_kerb = rng.random() < EVEN_CHANCE
            away = side.kerb_m + 1.0 if at_kerb else side.boundary_m - 1.0
            apart = draw(rng, RACK_APART_M)
            for number in range(int(rng.integers(2, 7))):
                heading = np.pi / 2 * float(rng.choice((-1, 1))) + draw(rng, (-0.15, 0.15))
                pose = self._pose(s + number * apart, away, heading)
                self._draft.stand("parked bicycle", pose)

    def groups(self) -> None:
        """People who walk or stand together."""
        rng = self._rng
        for _ in self._places(GROUPS_PER_100M):
            size = int(rng.choice([*GROUP_SIZES], p=[*GROUP_SIZES.values()]))
            meet = self._stand_together if rng.random() < STANDING_SHARE else self._walk_together
            any(meet(size) for _ in range(TRIES))

    def _stand_together(self, size: int) -> bool:
        rng = self._rng
        s, away = float(rng.uniform(*self._span)), self._pavement()
        radius = draw(rng, ABREAST_M) / (2 * np.sin(np.pi / max(size, 2)))
        turns = 2 * np.pi * np.arange(size) / size + draw(rng, (-np.pi, np.pi))
        found = False
        for turn in turns.tolist():
            # They face the middle of their circle.
            pose = self._pose(s + radius * np.cos(turn), away + radius * np.sin(turn), turn + np.pi)
            found |= self._draft.stand("pedestrian", pose)
        return found

    def _walk_together(self, size: int) -> bool:
        """Two abreast, the others behind them."""
        rng, times = self._rng, self._draft.times
        speed = WALKING_MPS * draw(rng, (0.75, 1.0))
        s, away, along = (
            float(rng.uniform(*self._span)),
            self._pavement(),
            float(rng.choice((-1, 1))),
        )
        reach = along * 2 * WALKING_MPS * float(times[-1])
        starts = -float(rng.uniform(0.5, 1.5)) * float(times[-1])
        apart, found = draw(rng, ABREAST_M), False
        for number in range(size):
            own = self._side.sign * (away + (number % 2 - 0.5) * apart)
            first = s - reach / 2 - along * (number // 2) * 1.1 + draw(rng, (-0.2, 0.2))
            corners = ((first, own), (first + reach, own))
            way = Walked(self._road.curve, corners, speed, starts).poses(times)
            found |= self._draft.move("pedestrian", way, PERSON_BERTH_M)
        return found

    def _one(self, make: Callable[[np.random.Generator], BodyKind]) -> BodyKind:
        every = bodies.variants(make)
        return every[int(self._rng.integers(len(every)))]

    def _places(self, per_100m: float) -> Iterator[float]:
        """Draw places along the road, with this mean number per 100 m."""
        length = self._span[1] - self._span[0]
        yield from self._rng.uniform(
            *self._span, self._rng.poisson(per_100m * length / 100)
        ).tolist()

    def _pavement(self) -> float:
        side, keep = self._side, PAVEMENT_MARGIN_M
        return draw(self._rng, (side.kerb_m + keep, side.boundary_m - keep))

    def _pose(self, s: float, away: float, heading: float) -> Floats:
        """Return the pose (3,) of a body whose y axis points away from the road at heading 0."""
        sign = self._side.sign
        turn = heading if sign > 0 else heading + np.pi
        return self._road.curve.to_world(np.array([s, sign * away, turn]))

    def _put(self, kind: BodyKind, s: float, away: float, heading: float = 0.0) -> Iterator[Placed]:
        """Place a standing body, if there is room."""
        pose = self._pose(s, away, heading)
        if self._draft.occupy(pose, kind.size[:2]):
            yield kind, _triple(pose)


def _triple(pose: Floats) -> Pose:
    x, y, heading = pose.tolist()
    return x, y, heading
