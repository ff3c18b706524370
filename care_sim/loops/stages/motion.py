"""Worlds move on: what `World.step` does, with no Python per world in the common case.

In a common world ego and drivers keep their lanes, and the other bodies stand or move by the clock
alone. Any other world moves by its own Python.
"""

from collections.abc import Callable, Sequence
from typing import TypeGuard

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.core.types import Ego
from care_sim.loops.episode import most_keyframes
from care_sim.loops.stages.state import Passages, State, load_bodies
from care_sim.world.bullet import NO_BODY
from care_sim.world.clearances import Clearances, Impacts
from care_sim.world.lane_columns import SPEED, LaneColumns
from care_sim.world.motions import LaneChange, Walk
from care_sim.world.route import RouteCar
from care_sim.world.traffic import LaneKeeper, RoadVehicle
from care_sim.world.world import (
    WORLD_STEP_S,
    Actor,
    Reflection,
    World,
    has_arrived,
    source_of,
    whole_steps,
)

_MAY_BE_REPLACED = ("step", "is_over")
"""Methods of a world that the loop calls; a class with its own moves by its own Python."""
_BY_TIME_ALONE = (Walk, LaneChange)
"""Frozen: where they are depends on nothing but the time."""
_REFLECTED = np.array([1.0, -1.0, -1.0])
"""Turns poses into those on the other side of the x axis."""


def steps_of(duration_s: float, keyframe_s: float) -> int:
    """World steps of an episode of `duration_s` seconds, which ends with a whole keyframe."""
    return most_keyframes(duration_s, keyframe_s) * whole_steps(keyframe_s)


