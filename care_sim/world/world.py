"""The world of one episode: bodies, their motions, and the truth that the scoring reads."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import ONE_WORLD, Floats, Integers
from care_sim.core.frames import Pose
from care_sim.core.types import CLASSES, Ego
from care_sim.world.approach import ClosestApproach
from care_sim.world.bodies import CATALOGUE, BodyKind
from care_sim.world.body_tables import Footprints
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.clearances import Clearances, Impacts
from care_sim.world.copying import check_copyable
from care_sim.world.motions import LinearMotion, Meeting, rates_between
from care_sim.world.route import Route, RouteCar, SpeedPlan
from care_sim.world.traffic import RoadVehicle, Traffic

WORLD_STEP_S = 0.05
"""Half a keyframe of the closed loop, in which nothing moves more than 0.5 m."""

Motion = Callable[[float], Pose]
"""The pose of a body at a time in seconds."""
Motions = Callable[[float], Floats]
"""The poses (n, 3) of bodies at a time in seconds."""


@dataclass(frozen=True)
class Actor:
    """A body with a pose at any time. `reported` is True if perception knows its class. `moved_by`
    gives its pose: one pose, a function of time, or a vehicle.
    """

    name: str
    kind: BodyKind
    body: int
    pose_at: Motion
    reported: bool
    moved_by: Pose | Motion | RoadVehicle

    @property
    def label(self) -> int | None:
        """Index into CLASSES, None when perception does not report it."""
        return CLASSES.index(self.kind.label) if self.reported and self.kind.label else None


@dataclass(frozen=True)
class Member:
    """The motion of one body of many: `poses_at` returns (n, 3) the poses of all at a time."""

    poses_at: Motions
    number: int

    def __call__(self, time: float) -> Pose:
        """The pose at `time`."""
        x, y, heading = self.poses_at(time)[self.number].tolist()
        return x, y, heading


@dataclass(frozen=True)
class Reflection:
    """The motion on the other side of the x axis of a function of time, or of a vehicle."""

    of: Motion | RoadVehicle

    def __call__(self, time: float) -> Pose:
        """The pose at `time`."""
        pose = self.of.pose if isinstance(self.of, RoadVehicle) else self.of(time)
        return reflect_pose(pose)


def reflect_pose(pose: Pose) -> Pose:
    """A pose reflected at the x axis."""
    x, y, heading = pose
    return x, -y, -heading


def source_of(moved_by: Pose | Motion | RoadVehicle) -> Pose | Motion | RoadVehicle:
    """Return the motion of an actor, on either side of the street."""
    return moved_by.of if isinstance(moved_by, Reflection) else moved_by


class World:
    """Bodies in PyBullet, moved by highway-env, walks and events. A scenario builds it.

    World frame: x along the road, y left, z up. The ego starts with its centre at the origin and
    drives along x. With a `route` it starts at the route's start and follows it.
    """

    scene: str
    """Name of the world in messages: the scenario that built it."""
    time: float
    """Seconds from the start."""
    actors: list[Actor]
    """All bodies but the ego, in the order in which they were added."""
    first_sighting: Actor | None
    """The first-sighting actor of the episode; its scenario sets it."""
    route: Route | None
    """The ego's route, as its navigation knows it; None is straight ahead."""
    speed_plan: SpeedPlan | None
    """Planned speed on the route; None keeps the initial speed. Its scenario sets it."""
    goal_m: float
    """Place of the goal on the ego's way; its scenario may set it."""
    ended: "Callable[[World], bool]"
    """Rule that ends the episode's event: the ego has arrived, unless its scenario sets another
    rule. It takes the world as its argument and does not hold it, like all functions that a world
    calls. A world that holds itself keeps its PyBullet client until garbage is collected.
    """
    has_oncoming: bool
    """True if oncoming actors may enter the ego's way, so that its brake must foresee them; its
    scenario sets it.
    """
    meetings: list[Meeting]
    """Planned meetings of the ego, in the order of the way."""
    drawn: Mapping[str, float | str]
    """Parameters of the scenario that the seed drew, by name; its scenario sets them. For scoring:
    they are truth.
    """

    def __init__(self, traffic: Traffic, ego_speed: float, route: Route | None = None):
        self.scene = "the world"
        self.bullet = BulletWorld()
        self.traffic = traffic
        self.route = route
        self.time = 0.0
        self.actors = []
        self.ego_kind = CATALOGUE["ego"]
        self.ego: RoadVehicle | RouteCar = (
            RouteCar(route, ego_speed)
            if route is not None
            else traffic.add_ego(0.0, ego_speed, self.ego_kind)
        )
        self._check_pose("the ego", self.ego.pose)
        self.ego_body = self.bullet.add(self.ego_kind, self.ego.pose, transparent=True)
        self._footprints = Footprints()
        self._footprints.add(self.ego_body, self.ego_kind.size, self.ego.pose)
        # Before the first step nothing has moved.
        self._before = self._footprints.boxes
        self.first_sighting = None
        self.speed_plan = None
        self.goal_m = np.inf
        self.ended = has_arrived
        self.has_oncoming = False
        self.meetings = []
        self.drawn = {}
        self._kinds = {self.ego_body: self.ego_kind}
        self._alone: list[Actor] = []
        # Bodies and numbers of the members of each group.
        self._groups: dict[Motions, list[tuple[int, int]]] = {}
        # All bodies that may move: the ego, those alone, and members of groups.
        self._moving = np.array([self.ego_body])
        self._numbers: list[Integers] = []
        self._events: list[tuple[float, Callable[[], None]]] = []
        self._every_step: list[Callable[[World], None]] = []
        self._ego_motion = Ego(ego_speed)
        self._steps = 0
        self._is_handed_over = False

    def add(
        self,
        name: str,
        kind: str | BodyKind,
        pose: Pose | Motion | RoadVehicle,
        *,
        reported: bool = True,
        backdrop: bool = False,
    ) -> Actor:
        """Add a body that stands at a pose, follows a function of time, or drives in the traffic.
        Its kind is a name of the catalogue, or any `BodyKind`. With `reported=False` perception
        never reports it. A `backdrop` stands behind everything that perception reports, so the
        camera need not render it. Raises InvalidInput for an unknown name, and for a pose that is
        not finite.
        """
        # Only movable bodies are asked for their pose at every step.
        pose_at = _motion(pose)
        place = pose_at(self.time)
        self._check_pose(name, place)
        if isinstance(kind, str):
            check_known("kind of body", kind, CATALOGUE)
            kind = CATALOGUE[kind]
        body = self.bullet.add(kind, place, backdrop=backdrop)
        self._footprints.add(body, kind.size, place)
        self._before = self._footprints.boxes
        self._kinds[body] = kind
        actor = Actor(name, kind, body, pose_at, reported, pose)
        self.actors.append(actor)
        if isinstance(pose, tuple):
            return actor
        if isinstance(pose, Member):
            self._groups.setdefault(pose.poses_at, []).append((body, pose.number))
        else:
            self._alone.append(actor)
        alone = [one.body for one in self._alone]
        members = [np.array(rows).T for rows in self._groups.values()]
        self._moving = np.concatenate([[self.ego_body, *alone], *(bodies for bodies, _ in members)])
        self._numbers = [numbers for _, numbers in members]
        return actor

    def at(self, time: float, event: Callable[[], None]) -> None:
        """Call `event` once, at the first world step at or after `time`. Raises InvalidInput after
        `hand_over`, as `at_every_step` does.
        """
        self._check_calls_events()
        self._events.append((time, event))

    def at_every_step(self, event: "Callable[[World], None]") -> None:
        """Call `event` with this world at every step, when ego and clock have moved on."""
        self._check_calls_events()
        self._every_step.append(event)

    @property
    def scripted(self) -> bool:
        """Whether the world calls functions while it moves: events, or at every step."""
        return bool(self._events or self._every_step)

    def is_over(self) -> bool:
        """Return True if the episode's event is over."""
        return self.ended(self)

    @property
    def along_m(self) -> float:
        """How far the ego's middle is along its route, or straight ahead."""
        return self.ego.along if isinstance(self.ego, RouteCar) else self.ego.pose[0]

    @property
    def ego_motion(self) -> Ego:
        """The car's own motion, as its odometry reports it."""
        return self._ego_motion

    def labels(self) -> dict[int, int]:
        """The class of every body that perception reports, by body id; an index into `CLASSES`."""
        return {actor.body: actor.label for actor in self.actors if actor.label is not None}

    def boxes(self, actors: Sequence[Actor]) -> Floats:
        """(n, 7) boxes of actors in the world frame."""
        return self.boxes_of(np.array([actor.body for actor in actors], np.int64))

    def boxes_of(self, bodies: Integers | slice) -> Floats:
        """(n, 7) boxes of bodies (n,), or of a slice of all, in the world frame."""
        return self._footprints.boxes[bodies]

    def centre_of(self, body: int) -> tuple[float, float]:
        """x, y of the centre of a body in the world frame."""
        x, y = self._footprints.boxes[body, :2].tolist()
        return x, y

    @property
    def kinds(self) -> Mapping[int, BodyKind]:
        """The kind of every body by id."""
        return self._kinds

    def velocities_of(self, bodies: Integers) -> Floats:
        """Return (n, 2) velocities of bodies (n,) in the world frame, m/s, over the last world
        step.
        """
        moved = self._footprints.boxes[bodies, :2] - self._before[bodies, :2]
        return np.asarray(moved / WORLD_STEP_S)

    def linear_motion(self) -> LinearMotion:
        """Return how everything moved over the last world step; before the first, all stands."""
        places = [0, 1, 6]
        # Rows without a body have no place and no motion.
        rates = rates_between(
            self._before[:, places], self._footprints.boxes[:, places], WORLD_STEP_S
        )
        rates = np.nan_to_num(rates)
        return LinearMotion(self.ego.pose, rates[self.ego_body], rates)

    def advance(self, acceleration: float, duration: float) -> ClosestApproach:
        """Move everything by `duration` seconds, a whole number of world steps. The ego holds
        `acceleration` (m/s^2) meanwhile. Clearance and distance are those of the first-sighting
        actor at its beginning.
        """
        steps, target = whole_steps(duration), self.first_sighting
        clearances, impacts = Clearances(1, steps), Impacts(1, WORLD_STEP_S)
        clearances.begin(0, None if target is None else (self.ego_kind, target.kind))
        impacts.begin(0, self.kinds)
        nearest_m, impact = np.full(1, np.inf), None
        egos = np.array([self.ego_body])
        targets = np.array([NO_BODY if target is None else target.body])
        for step in range(1, steps + 1):
            self.step(acceleration)
            boxes, before = self._footprints.boxes[None], self._before[None]
            poses, counts = self.bullet.primitives.poses[None], np.array([boxes.shape[1]])
            clearances.note(ONE_WORLD, np.array([step]), boxes, poses, (egos, targets), nearest_m)
            if impact is None:
                bodies = counts, boxes, before, poses
                touched = impacts.now(ONE_WORLD, *bodies, egos, np.array([self.ego.speed], float))
                impact = next((one for _, one in touched), None)
        return ClosestApproach(float(nearest_m[0]), clearances.least(0, 1, steps + 1), impact)

    def step(self, acceleration: float) -> None:
        """Move everything by a world step, as `advance` does, without clearances. Raises
        InvalidInput for a pose that is not finite.
        """
        # The traffic moves first, with the ego, then the clock. Events use the new time.
        before = self.ego.speed
        self.ego.accelerate(acceleration, WORLD_STEP_S)
        self.traffic.step(WORLD_STEP_S)
        # Counted and rounded, so that no sum of steps drifts away from the times of events.
        self._steps += 1
        self.time = round(self._steps * WORLD_STEP_S, 9)

        # Due events leave the list before any is called. An event may add another, which runs at
        # the next step if it is due already.
        if self._events:
            due = [event for start, event in self._events if start <= self.time]
            self._events = [(start, event) for start, event in self._events if start > self.time]
            for event in due:
                event()
        for look in self._every_step:
            look(self)
        self._ego_motion = Ego(
            self.ego.speed, self.ego.yaw_rate, (self.ego.speed - before) / WORLD_STEP_S
        )

        # Poses are read after events, which may change who moves.
        poses = [self.ego.pose, *(actor.pose_at(self.time) for actor in self._alone)]
        groups = zip(self._groups, self._numbers, strict=True)
        tables = [poses_at(self.time)[numbers] for poses_at, numbers in groups]
        self._put(np.concatenate([np.array(poses, float), *tables]), self._footprints.boxes)

    def _put(self, poses: Floats, before: Floats) -> None:
        bodies, self._before = self._moving, before.copy()
        self.bullet.move_all(bodies, poses)
        if not self._footprints.move_all(bodies, poses):
            names = {self.ego_body: "the ego"} | {actor.body: actor.name for actor in self.actors}
            for body, pose in zip(bodies.tolist(), poses.tolist(), strict=True):
                self._check_pose(names[body], pose)

    def hand_over(self) -> None:
        """Let other code move the world by `put`, which calls no events."""
        self._is_handed_over = True

    def put(
        self, steps: int, boxes: Floats, before: Floats, motion: Ego, lanes: Mapping[int, Floats]
    ) -> None:
        """Store the state of everything after this many world steps that other code has computed.

        `boxes` and `before` (m, 7) are those of all bodies now and a world step ago, `motion` the
        ego's. `lanes` holds x and speed of every vehicle by its body.
        """
        self._steps = steps
        self.time = round(steps * WORLD_STEP_S, 9)
        self._ego_motion = motion
        self._put(np.ascontiguousarray(boxes[self._moving][:, [0, 1, 6]]), before)
        vehicles = {self.ego_body: self.ego} | {
            actor.body: source_of(actor.moved_by) for actor in self._alone
        }
        for body, (x, speed) in lanes.items():
            vehicle = vehicles[body]
            assert isinstance(vehicle, RoadVehicle)
            vehicle.put(float(x), float(speed))

    def close(self) -> None:
        """Free the simulator."""
        self.bullet.close()

    def _check_calls_events(self) -> None:
        if self._is_handed_over:
            raise InvalidInput(f"{self.scene}: events must be set when the world is built")

    def _check_pose(self, name: str, pose: Pose) -> None:
        if not np.isfinite(pose).all():
            place = ", ".join(f"{number:g}" for number in pose)
            raise InvalidInput(
                f"{self.scene}: the pose of {name} is {place} at {self.time:g} s; x, y and heading "
                "must be finite numbers"
            )

    def __getstate__(self) -> dict[str, object]:
        check_copyable(self, self.scene)
        return vars(self)


def has_arrived(world: World) -> bool:
    """Whether the ego has reached its goal."""
    return world.along_m >= world.goal_m


# Motions and events are methods, or `partial` of functions: a copy of a world then holds copies of
# what moves. A closure would move the bodies of the world that was copied.
def _motion(pose: Pose | Motion | RoadVehicle) -> Motion:
    if isinstance(pose, RoadVehicle):
        return pose.pose_at
    return pose if callable(pose) else partial(_standing, pose)


def _standing(pose: Pose, _time: float) -> Pose:
    return pose


def whole_steps(duration: float) -> int:
    """World steps in `duration` seconds. Raises InvalidInput unless they are whole."""
    steps = round(duration / WORLD_STEP_S)
    if steps < 1 or abs(steps * WORLD_STEP_S - duration) > LAST_BITS_S:
        raise InvalidInput(
            f"keyframe_s must be a multiple of the world step {WORLD_STEP_S} s, got {duration!r}"
        )
    return steps
