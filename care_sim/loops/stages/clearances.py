"""From the ego to the first-sighting actor, hull to hull, in many worlds.

PyBullet's exact distance costs more than all else that is scored. So the moments are kept, with a
bound that is no greater, and it is asked about those alone that matter.

And which bodies the egos touch.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.loops.stages.state import State
from care_sim.world.approach import Impact
from care_sim.world.bodies import BodyKind
from care_sim.world.body_tables import bodies_near
from care_sim.world.bullet import NO_BODY
from care_sim.world.contact import (
    CONTACT_REACH_M,
    PADDING_M,
    ClearanceJudge,
    StandIns,
    judge_here,
    least_gap,
)
from care_sim.world.world import WORLD_STEP_S, World


class Clearances:
    """At every world step of an episode, up to `steps`, in each of `worlds` worlds."""

    def __init__(self, worlds: int, steps: int):
        self._kinds: list[tuple[BodyKind, BodyKind] | None] = [None] * worlds
        # What stands in for both, of the judge that made it.
        self._pairs: list[tuple[ClearanceJudge, StandIns] | None] = [None] * worlds
        # By world and step, of which the first is 1: the poses of the two, what they are apart at
        # least, and exactly where it is known, else NaN.
        self._poses = np.zeros((worlds, steps + 1, 2, 7))
        self._bounds = np.full((worlds, steps + 1), np.inf)
        self._known = np.full((worlds, steps + 1), np.nan)

    def begin(self, world: int, built: World) -> None:
        """Forget the episode that was, and take in the two bodies of a new one."""
        target = built.first_sighting
        self._kinds[world] = None if target is None else (built.ego_kind, target.kind)
        self._pairs[world] = None
        self._bounds[world] = np.inf
        self._known[world] = np.nan

    def __getstate__(self) -> dict[str, object]:
        return vars(self) | {"_pairs": [None] * len(self._pairs)}

    def note(self, state: State, steps: Integers, nearest_m: Floats) -> None:
        """Note where the bodies are at the `steps` (W,) to which the worlds have come. What is
        `nearest_m` (W,) from centre to centre falls to what it is now.
        """
        bodies, egos = state.bodies, state.egos
        tables = self._poses, self._bounds, nearest_m
        whose = egos.bodies, egos.targets
        _note(state.live, steps, bodies.boxes, bodies.poses, *whose, *tables)

    def least_since(self, steps: Integers, count: int, live: Mask, exact_below: float) -> Floats:
        """(W,) the least clearance of the last `count` of all `steps` (W,) so far, metres. What is
        above `exact_below` may be a bound that is above it, too, and no greater than the clearance.
        """
        recent = steps[:, None] - np.arange(count)
        bounds = self._bounds[np.arange(len(steps))[:, None], recent]
        least: Floats = bounds.min(axis=1)
        for world in np.flatnonzero(live & (least <= exact_below) & (least < np.inf)).tolist():
            order = np.argsort(bounds[world])
            moments = recent[world, order].tolist(), bounds[world, order].tolist()
            least[world] = self._least(world, *moments, exact_below)
        return least

    def least(self, world: int, begin: int, end: int) -> float:
        """The least clearance of a world from its step `begin` to the one before `end`."""
        bounds = self._bounds[world, begin:end]
        order = np.argsort(bounds)
        return self._least(world, (begin + order).tolist(), bounds[order].tolist(), math.inf)

    def _least(
        self, world: int, steps: Sequence[int], bounds: Sequence[float], exact_below: float
    ) -> float:
        """The least clearance at some `steps`, whose `bounds` ascend."""
        # First the moment at which they could be nearest. Whoever was farther apart than what is
        # found by then need not be asked about.
        least = math.inf
        for step, bound in zip(steps, bounds, strict=True):
            if bound > least or bound == math.inf:
                break
            if bound > exact_below:
                return min(least, bound)
            least = min(least, self._exact(world, step))
        return least

    def _exact(self, world: int, step: int) -> float:
        known = float(self._known[world, step])
        kinds, pair = self._kinds[world], self._pairs[world]
        if math.isnan(known) and kinds is not None:
            judge = judge_here()
            if pair is None or pair[0] is not judge:
                pair = self._pairs[world] = judge, judge.stand_ins(*kinds)
            known = judge.clearance(pair[1], self._poses[world, step])
            self._known[world, step] = known
        return known


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
    """The egos' contacts in `worlds` worlds. The exact distance is PyBullet's, and it is asked
    about few bodies: those that are near.
    """

    def __init__(self, worlds: int):
        self._built: list[World | None] = [None] * worlds

    def begin(self, world: int, built: World) -> None:
        """Take in the bodies of a world."""
        self._built[world] = built

    def now(self, state: State, looked: Mask) -> Iterator[tuple[int, Impact]]:
        """The worlds among those `looked` at (W,) whose ego touches a body, and the impact."""
        bodies, egos = state.bodies, state.egos
        counts, near = _near(looked, bodies.counts, bodies.boxes, egos.bodies, CONTACT_REACH_M)
        for world in np.flatnonzero(counts).tolist():
            built, ego = self._built[world], int(egos.bodies[world])
            assert built is not None
            for body in near[world, : counts[world]].tolist():
                kind = built.kind_of(body)
                if judge_here().touch((built.ego_kind, kind), bodies.poses[world, [ego, body]]):
                    # The velocity is that of `World.velocities_of`.
                    boxes, before = bodies.boxes[world], bodies.before[world]
                    velocity = (boxes[body, :2] - before[body, :2]) / WORLD_STEP_S
                    speed_mps = float(egos.speeds[world])
                    yield world, Impact.on(body, kind.name, boxes, ego, speed_mps, velocity)
                    break


@compiled(brief=True)
def _near(
    looked: Mask, counts: Integers, boxes: Floats, egos: Integers, within: float
) -> tuple[Integers, Integers]:
    """How many bodies may be `within` metres of the ego in each world (W,), and which (W, B)."""
    found = np.zeros(len(looked), np.int64)
    near = np.empty((len(looked), boxes.shape[1]), np.int64)
    for world in range(len(looked)):
        if looked[world]:
            bodies = bodies_near(boxes[world, : counts[world]], egos[world], within)
            found[world] = len(bodies)
            near[world, : len(bodies)] = bodies
    return found, near