class Motion:
    """The motion of `worlds` worlds, whose episodes last `steps` world steps at most. The
    arrays that `advance` returns are reused at the next call.
    """

    def __init__(self, worlds: int, steps: int):
        self._clearances = Clearances(worlds, steps)
        self._impacts = Impacts(worlds, WORLD_STEP_S)
        # The world steps that each has done, and their times, counted and rounded as its own.
        self._steps = np.zeros(worlds, np.int64)
        self._times = np.array([round(n * WORLD_STEP_S, 9) for n in range(steps + 1)])
        self._lanes = LaneColumns(worlds)
        # The body of each vehicle in the lanes, and of what goes by time alone, with its ways.
        self._drivers = np.zeros((worlds, 2), np.int64)
        self._timed_counts = np.zeros(worlds, np.int64)
        self._timed = np.zeros((worlds, 1), np.int64)
        self._ways = np.zeros((worlds, 1, steps + 1, 5))
        self._by_itself: dict[int, World] = {}
        self._built: dict[int, World] = {}
        self._current = np.zeros(worlds, np.int64)
        metres = np.zeros(worlds), np.zeros(worlds)
        self._passages = Passages(*metres, np.zeros(worlds, np.bool_), np.zeros(worlds), {})
        self._goes_along = np.ones(worlds, np.bool_)

    def begin(self, world: int, built: World) -> None:
        """Move a fresh world from now on. Its tables lie in the state by the first `advance`. A
        world that does not move by its own Python is brought up to date by `current` alone.
        Raises InvalidInput for a class with an `advance` of its own.
        """
        if type(built).advance is not World.advance:
            raise InvalidInput(
                f"{built.scene}: environments move a world by `step` and never call the `advance` "
                f"of {type(built).__name__}; replace `step`"
            )
        self._steps[world] = self._current[world] = 0
        self._built[world] = built
        target = built.first_sighting
        pair = None if target is None else (built.ego_kind, target.kind)
        self._clearances.begin(world, pair)
        self._impacts.begin(world, built.kinds)
        self._by_itself.pop(world, None)
        self._goes_along[world] = True
        drivers = [actor for actor in built.actors if _is_vehicle(_source(actor))]
        others = [actor for actor in built.actors if not _is_vehicle(_source(actor))]
        keepers = self._keepers(built, drivers)
        timed = [actor for actor in others if not isinstance(actor.moved_by, tuple)]
        by_time = all(type(_timetable(actor)) in _BY_TIME_ALONE for actor in timed)
        if keepers is None or not by_time:
            self._by_itself[world] = built
            self._goes_along[world] = False
            return
        built.hand_over()
        self._lanes.begin(world, keepers)
        bodies = np.array([built.ego_body, *(actor.body for actor in drivers)])
        self._drivers = filled(self._drivers, world, bodies)
        self._timed_counts[world] = len(timed)
        if timed:
            self._timed = filled(self._timed, world, np.array([actor.body for actor in timed]))
            self._ways = filled(self._ways, world, self._tabulated(timed))

    def advance(
        self,
        state: State,
        accelerations: Floats,
        duration_s: float,
        exact_below_m: float = np.inf,
        after_step: Callable[[int], None] = lambda _steps: None,
    ) -> Passages:
        """Move the worlds that are live by `duration_s` seconds, a whole number of world steps. The
        egos hold `accelerations` (W,), m/s^2, meanwhile.

        A clearance of `exact_below_m` or more may be a bound that is as large, and no greater than
        the clearance; `settle` returns the least of an episode then. `after_step` is
        called with the number of steps after each but the last. Raises InvalidInput past the end of
        an episode.
        """
        # Compiled code does not check the bounds of tables that have a row per step.
        count = whole_steps(duration_s)
        if (self._steps[state.live] + count >= len(self._times)).any():
            raise InvalidInput(
                f"the episode lasts {self._times[-1]:g} s: begin another one, or a longer one"
            )
        passages = self._passages
        passages.nearest_m.fill(np.inf)
        passages.hit.fill(False)
        passages.impacts.clear()
        egos = state.egos
        targeted = state.live & (egos.targets != NO_BODY)
        for step in range(1, count + 1):
            self._step(state, accelerations)
            counts, boxes, before, poses = state.bodies
            whose = egos.bodies, egos.targets
            self._clearances.note(state.live, self._steps, boxes, poses, whose, passages.nearest_m)
            looked = state.live & ~passages.hit
            for world, impact in self._impacts.now(
                looked, counts, boxes, before, poses, egos.bodies, egos.speeds
            ):
                passages.hit[world] = True
                passages.impact_speed_mps[world] = impact.speed_mps
                passages.impacts[world] = impact
            if step < count:
                after_step(step)
        passages.clearance_m[:] = self._clearances.least_since(
            self._steps, count, targeted, exact_below_m
        )
        return passages

    def settle(self, world: int, since_s: float = 0.0) -> float:
        """The least clearance of a world's episode, metres, from the time `since_s` on; inf without
        a first-sighting actor.
        """
        begin = round(since_s / WORLD_STEP_S) + 1
        return self._clearances.least(world, begin, int(self._steps[world]) + 1)

    def current(self, state: State, world: int) -> World:
        """A world as it is now."""
        built, step = self._built[world], int(self._steps[world])
        if world not in self._by_itself and self._current[world] != step:
            self._current[world] = step
            bodies, egos = state.bodies, state.egos
            count = bodies.counts[world]
            ego = Ego(
                float(egos.speeds[world]),
                float(egos.yaw_rates[world]),
                float(egos.accelerations[world]),
            )
            drivers = self._drivers[world, : self._lanes.counts[world]].tolist()
            lanes = dict(zip(drivers, self._lanes.rows[world, :, : SPEED + 1], strict=False))
            boxes = bodies.boxes[world, :count], bodies.before[world, :count]
            built.put(step, *boxes, ego, lanes)
        return built

    def are_over(self, live: Mask) -> Mask:
        """(W,) in which of the worlds that are `live` nothing can happen any more."""
        over = np.zeros(len(live), np.bool_)
        for world, built in self._by_itself.items():
            over[world] = live[world] and built.is_over()
        return over

    def _keepers(self, built: World, drivers: Sequence[Actor]) -> list[LaneKeeper] | None:
        """Return the lane keepers of ego and drivers, None if they may leave their lanes."""
        kind = type(built)
        if any(getattr(kind, name) is not getattr(World, name) for name in _MAY_BE_REPLACED):
            return None
        ends = built.ended is not has_arrived or built.goal_m < np.inf
        if built.scripted or ends or built.speed_plan or isinstance(built.ego, RouteCar):
            return None
        vehicles = [built.ego, *filter(_is_vehicle, map(_source, drivers))]
        return built.traffic.lane_keepers(vehicles, float(self._times[-1]))

    def _tabulated(self, actors: Sequence[Actor]) -> Floats:
        """(n, steps + 1, 5) x, y, heading, and sine and cosine of half of it, of actors at every
        world step.
        """
        ways = np.empty((len(actors), len(self._times), 5))
        for way, actor in zip(ways, actors, strict=True):
            timetable = _timetable(actor)
            assert isinstance(timetable, _BY_TIME_ALONE)
            way[:, :3] = timetable.poses(self._times)
            if isinstance(actor.moved_by, Reflection):
                way[:, :3] *= _REFLECTED
            half = way[:, 2] / 2
            way[:, 3], way[:, 4] = np.sin(half), np.cos(half)
        return ways

    def _step(self, state: State, accelerations: Floats) -> None:
        """Move all by a world step."""
        together = state.live & self._goes_along
        bodies, egos = state.bodies, state.egos
        _go_on(state.live, self._steps, self._times, state.times, *bodies[:3])
        if together.any():
            speeds = self._lanes.rows[:, 0, SPEED].copy()
            self._lanes.step(together, accelerations, WORLD_STEP_S)
            lanes = self._lanes.counts, self._lanes.rows, self._drivers, speeds
            timed = self._timed_counts, self._timed, self._ways
            moved = bodies.boxes, bodies.poses, *egos[:3]
            _follow(together, self._steps, *lanes, *timed, *moved)
        for world, built in self._by_itself.items():
            if state.live[world]:
                built.step(float(accelerations[world]))
                _copy(built, world, state)


