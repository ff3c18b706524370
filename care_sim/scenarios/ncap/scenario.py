"""A Euro NCAP test as a scenario: test and speeds are arguments, the seed draws the rest."""

from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from care_sim.base.checks import bounded, one_of
from care_sim.base.errors import InvalidInput
from care_sim.scenarios.base import (
    LONGEST_EPISODE_S,
    MIRRORED,
    NO_LIMIT_MPS,
    MirroredWorld,
    Scenario,
)
from care_sim.scenarios.ncap.meetings import (
    Ego,
    Meeting,
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
from care_sim.world.world import World

DRAWN = "drawn"
"""In the place of a test's name: the seed draws one."""


@dataclass(frozen=True)
class Ncap(Scenario):
    """A test of Euro NCAP's protocols of emergency braking, on an empty proving ground.

    The world holds the ego at the test's speed, the target, and the cars that hide the target in
    some tests. The seed draws what the protocol leaves open: the ego's speed within the tolerance,
    the start time, the sizes of the standing cars, and the side. `test="drawn", speed_kph=0` also
    draws the test and one of its pairs of speeds, all equally likely. `occluder_reported=False`
    hides the standing cars from perception.
    """

    duration_s: float = bounded(20.0, 0.05, LONGEST_EPISODE_S)
    test: str = one_of("CPNCO-50", (*TESTS, DRAWN))
    """The test, or "drawn"."""
    speed_kph: float = bounded(40.0, 0, 140)
    """Speed of the ego, km/h. At 0 the seed draws the protocol's speeds. Turning tests allow no
    other speeds."""
    target_kph: float = bounded(0.0, 0, 140)
    """Speed of the target, km/h. 0 takes the protocol's speed, the first one of several."""
    mirrored: str = one_of("drawn", MIRRORED)
    """Mirror the world (left-hand traffic): in no, half, or all of the seeds."""
    occluder_reported: bool = True
    excess_kph: Range = bounded((0.0, 1.0), 0, 4)
    """Extra speed of the ego, within the protocol's tolerance."""
    phase_s: Range = bounded((0.0, 0.1), 0, 2)
    """Shift of the start, within a keyframe."""
    small_length_m: Range = bounded(SMALL_LENGTH_M, 3, 6)
    small_width_m: Range = bounded(SMALL_WIDTH_M, 1.5, 2.5)
    large_length_m: Range = bounded(LARGE_LENGTH_M, 3, 6)
    large_width_m: Range = bounded(LARGE_WIDTH_M, 1.5, 2.5)
    """Sizes of the cars that hide the target."""

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
        # Spawn from a copy, since a generator counts what it spawns.
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
        small = draw(rng, self.small_length_m), draw(rng, self.small_width_m), SMALL_HEIGHT_M
        large = draw(rng, self.large_length_m), draw(rng, self.large_width_m), LARGE_HEIGHT_M

        length, width, _ = CATALOGUE["ego"].size
        meeting = _meeting(test, self._variation(), Ego(speed, length, width, start_s))
        traffic = Traffic((1,), ego_lane=0, lane_width=LANE_WIDTH_M, speed_limit=NO_LIMIT_MPS)
        route = meeting.route
        if side < 0 and route is not None:
            x, y, heading = route.start
            route = Route((x, -y, -heading), tuple((way, -bend) for way, bend in route.legs))
        world = (MirroredWorld if side < 0 else World)(traffic, speed, route)
        world.has_oncoming = True
        if self.mirrored == DRAWN:
            world.drawn = {"mirrored": "always" if side < 0 else "never"}
        target = CATALOGUE[test.target.body]
        cars = standing_cars(test.obstruction, small, large, meeting.line_x, target.size[1], width)
        # They stand on the side that the target comes from.
        far = isinstance(test.way, Across) and test.way.far
        for number, (kind, (x, y, heading)) in enumerate(cars):
            pose = (x, -y, -heading) if far else (x, y, heading)
            world.add(f"obstruction {number}", kind, pose, reported=self.occluder_reported)
        world.first_sighting = world.add(test.target.body, test.target.body, meeting.motion)
        world.ended = meeting.end.is_over
        return world

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
