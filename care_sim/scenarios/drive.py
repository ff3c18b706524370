"""The drive: a way through a generated street, with traffic that reacts and people who come out.

All that is drawn, and from which ranges, is in `care_sim.streets.drive` and
`care_sim.streets.encounters`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from care_sim.base.checks import bounded, check_flag, one_of
from care_sim.base.errors import InvalidInput
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats
from care_sim.scenarios.base import LONGEST_EPISODE_S, Scenario
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.streets.draft import footprints_meet
from care_sim.streets.drive import SAMPLE_S, TURN_CHANCE, Drive, draw_drive
from care_sim.streets.drivers import DrivenLane, LanePoses
from care_sim.streets.encounters import AT_KERB, COMERS, Course, Encounter, Wanted
from care_sim.streets.layouts import LANE_WIDTH_M, SPEED_LIMIT_MPS
from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_flow import Crossing, FlowingLane, StreetTraffic
from care_sim.world.motions import Crosser, Meeting, Walk
from care_sim.world.route import SpeedPlan
from care_sim.world.traffic import Traffic
from care_sim.world.world import WORLD_STEP_S, Member, World

CLEAR_M = 0.5
"""Least expected distance from other traffic when a comer sets off."""
LOOK_AHEAD_STEP_S = 0.1
"""Time between two such checks."""

_BETWEEN = round(SAMPLE_S / WORLD_STEP_S)
"""World steps from sample to sample."""


SIDES = {"left": 1, "right": -1}


@dataclass(frozen=True)
class DriveScenario(Scenario):
    """A drive through a generated street, with traffic that reacts and people who come out.

    The route is 160 to 260 m long: straight, round a bend or into a side street. The ego slows for
    bends and follows vehicles ahead. Up to three times an adult, a child, a cyclist or a car comes
    out of hiding (`care_sim.streets.encounters`). The seed draws every value that is None.
    """

    cameras = SURROUND_CAMERAS
    duration_s: float = bounded(LONGEST_EPISODE_S, 0.05, LONGEST_EPISODE_S)
    encounters: int = bounded(3, 0, 3)
    """Largest number of encounters. The seed draws the number evenly from 0 on."""
    side: str | None = one_of(None, SIDES)
    """Side from which all come. Few cars and cyclists can come from the left."""
    who: str | None = one_of(None, COMERS)
    """Kind of the person or vehicle that comes out."""
    occluder_reported: bool | None = None
    """Whether perception reports the occluder. True leaves adults and children only."""
    turn_chance: float = bounded(TURN_CHANCE, 0, 1)
    """Probability that the ego turns off where there is a side street."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.occluder_reported is not None:
            check_flag("occluder_reported of drive", self.occluder_reported)
        if self.occluder_reported and self.who is not None and self.who not in AT_KERB:
            raise InvalidInput(
                f"who of drive must be one of {', '.join(AT_KERB)} where perception reports what "
                f"hides them, got {self.who}"
            )

    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero."""
        side = None if self.side is None else SIDES[self.side]
        wanted = Wanted(self.encounters, side, self.who, self.occluder_reported)
        drive = draw_drive(rng, self.duration_s, wanted, self.turn_chance)
        # highway-env's straight road stays empty; the lanes of the street have their own flows.
        nobody = Traffic((1,), ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=SPEED_LIMIT_MPS)
        world = World(nobody, drive.plan.cruise_mps, drive.plan.route)
        world.goal_m = drive.goal_m
        world.speed_plan = drive.plan
        lanes = [_flowing(drive, lane) for lane in drive.lanes]
        traffic = StreetTraffic(lanes, LanePoses(drive.lanes))
        _add_bodies(world, drive)
        _add_vehicles(world, drive, traffic)
        _add_encounters(world, drive, traffic)
        return world


def _flowing(drive: Drive, lane: DrivenLane) -> FlowingLane:
    """Return a lane with its drivers, and the ego's part in it."""
    # The ego's own lanes are those along its roads whose middle is its route. While it turns, it is
    # in both: its tail is in the way of who follows until the turn ends.
    before = [-np.inf, *(one.to_m for one in drive.stretches[:-1])]
    after = [*(one.from_m for one in drive.stretches[1:]), np.inf]
    for stretch, begins, ends in zip(drive.stretches, before, after, strict=True):
        if stretch.road.curve == lane.curve and lane.d == 0.0:
            part = begins, ends, -stretch.offset_m
            return FlowingLane(lane.places, lane.speeds, lane.stop_m, *part)
    return FlowingLane(lane.places, lane.speeds, lane.stop_m)


def _add_bodies(world: World, drive: Drive) -> None:
    """Add everything that stands or walks on its own."""
    walks = (drive.ways != drive.ways[:, :1]).any(axis=(1, 2))
    poses_at, numbers = _Ways(drive.ways[walks]).poses_at, np.cumsum(walks) - 1
    for kind, way, moves, number in zip(drive.kinds, drive.ways, walks, numbers, strict=True):
        x, y, heading = way[0].tolist()
        world.add(kind, kind, Member(poses_at, int(number)) if moves else (x, y, heading))