def _source(actor: Actor) -> object:
    return source_of(actor.moved_by)


def _is_vehicle(source: object) -> TypeGuard[RoadVehicle]:
    return isinstance(source, RoadVehicle)


def _timetable(actor: Actor) -> object:
    """Return the timetable of an actor that moves by the clock alone, else None."""
    return getattr(_source(actor), "__self__", None)


def _copy(built: World, world: int, state: State) -> None:
    """Write where all is in a world that moved by itself into the state. Raises InvalidInput where
    its first-sighting actor is another one than at the start.
    """
    target = built.first_sighting
    if (NO_BODY if target is None else target.body) != state.egos.targets[world]:
        raise InvalidInput(
            f"{built.scene}: first_sighting changed by {built.time:g} s; it must be set when the "
            "world is built"
        )
    poses = built.bullet.primitives.poses
    count = len(poses)
    # An event may have added bodies.
    if count != state.bodies.counts[world]:
        load_bodies(state, world, built)
    state.bodies.boxes[world, :count] = built.boxes_of(slice(None))
    state.bodies.poses[world, :count] = poses
    motion = built.ego_motion
    state.egos.speeds[world] = motion.speed
    state.egos.yaw_rates[world] = motion.yaw_rate
    state.egos.accelerations[world] = motion.acceleration


@compiled(brief=True)
def _go_on(
    live: Mask,
    steps: Integers,
    times: Floats,
    now: Floats,
    counts: Integers,
    boxes: Floats,
    before: Floats,
) -> None:
    """Advance the clocks of the worlds that are `live` by a world step: their `steps` (W,) done,
    and their times `now` (W,), from the `times` of all steps. Copies `boxes` to `before`.
    """
    for world in range(len(live)):
        if live[world]:
            steps[world] += 1
            now[world] = times[steps[world]]
            for body in range(counts[world]):
                for k in range(boxes.shape[2]):
                    before[world, body, k] = boxes[world, body, k]


@compiled(brief=True)
def _follow(
    together: Mask,
    steps: Integers,
    lane_counts: Integers,
    rows: Floats,
    drivers: Integers,
    before: Floats,
    timed_counts: Integers,
    timed: Integers,
    ways: Floats,
    boxes: Floats,
    poses: Floats,
    speeds: Floats,
    yaw_rates: Floats,
    accelerations: Floats,
) -> None:
    """Put the bodies of the worlds that move `together` where they are after their `steps`.

    The vehicles in the lanes have `rows` as in `LaneColumns`, the ego first, and are the bodies
    `drivers` (W, V); the egos' speeds (W,) were those `before` the world step. The bodies `timed`
    (W, P) move by the clock alone; their `ways` (W, P, steps + 1, 5) are x, y, heading, and sine
    and cosine of half of it.
    """
    for world in range(len(together)):
        if not together[world]:
            continue
        # A vehicle that keeps a lane along x changes nothing but x.
        for n in range(lane_counts[world]):
            body, x = drivers[world, n], rows[world, n, 0]
            boxes[world, body, 0] = x
            poses[world, body, 0] = x
        for n in range(timed_counts[world]):
            row = ways[world, n, steps[world]]
            box, pose = boxes[world, timed[world, n]], poses[world, timed[world, n]]
            box[0], box[1], box[6] = row[0], row[1], row[2]
            pose[0], pose[1], pose[5], pose[6] = row[0], row[1], row[3], row[4]
        speeds[world] = rows[world, 0, SPEED]
        yaw_rates[world] = 0.0
        accelerations[world] = (speeds[world] - before[world]) / WORLD_STEP_S
