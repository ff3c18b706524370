"""The state of W worlds, as arrays with a row per world that compiled code takes whole.

Each of the W worlds has its own numbers of bodies, parts and tracks. Tables are as long as the
longest needs. `counts` (W,) says how many rows of a world's table are in use; rows beyond mean
nothing. World frame, metres and radians, unless it says otherwise.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, filled, longer
from care_sim.core.belief import MAX_TRACKS
from care_sim.core.frames import Frame, placed_at, seen_from
from care_sim.core.grid import Cells
from care_sim.core.types import Tracks
from care_sim.sensors.engines.view_kernels import Meshes
from care_sim.sensors.engines.window_kernels import Parts
from care_sim.world.approach import Impact
from care_sim.world.bullet import NO_BODY
from care_sim.world.world import World

_BODIES, _PARTS, _CORNERS = 32, 128, 1024
"""Rows with which tables begin; they grow with what comes."""


class Bodies(NamedTuple):
    """By body id: `boxes` (W, B, 7) as in `care_sim.world.body_tables.Footprints`, `before`
    (W, B, 7) those of a world step ago, and `poses` (W, B, 7) as in `Primitives.poses`.
    """

    counts: Integers
    boxes: Floats
    before: Floats
    poses: Floats


class Solids(NamedTuple):
    """Parts that rays can hit: `counts` (W,) of them, and their columns (W, P, ...)."""

    counts: Integers
    parts: Parts


class Outlines(NamedTuple):
    """Parts that cameras see: `counts` (W,) of them, and their columns (W, ...)."""

    counts: Integers
    meshes: Meshes


class Reported(NamedTuple):
    """The bodies that perception reports, by ascending id: `bodies` (W, R) and their `classes` (W,
    R). Their `boxes` (W, R, 7) are at the coming keyframe, in the sensor frames. `by_body` (W, B)
    is the class of every body, -1 without one.
    """

    counts: Integers
    bodies: Integers
    classes: Integers
    boxes: Floats
    by_body: Integers


class TrackTables(NamedTuple):
    """`rows` (W, T, 13) as in `care_sim.perception.tracker`, and the `next_ids` (W,)."""

    counts: Integers
    rows: Floats
    next_ids: Integers


class Sensors(NamedTuple):
    """Where the LiDAR of each car is now. `poses` (W, 6) are x, y, z, yaw, roll, pitch. `turns` (W,
    2) are the cosine and sine of yaw, and `turns_back` (W, 2) those of -yaw. NumPy computes these,
    as in `care_sim.core.frames`.
    """

    poses: Floats
    turns: Floats
    turns_back: Floats

    @classmethod
    def of(cls, worlds: int) -> "Sensors":
        """Tables of so many worlds."""
        return cls(np.zeros((worlds, 6)), np.zeros((worlds, 2)), np.zeros((worlds, 2)))

    def frame(self, world: int) -> Frame:
        """Return the frame of a world."""
        x, y, z, yaw, _, _ = self.poses[world].tolist()
        return Frame(x, y, z, yaw)

    def put(self, world: int, frame: Frame) -> None:
        """Write the frame of a world."""
        self.poses[world, :4] = frame.x, frame.y, frame.z, frame.yaw
        self.turns[world] = np.cos(frame.yaw), np.sin(frame.yaw)
        self.turns_back[world] = frame.turn_back


class Egos(NamedTuple):
    """Each car's own motion: `speeds`, `yaw_rates`, `accelerations` (W,) as in
    `care_sim.core.types.Ego`; its `bodies` (W,), and the `targets` (W,), the first-sighting actor's
    body or NO_BODY.
    """

    speeds: Floats
    yaw_rates: Floats
    accelerations: Floats
    bodies: Integers
    targets: Integers


class Fired(NamedTuple):
    """The cells of a keyframe: `cells` (W, F), ascending in each row. One that is fired several
    times is there as often.
    """

    counts: Integers
    cells: Integers

    @classmethod
    def of(cls, rows: Sequence[Cells]) -> "Fired":
        """The cells of each world."""
        counts = np.array([len(row) for row in rows])
        if len(rows) == 1:
            return cls(counts, np.ascontiguousarray(rows[0], np.int64)[None])
        cells = np.zeros((len(rows), counts.max(initial=0)), np.int64)
        for world, row in enumerate(rows):
            cells[world, : len(row)] = row
        return cls(counts, cells)


class Passages(NamedTuple):
    """Events while the worlds moved to the next keyframe, (W,) each. `nearest_m` and `clearance_m`
    are as in `care_sim.world.approach.ClosestApproach`. `hit` says whether there was an impact, and
    `impact_speed_mps` is the ego's speed at the first one. `impacts` holds these first impacts by
    world.
    """

    nearest_m: Floats
    clearance_m: Floats
    hit: Mask
    impact_speed_mps: Floats
    impacts: dict[int, Impact]


class State:
    """The tables of `worlds` worlds."""

    def __init__(self, worlds: int):
        self.worlds = worlds
        self.live = np.zeros(worlds, np.bool_)
        """(W,) whose episode is running: the others are left alone."""
        self.keyframes = np.zeros(worlds, np.int64)
        """(W,) the number of each world's coming keyframe, from 0."""
        self.times = np.zeros(worlds)
        """(W,) seconds from the start."""
        self.bodies = Bodies(
            _counts(worlds), *(np.full((worlds, _BODIES, 7), np.nan) for _ in range(3))
        )
        self.solids = Solids(
            _counts(worlds),
            Parts(
                np.zeros((worlds, _PARTS), np.int64),
                np.zeros((worlds, _PARTS, 3)),
                np.zeros((worlds, _PARTS, 3)),
                np.zeros((worlds, _PARTS), np.int64),
            ),
        )
        self.outlines = Outlines(
            _counts(worlds),
            Meshes(
                np.zeros((worlds, _CORNERS, 3)),
                np.zeros((worlds, _CORNERS, 4)),
                np.zeros((worlds, _CORNERS, 2), np.int64),
                np.zeros((worlds, _PARTS, 3), np.int64),
                np.zeros((worlds, _PARTS), np.int64),
                np.zeros((worlds, _PARTS)),
            ),
        )
        self.reported = Reported(
            _counts(worlds),
            np.zeros((worlds, _BODIES), np.int64),
            np.zeros((worlds, _BODIES), np.int64),
            np.zeros((worlds, _BODIES, 7)),
            np.full((worlds, _BODIES), -1),
        )
        self.tracks = TrackTables(
            _counts(worlds), np.zeros((worlds, MAX_TRACKS, len(Tracks.COLUMNS))), _counts(worlds)
        )
        self.sensors = self.taken = self.driven = Sensors.of(worlds)
        """Where the LiDARs are, and where the software takes them to be. The driver measures from
        `driven`: the point of the car's middle line beside the LiDAR, where the software takes it
        to be.
        """
        self.read = np.zeros((worlds, 3))
        """(W, 3) speed, yaw rate and acceleration that the odometry reads, within their limits."""
        motion = np.zeros(worlds), np.zeros(worlds), np.zeros(worlds)
        self.egos = Egos(*motion, _counts(worlds), _counts(worlds))


