"""Distances from the ego to the first-sighting actor, hull to hull, in one or many worlds, and the
ego's contacts.

PyBullet's exact distance costs more than the rest of the scoring. So moments are stored with a
lower bound, and PyBullet computes only the moments that matter.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.world.approach import Impact
from care_sim.world.bodies import BodyKind
from care_sim.world.body_tables import bodies_near
from care_sim.world.bullet import NO_BODY
from care_sim.world.contact import (
    CONTACT_REACH_M,
    PADDING_M,
    ClearanceJudge,
    StandIns,
    borrow_judge,
    boxes_of,
    least_gap,
    nearest_parts,
)


class Clearances:
    """At every world step of an episode, up to `steps`, in each of `worlds` worlds."""

    def __init__(self, worlds: int, steps: int):
        self._kinds: list[tuple[BodyKind, BodyKind] | None] = [None] * worlds
        # The stand-ins of both bodies, and the judge that made them.
        self._pairs: list[tuple[ClearanceJudge, StandIns] | None] = [None] * worlds
        # Their parts as boxes (W, n, 6), as in `StandIn`, and how many each has.
        self._boxes = [np.zeros((worlds, 1, 6)) for _ in range(2)]
        self._counts = np.zeros((worlds, 2), np.int64)
        # By world and step (from 1): the poses of both, and a lower bound of their distance.
        self._poses = np.zeros((worlds, steps + 1, 2, 7))
        self._bounds = np.full((worlds, steps + 1), np.inf)

    def begin(self, world: int, kinds: tuple[BodyKind, BodyKind] | None) -> None:
        """Begin an episode with the kinds of the ego and of the first-sighting actor, None without
        one.
        """
        self._kinds[world] = kinds
        self._pairs[world] = None
        self._bounds[world] = np.inf
        for side, kind in enumerate(kinds or ()):
            boxes = boxes_of(kind)
            self._boxes[side] = filled(self._boxes[side], world, boxes)
            self._counts[world, side] = len(boxes)

    def __getstate__(self) -> dict[str, object]:
        return vars(self) | {"_pairs": [None] * len(self._pairs)}

    def note(
        self,
        live: Mask,
        steps: Integers,
        boxes: Floats,
        poses: Floats,
        whose: tuple[Integers, Integers],
        nearest_m: Floats,
    ) -> None:
        """Store the places of bodies, `boxes` and `poses` (W, B, 7), at the `steps` (W,) of the
        `live` worlds. `whose` (W,) are the ids of the egos and of the actors, NO_BODY without one.
        Lowers `nearest_m` (W,), from centre to centre, to its current value.
        """
        tables = self._poses, self._bounds, nearest_m
        _note(live, steps, boxes, poses, *whose, *tables)

    def least_since(self, steps: Integers, count: int, live: Mask, exact_below: float) -> Floats:
        """Return (W,) the least clearance of the last `count` of all `steps` (W,) so far, metres. A
        value above `exact_below` may be a lower bound that is also above it.
        """
        recent = steps[:, None] - np.arange(count)
        least: Floats = self._bounds[np.arange(len(steps))[:, None], recent].min(axis=1)
        asked = live & (least <= exact_below) & (least < np.inf)
        if asked.any():
            judge, first, (own, other) = borrow_judge(), steps - count + 1, self._boxes
            tables = _nearest(asked, first, count, self._poses, own, other, self._counts)
            gaps, pairs = (table.tolist() for table in tables)
            for world in np.flatnonzero(asked).tolist():
                bodies, poses = self._stand_ins(judge, world), self._poses[world, first[world] :]
                least[world] = judge.least(bodies, poses, gaps[world], pairs[world])
        return least

    def least(self, world: int, begin: int, end: int) -> float:
        """Return the least clearance of a world from its step `begin` to the one before `end`."""
        noted = begin + np.flatnonzero(self._bounds[world, begin:end] < np.inf)
        if not len(noted):
            return math.inf
        judge = borrow_judge()
        return judge.clearance(self._stand_ins(judge, world), self._poses[world, noted])

    def _stand_ins(self, judge: ClearanceJudge, world: int) -> StandIns:
        kinds, pair = self._kinds[world], self._pairs[world]
        if pair is None or pair[0] is not judge:
            assert kinds is not None
            pair = self._pairs[world] = judge, judge.stand_ins(*kinds)
        return pair[1]


@compiled()
def _nearest(
    asked: Mask,
    first: Integers,
    count: int,
    poses: Floats,
    own: Floats,
    other: Floats,
    parts: Integers,
) -> tuple[Floats, Integers]:
    """Return `nearest_parts` (W, P) of the worlds `asked` (W,) at `count` steps from their `first`
    (W,) on, and inf beyond. Both bodies have so many `parts` (W, 2) in `own` and `other`.
    """
    most = count * (parts[:, 0] * parts[:, 1]).max()
    gaps = np.full((len(asked), most), np.inf)
    pairs = np.zeros((len(asked), most), np.int64)
    for w in range(len(asked)):
        if asked[w]:
            boxes, others = own[w, : parts[w, 0]], other[w, : parts[w, 1]]
            found = nearest_parts(boxes, others, poses[w, first[w] : first[w] + count])
            gaps[w, : len(found[0])], pairs[w, : len(found[1])] = found
    return gaps, pairs


@compiled(brief=True)
def _note(
    live: Mask,
    steps: Integers,
    boxes: Floats,
    now: Floats,
    egos: Integers,
    targets: Integers,
    poses: Floats,
    bounds: Floats,
    nearest_m: Floats,
) -> None:
    """See `Clearances.note`."""
    for world in range(len(live)):
        if not live[world] or targets[world] == NO_BODY:
            continue
        ego, target, step = egos[world], targets[world], steps[world]
        box, other = boxes[world, ego], boxes[world, target]
        away = np.hypot(other[0] - box[0], other[1] - box[1])
        nearest_m[world] = min(nearest_m[world], away)
        bounds[world, step] = least_gap(box, other) - PADDING_M
        poses[world, step, 0] = now[world, ego]
        poses[world, step, 1] = now[world, target]


class Impacts:
    """The egos' contacts in `worlds` worlds, whose steps last `step_s` seconds. PyBullet computes
    exact distances, for near bodies only.
    """

    def __init__(self, worlds: int, step_s: float):
        self._step_s = step_s
        self._kinds: list[Mapping[int, BodyKind]] = [{}] * worlds

    def begin(self, world: int, kinds: Mapping[int, BodyKind]) -> None:
        """Begin an episode of a world with the kinds of its bodies by id, the ego's included."""
        self._kinds[world] = kinds

    def now(
        self,
        looked: Mask,
        counts: Integers,
        boxes: Floats,
        before: Floats,
        poses: Floats,
        egos: Integers,
        speeds: Floats,
    ) -> Iterator[tuple[int, Impact]]:
        """Return the `looked` at (W,) worlds whose ego touches a body, with the impact. Each world
        has `counts` (W,) bodies at `boxes` and `poses` (W, B, 7), which were at `before` a step
        ago. The `egos` (W,) drive at `speeds` (W,).
        """
        found, near = _near(looked, counts, boxes, egos, CONTACT_REACH_M)
        for world in np.flatnonzero(found).tolist():
            ego, kinds = int(egos[world]), self._kinds[world]
            for body in near[world, : found[world]].tolist():
                kind = kinds[body]
                if borrow_judge().touch((kinds[ego], kind), poses[world, [ego, body]]):
                    moved = boxes[world, body, :2] - before[world, body, :2]
                    own = boxes[world], ego, float(speeds[world])
                    yield world, Impact.on(body, kind.name, *own, moved / self._step_s)
                    break


@compiled(brief=True)
def _near(
    looked: Mask, counts: Integers, boxes: Floats, egos: Integers, within: float
) -> tuple[Integers, Integers]:
    """Return the number of bodies that may be `within` metres of the ego in each world (W,), and
    their ids (W, B).
    """
    found = np.zeros(len(looked), np.int64)
    near = np.empty((len(looked), boxes.shape[1]), np.int64)
    for world in range(len(looked)):
        if looked[world]:
            bodies = bodies_near(boxes[world, : counts[world]], egos[world], within)
            found[world] = len(bodies)
            near[world, : len(bodies)] = bodies
    return found, near