class _Ways:
    """The motions along `ways` (n, t, 3) that are sampled every SAMPLE_S."""

    def __init__(self, ways: Floats):
        self._samples = np.ascontiguousarray(ways.swapaxes(0, 1))

    def poses_at(self, time: float) -> Floats:
        """(n, 3) the poses at `time`."""
        # Between two samples evenly, heading as at the first.
        steps = min(round(time / WORLD_STEP_S), _BETWEEN * (len(self._samples) - 1) - 1)
        sample, step = divmod(steps, _BETWEEN)
        before = self._samples[sample]
        poses: Floats = before + step / _BETWEEN * (self._samples[sample + 1] - before)
        poses[:, 2] = before[:, 2]
        return poses

    def __deepcopy__(self, _copied: dict[int, object]) -> Self:
        # Ways never change.
        return self


def _add_vehicles(world: World, drive: Drive, traffic: StreetTraffic) -> None:
    """The traffic, which sees the ego where it is at every step."""
    kinds = [kind for lane in drive.lanes for kind in lane.kinds]
    for number, kind in enumerate(kinds):
        world.add(f"driven {kind}", kind, Member(traffic.poses_at, number))
    world.at_every_step(partial(_drive_on, traffic))


def _drive_on(traffic: StreetTraffic, world: World) -> None:
    traffic.step(WORLD_STEP_S, world.time, world.along_m, world.ego.speed)


def _add_encounters(world: World, drive: Drive, traffic: StreetTraffic) -> None:
    """Add the people who come out. The episode is about the first who would be hit, else the first
    of all.
    """
    for one in drive.encounters:
        free = _may_go(drive, traffic, CATALOGUE[one.who].size[:2])
        crosser = Crosser(one.walk, one.lead_s, free)
        for flowing, lane in zip(traffic.lanes, drive.lanes, strict=True):
            if lane.curve == one.curve:
                flowing.crossings.append(_crossing(crosser, one, lane))
        actor = world.add(one.who, one.who, crosser.pose)
        world.at_every_step(partial(_look, crosser, drive.plan, one.arrival_m))
        side = "left" if one.side > 0 else "right"
        occluder = one.occluder, one.occluder_reported
        world.meetings.append(
            Meeting(
                actor.body,
                one.who,
                side,
                one.along_m,
                one.way.value,
                one.course.value,
                *occluder,
                crosser,
            )
        )
        if world.first_sighting is None:
            world.first_sighting = actor
    hits = [one for one in world.meetings if one.course == Course.CONFLICT]
    if hits:
        world.first_sighting = next(a for a in world.actors if a.body == hits[0].body)


def _crossing(crosser: Crosser, one: Encounter, lane: DrivenLane) -> Crossing:
    """The way of a crosser over a lane of the road that it crosses at a right angle."""
    # A crosser is in the lane if it reaches into it, not if it stops before its edge.
    to_middle = one.side * (one.from_d - lane.d)
    reach = (LANE_WIDTH_M + CATALOGUE[one.who].size[0]) / 2
    return Crossing(crosser, lane.direction * one.s, to_middle - reach, to_middle + reach)


def _look(crosser: Crosser, plan: SpeedPlan, line_m: float, world: World) -> None:
    """Let a crosser watch the ego, whose middle is on the line at `line_m` along the route."""
    # Seconds are counted at planned speeds or less: nobody decides while the car is too far away.
    if line_m - world.along_m > plan.cruise_mps * (crosser.lead_s + LAST_BITS_S):
        return
    crosser.look(world.time, lambda: _seconds_left(world, plan, line_m))


def _seconds_left(world: World, plan: SpeedPlan, line_m: float) -> float:
    """Return the ego's time until its middle is `line_m` along the route, if it continues as
    now.
    """
    gaining = max(world.ego_motion.acceleration, 0.0)
    return plan.seconds_to(world.along_m, line_m, world.ego.speed, gaining)


def _may_go(
    drive: Drive, traffic: StreetTraffic, size: tuple[float, float]
) -> Callable[[Walk], bool]:
    """Return the rule by which a crosser of a `size` sets off."""
    sizes = [CATALOGUE[kind].size[:2] for lane in drive.lanes for kind in lane.kinds]
    return partial(_is_free, traffic, np.array(sizes, float).reshape(-1, 2), size)


def _is_free(traffic: StreetTraffic, sizes: Floats, size: tuple[float, float], walk: Walk) -> bool:
    """Return True if a crosser of a `size` keeps clear of all traffic, without braking drivers. The
    vehicles have `sizes` (n, 2).
    """
    times = np.arange(0.0, walk.duration_to(walk.length_m), LOOK_AHEAD_STEP_S)
    own = np.array([walk.pose(walk.starts_s + time) for time in times.tolist()])
    poses = traffic.foreseen(len(times), LOOK_AHEAD_STEP_S).reshape(-1, 3)
    return not footprints_meet(
        np.repeat(own, len(sizes), axis=0),
        np.broadcast_to(size, (len(poses), 2)),
        poses,
        np.tile(sizes, (len(times), 1)),
        np.full(len(poses), CLEAR_M),
    ).any()