def _counts(worlds: int) -> Integers:
    return np.zeros(worlds, np.int64)


@compiled()
def seen_by(sensors: Sensors, world: int, boxes: Floats) -> Floats:
    """Boxes (n, 7) of a world in the frame of its sensor."""
    x, y, z, yaw, _, _ = sensors.poses[world]
    cos, sin = sensors.turns_back[world]
    return seen_from(boxes, (cos, sin), (x, y, z, yaw))


@compiled()
def placed_by(sensors: Sensors, world: int, boxes: Floats) -> Floats:
    """Boxes (n, 7) in the frame of a world's sensor, in the world."""
    x, y, z, yaw, _, _ = sensors.poses[world]
    cos, sin = sensors.turns[world]
    return placed_at(boxes, (cos, sin), (x, y, z, yaw))


def load(state: State, world: int, built: World) -> None:
    """Write the tables of a `world` anew: bodies, parts, classes, the ego; no tracks,
    and keyframe 0.
    """
    state.keyframes[world], state.times[world] = 0, built.time
    target = built.first_sighting
    motion = built.ego_motion
    state.egos.bodies[world] = built.ego_body
    state.egos.targets[world] = NO_BODY if target is None else target.body
    state.egos.speeds[world] = motion.speed
    state.egos.yaw_rates[world] = motion.yaw_rate
    state.egos.accelerations[world] = motion.acceleration
    state.tracks.counts[world] = state.tracks.next_ids[world] = 0

    load_bodies(state, world, built)

    # Ids count up in the order in which bodies were added, and so do those that are reported.
    labels = built.labels()
    reported = state.reported
    reported.counts[world] = len(labels)
    reported.by_body[world] = -1
    reported.by_body[world, [*labels]] = [*labels.values()]
    state.reported = reported._replace(
        bodies=filled(reported.bodies, world, np.array([*labels], np.int64)),
        classes=filled(reported.classes, world, np.array([*labels.values()], np.int64)),
        boxes=filled(reported.boxes, world, np.zeros((len(labels), 7))),
    )


def load_bodies(state: State, world: int, built: World) -> None:
    """Write the bodies of a `world` and their parts anew."""
    primitives = built.bullet.primitives
    count = len(primitives.poses)
    boxes = built.boxes_of(np.arange(count))
    state.bodies.counts[world] = count
    bodies = state.bodies
    state.bodies = bodies._replace(
        boxes=filled(bodies.boxes, world, boxes),
        before=filled(bodies.before, world, boxes),
        poses=filled(bodies.poses, world, primitives.poses),
    )
    # Bodies that an event adds have no class.
    length, by_body = state.bodies.boxes.shape[1], state.reported.by_body
    if length > by_body.shape[1]:
        state.reported = state.reported._replace(by_body=longer(by_body, length, empty=-1))
    solids, outlines = state.solids, state.outlines
    parts, meshes = primitives.tables, built.bullet.polyhedra.tables
    solids.counts[world], outlines.counts[world] = len(parts[-1]), len(meshes[-1])
    state.solids = Solids(solids.counts, Parts(*_all_filled(solids.parts, world, parts)))
    state.outlines = Outlines(outlines.counts, Meshes(*_all_filled(outlines.meshes, world, meshes)))


def _all_filled(
    tables: Iterable[np.ndarray], world: int, columns: Iterable[np.ndarray]
) -> Iterator[np.ndarray]:
    return (filled(table, world, rows) for table, rows in zip(tables, columns, strict=True))
