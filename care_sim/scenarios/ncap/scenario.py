"""A Euro NCAP test as a scenario: test and speeds are arguments, the seed draws the rest."""

from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from care_sim.base.checks import bounded, one_of
from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Pose
from care_sim.scenarios.base import LONGEST_EPISODE_S, MIRRORED, NO_LIMIT_MPS, Scenario
from care_sim.scenarios.ncap.meetings import (
    Ego,
    Meeting,
    Sizes,
    across,
    across_exit,
    ahead,
    braking_ahead,
    oncoming,
    standing_cars,
)
from care_sim.scenarios.ncap.table import (
    LARGE_HEIGHT_M,
    LARGE_LENGTH_M,
    LARGE_WIDTH_M,
    SMALL_HEIGHT_M,
    SMALL_LENGTH_M,
    SMALL_WIDTH_M,
    TESTS,
    Across,
    AcrossExit,
    Ahead,
    BrakingAhead,
    NcapTest,
    Oncoming,
    Variation,
)
from care_sim.streets.layouts import LANE_WIDTH_M, Range, draw
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route
from care_sim.world.traffic import Traffic
from care_sim.world.world import Motion, World

DRAWN = "drawn"
"""In the place of a test's name: the seed draws one."""


@dataclass(frozen=True)
class Ncap(Scenario):
    """A test of Euro NCAP's protocols of emergency braking, on an empty proving ground.

    There are the ego at the test's speed, the target, and the cars that hide the target where the
    test has them.
    An ego that does not brake hits the target as the protocol wants it. The seed draws only what
    the protocol leaves open: within its tolerance the ego's speed, when the sensor begins, the
    sizes of the cars that stand there, and, unless `mirrored` says, the side.

    With `test="drawn", speed_kph=0` the seed draws a test too, each as often as the others, and one
    of its pairs of speeds, so that a map of a single test does not fit.

    These cars are of one of the five classes. With `occluder_reported=False` perception does not
    report them. Ranges are drawn uniformly by the seed.
    """

    duration_s: float = bounded(20.0, 0.05, LONGEST_EPISODE_S)
    test: str = one_of("CPNCO-50", (*TESTS, DRAWN))
    """One of `care_sim.scenarios.ncap.table.TESTS`, or drawn."""
    speed_kph: float = bounded(40.0, 0, 140)
    """The ego's, km/h. 0 stands for a pair of the protocol's speeds that the seed draws. Tests in
    which it turns have a line for each of the protocol's speeds and take no other."""
    target_kph: float = bounded(0.0, 0, 140)
    """The target's, km/h. 0 stands for the protocol's at the ego's speed: the first where it has
    several, unless the pair is drawn."""
    mirrored: str = one_of("drawn", MIRRORED)
    """never, always, or half of the seeds: reflected at the ego's way, as in left-hand traffic."""
    occluder_reported: bool = True
    excess_kph: Range = bounded((0.0, 1.0), 0, 4)
    """By how much the ego is faster than the test's speed: the protocol's tolerance."""
    phase_s: Range = bounded((0.0, 0.1), 0, 2)
    """How much earlier the episode begins: anywhere within a keyframe."""
    small_length_m: Range = bounded(SMALL_LENGTH_M, 3, 6)
    small_width_m: Range = bounded(SMALL_WIDTH_M, 1.5, 2.5)
    large_length_m: Range = bounded(LARGE_LENGTH_M, 3, 6)
    large_width_m: Range = bounded(LARGE_WIDTH_M, 1.5, 2.5)
    """Of the cars that hide the target: the protocol's ranges."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("speed_kph", "target_kph"):
            if 0 < getattr(self, name) < 1:
                raise InvalidInput(
                    f"{name} of ncap must be 0 or at least 1, got {getattr(self, name):g}"
                )
        if not self.speed_kph and self.target_kph:
            raise InvalidInput(
                "target_kph of ncap must be 0 where speed_kph is: the seed draws the pair, got "
                f"{self.target_kph:g}"
            )
        if self.test == DRAWN:
            if self.speed_kph:
                raise InvalidInput(
                    "speed_kph of ncap must be 0 where the test is drawn, since not every test has "
                    f"every speed, got {self.speed_kph:g}"
                )
            return
        way = TESTS[self.test].way
        bends = way.bends if isinstance(way, AcrossExit | Oncoming) else {}
        if bends and self.speed_kph and self.speed_kph not in bends:
            raise InvalidInput(
                f"speed_kph of {self.test} must be one of "
                f"{', '.join(f'{speed:g}' for speed in bends)}, the only ones for which the "
                f"protocol has a turn, or 0, got {self.speed_kph:g}"
            )

    def drawn(self, rng: np.random.Generator) -> "Ncap":
        """The scenario with the test and the speeds of an episode; itself where all are given.

        Takes no number of `rng`, so that what `build` draws then is what it draws for that test.
        """
        if self.speed_kph:
            return self
        # Of a copy, since a generator counts what it spawns.
        own = deepcopy(rng).spawn(1)[0]
        name = str(own.choice(list(TESTS))) if self.test == DRAWN else self.test
        known = TESTS[name].variations
        speeds = known[int(own.integers(len(known)))]
        return replace(self, test=name, speed_kph=speeds.ego_kph, target_kph=speeds.target_kph)

    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero."""
        own = self.drawn(rng)
        world = own._build(rng)
        if not self.speed_kph:
            speeds = {"speed_kph": own.speed_kph, "target_kph": own.target_kph}
            world.drawn = {**speeds, **world.drawn}
        if self.test == DRAWN:
            world.drawn = {"test": own.test, **world.drawn}
        return world

    def _build(self, rng: np.random.Generator) -> World:
        # The order of the draws is part of what a seed means. All are made for every test.
        test = TESTS[self.test]
        speed = (self.speed_kph + draw(rng, self.excess_kph)) / 3.6
        start_s = test.start_s + draw(rng, self.phase_s)
        side = 1.0 if rng.random() < 0.5 else -1.0
        if self.mirrored != DRAWN:
            side = -1.0 if self.mirrored == "always" else 1.0
        sizes = Sizes(
            (draw(rng, self.small_length_m), draw(rng, self.small_width_m), SMALL_HEIGHT_M),
            (draw(rng, self.large_length_m), draw(rng, self.large_width_m), LARGE_HEIGHT_M),
        )

        length, width, _ = CATALOGUE["ego"].size
        meeting = _meeting(test, self._variation(), Ego(speed, length, width, start_s))
        traffic = Traffic((1,), ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=NO_LIMIT_MPS)
        world = World(traffic, speed, _mirrored_route(meeting.route, side))
        world.has_oncoming = True
        if self.mirrored == DRAWN:
            world.drawn = {"mirrored": "always" if side < 0 else "never"}
        self._add_cars(world, meeting, sizes, side)
        world.first_sighting = world.add(
            test.target.body, test.target.body, partial(_mirrored_at, meeting.motion, side)
        )
        world.ended = meeting.end.is_over
        return world

    def _add_cars(self, world: World, meeting: Meeting, sizes: Sizes, side: float) -> None:
        """Add the cars that hide the target, if there are any."""
        test = TESTS[self.test]
        target_width = CATALOGUE[test.target.body].size[1]
        ego_width = world.ego_kind.size[1]
        # They are reckoned for a target from the right, and stand on the side that it comes from.
        far = isinstance(test.way, Across) and test.way.far
        cars = standing_cars(test.obstruction, sizes, meeting.line_x, target_width, ego_width)
        for number, car in enumerate(cars):
            pose = _mirrored(car.pose, -side if far else side)
            world.add(f"obstruction {number}", car.kind, pose, reported=self.occluder_reported)

    def _variation(self) -> Variation:
        """The speeds of this episode, and the line of a turn."""
        known = TESTS[self.test].variations
        own = next((each for each in known if each.ego_kph == self.speed_kph), known[0])
        return Variation(self.speed_kph, self.target_kph or own.target_kph)


def _meeting(test: NcapTest, speeds: Variation, ego: Ego) -> Meeting:
    """How the ego and the target of a test meet."""
    way, target, speed = test.way, test.target, speeds.target_kph / 3.6
    match way:
        case Across():
            return across(way, target, speed, ego)
        case Ahead():
            return ahead(way, target, speed, ego)
        case BrakingAhead():
            return braking_ahead(way, target, ego)
        case AcrossExit():
            return across_exit(way, target, speed, way.bends[speeds.ego_kph], ego)
        case Oncoming():
            return oncoming(target, speed, way.bends[speeds.ego_kph], ego)


def _mirrored(pose: Pose, side: float) -> Pose:
    """A pose as it is, or with `side` -1 on the other side of the ego's way."""
    x, y, heading = pose
    return x, side * y, side * heading


def _mirrored_at(motion: Motion, side: float, time: float) -> Pose:
    return _mirrored(motion(time), side)


def _mirrored_route(route: Route | None, side: float) -> Route | None:
    return route and Route(
        _mirrored(route.start, side), tuple((length, side * bend) for length, bend in route.legs)
    )
