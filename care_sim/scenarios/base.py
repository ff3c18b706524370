"""Base of the scenarios: the class Scenario, the street of the first three, its reflection."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from care_sim.base.checks import bounded, check_fields, one_of
from care_sim.base.errors import (
    BrokenScenario,
    InvalidInput,
    error_line,
    foreign_place,
    is_raised_by_foreign,
)
from care_sim.base.plugins import dataclass_faults
from care_sim.core.frames import Pose
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.streets.layouts import LANE_WIDTH_M, PARKING_WIDTH_M, SPEED_LIMIT_MPS
from care_sim.world.bodies import CATALOGUE, BodyKind
from care_sim.world.traffic import RoadVehicle, Traffic
from care_sim.world.world import Actor, Motion, Reflection, World, reflect_pose


def scenario_faults(made: Any) -> Iterator[str]:
    """Return why a loaded object is no scenario, one text per reason, for
    `care_sim.base.plugins`.
    """
    if not (inspect.isclass(made) and issubclass(made, Scenario)):
        yield "is no Scenario"
        return
    yield from dataclass_faults(made)
    cameras = made.cameras
    if not (isinstance(cameras, tuple) and all(isinstance(one, PinholeCamera) for one in cameras)):
        yield f"has the cameras {cameras!r:.80}; allowed is a tuple of PinholeCamera"


LONGEST_EPISODE_S = 60.0
"""The longest episode: a car at 60 km/h then reaches the end of the road, and the age of a delayed
picture reaches its bound in observations.
"""
EGO_SPEED_BOUNDS_MPS = (0.5, 60.0)
"""Bounds of the ego's speed: from a walk to far beyond any street's traffic."""

NO_LIMIT_MPS = 2 * SPEED_LIMIT_MPS
"""Speed limit of lanes whose drivers keep the ego's speed: a lower one would slow them."""
USUAL_EGO_SPEED_MPS = (SPEED_LIMIT_MPS - 0.3, SPEED_LIMIT_MPS + 0.3)
"""30 km/h, give or take the 1 km/h by which a driver's speed varies."""
RIGHT_PARKING_Y = -(LANE_WIDTH_M + PARKING_WIDTH_M) / 2
"""Middle of the right parking lane of a two-lane street, from the middle of the ego's lane."""
LEFT_PARKING_Y = LANE_WIDTH_M - RIGHT_PARKING_Y
"""Middle of the left one."""
FIRST_HOUSE_X = -30.0
"""Where the houses begin: behind the ego's first position."""


@dataclass(frozen=True)
class Scenario(ABC):
    """The physics of a scenario: numbers, and ranges within which a seeded generator draws."""

    cameras: ClassVar[tuple[PinholeCamera, ...]] = (FRONT_CAMERA,)
    """The car's sensor set-up, controller and driver."""
    duration_s: float = bounded(6.0, 0.05, LONGEST_EPISODE_S)
    """Longest duration of an episode."""

    def __post_init__(self) -> None:
        check_fields(self, f" of {type(self).__name__.removesuffix('Scenario').lower()}")

    @abstractmethod
    def build(self, rng: np.random.Generator) -> World:
        """A fresh world at time zero. The caller closes it."""

    def make_world(self, rng: np.random.Generator) -> World:
        """Return the world that `build` makes. Raises BrokenScenario, with the class's place, where
        that fails or is no world to be played; InvalidInput as `build` does.
        """
        own = f"scenario {type(self).__module__}:{type(self).__qualname__}"
        try:
            world = self.build(rng)
        except InvalidInput as error:
            # Wrong calls of our code are faults of the scenario.
            if (place := foreign_place(error)) and not is_raised_by_foreign(error):
                raise BrokenScenario(f"{own} cannot be built: {error}{place}") from error
            raise
        except KeyboardInterrupt:
            raise
        # Foreign code may raise anything; some leaves by `sys.exit`.
        except BaseException as error:
            raise BrokenScenario(f"{own} cannot be built: {error_line(error)}") from error
        if not isinstance(world, World):
            raise BrokenScenario(f"{own}: build must return a World, got {type(world).__name__}")
        # A drive has meetings in its place, or on its route nobody to meet.
        if not (world.first_sighting or world.meetings or world.route):
            world.close()
            raise BrokenScenario(f"{own}: build sets no first_sighting, the actor that is scored")
        if world.time:
            at = world.time
            world.close()
            raise BrokenScenario(f"{own}: build must return a world at 0 s, got one at {at:g} s")
        world.scene = own
        return world


def line_with_terraces(world: World, right_y: float, left_y: float) -> None:
    """Closed house fronts at y = `right_y` and y = `left_y`, from behind the ego to beyond its
    view.
    """
    length, depth, _ = CATALOGUE["terrace"].size
    middle = length / 2 + FIRST_HOUSE_X
    world.add("terrace right", "terrace", (middle, right_y - depth / 2, 0.0), backdrop=True)
    world.add("terrace left", "terrace", (middle, left_y + depth / 2, 0.0), backdrop=True)


MIRRORED = ("never", "drawn", "always")


@dataclass(frozen=True)
class MirrorableScenario(Scenario):
    """A scenario whose world may be reflected at the middle of the ego's lane, as in left-hand
    traffic.

    A world and its reflection share every other draw of the seed.
    """

    mirrored: str = one_of("never", MIRRORED)
    """Mirror the world (left-hand traffic): in no, half, or all of the seeds."""

    def empty_world(self, traffic: Traffic, ego_speed: float, rng: np.random.Generator) -> World:
        """The world to be filled, at time zero; `ego_speed` in m/s."""
        # A separate stream: later draws equal those of the world without reflection.
        reflects = self.mirrored == "always" or (
            self.mirrored == "drawn" and rng.spawn(1)[0].random() < 0.5
        )
        world = (MirroredWorld if reflects else World)(traffic, ego_speed)
        if self.mirrored == "drawn":
            world.drawn = {"mirrored": "always" if reflects else "never"}
        return world


class MirroredWorld(World):
    """A world whose bodies stand and move reflected at the x axis, on which the ego drives.

    Bodies keep their shapes: a person still has the right leg in front.
    """

    def add(
        self,
        name: str,
        kind: str | BodyKind,
        pose: Pose | Motion | RoadVehicle,
        *,
        reported: bool = True,
        backdrop: bool = False,
    ) -> Actor:
        """Add a body where `World.add` would put its reflection."""
        reflected = reflect_pose(pose) if isinstance(pose, tuple) else Reflection(pose)
        return super().add(name, kind, reflected, reported=reported, backdrop=backdrop)
