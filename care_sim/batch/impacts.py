"""Which bodies the egos of many worlds touch."""

from collections.abc import Iterator

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.batch.state import BatchState
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.world.approach import Impact
from care_sim.world.bodies import BodyKind
from care_sim.world.body_tables import bodies_near
from care_sim.world.clearance_judge import CONTACT_REACH_M, ClearanceJudge
from care_sim.world.world import WORLD_STEP_S, World


class Impacts:
    """The egos' contacts in `worlds` worlds. The exact distance is PyBullet's, and it is asked
    about few bodies: those that are near.
    """

    def __init__(self, worlds: int, judge: ClearanceJudge):
        self._judge = judge
        self._egos: list[BodyKind | None] = [None] * worlds
        self._kinds: list[dict[int, BodyKind]] = [{} for _ in range(worlds)]

    def begin(self, world: int, built: World) -> None:
        """Take in the bodies of a world."""
        self._egos[world] = built.ego_kind
        self._kinds[world] = {actor.body: actor.kind for actor in built.actors}

    def now(self, state: BatchState, looked: Mask) -> Iterator[tuple[int, Impact]]:
        """The worlds among those `looked` at (W,) whose ego touches a body, and the impact."""
        bodies, egos = state.bodies, state.egos
        counts, near = _near(looked, bodies.counts, bodies.boxes, egos.bodies, CONTACT_REACH_M)
        for world in np.flatnonzero(counts).tolist():
            for body in near[world, : counts[world]].tolist():
                if self._touches(state, world, body):
                    # The velocity is that of `World.velocities_of`.
                    boxes, before = bodies.boxes[world], bodies.before[world]
                    velocity = (boxes[body, :2] - before[body, :2]) / WORLD_STEP_S
                    kind, ego = self._kinds[world][body].name, int(egos.bodies[world])
                    speed_mps = float(egos.speeds[world])
                    yield world, Impact.on(body, kind, boxes, ego, speed_mps, velocity)
                    break

    def _touches(self, state: BatchState, world: int, body: int) -> bool:
        ego = self._egos[world]
        assert ego is not None
        poses = state.bodies.poses[world, [int(state.egos.bodies[world]), body]]
        return self._judge.touch((ego, self._kinds[world][body]), poses)


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
