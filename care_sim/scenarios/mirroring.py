"""Either side of the street: a scenario's world as it was drawn, or reflected at the ego's lane."""

from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import one_of
from care_sim.core.frames import Pose
from care_sim.scenarios.base import Scenario
from care_sim.world.bodies import BodyKind
from care_sim.world.traffic import RoadVehicle, Traffic
from care_sim.world.world import Actor, Motion, World

MIRRORED = ("never", "drawn", "always")


@dataclass(frozen=True)
class MirrorableScenario(Scenario):
    """A scenario whose world may be reflected at the middle of the ego's lane, as in left-hand
    traffic: what stood on the right stands on the left.

    `mirrored="drawn"` reflects the worlds of half of the seeds. A world and its reflection share
    every other draw of the seed.
    """

    mirrored: str = one_of("never", MIRRORED)

    def empty_world(self, traffic: Traffic, ego_speed: float, rng: np.random.Generator) -> World:
        """The world to be filled, at time zero; `ego_speed` in m/s."""
        reflects = self._reflects(rng)
        world = (MirroredWorld if reflects else World)(traffic, ego_speed)
        if self.mirrored == "drawn":
            world.drawn = {"mirrored": "always" if reflects else "never"}
        return world

    def _reflects(self, rng: np.random.Generator) -> bool:
        # A stream of its own: the draws that follow are those of the world that is not reflected.
        return self.mirrored == "always" or (
            self.mirrored == "drawn" and rng.spawn(1)[0].random() < 0.5
        )


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
        reflected = _reflected(pose)
        return super().add(name, kind, reflected, reported=reported, backdrop=backdrop)


@dataclass(frozen=True)
class Reflection:
    """The motion on the other side of the x axis of a function of time, or of a vehicle."""

    of: Motion | RoadVehicle

    def __call__(self, time: float) -> Pose:
        """The pose at `time`."""
        pose = self.of.pose if isinstance(self.of, RoadVehicle) else self.of(time)
        return _on_the_other_side(pose)


def _reflected(pose: Pose | Motion | RoadVehicle) -> Pose | Motion:
    return _on_the_other_side(pose) if isinstance(pose, tuple) else Reflection(pose)


def _on_the_other_side(pose: Pose) -> Pose:
    x, y, heading = pose
    return x, -y, -heading
