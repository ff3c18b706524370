"""Films: the keyframes of a scene that the open loop replays, the same for every policy.

A film is made once, from a generated street, a recorded drive whose boxes become bodies, or
recorded clouds. Nothing in it depends on a policy. It holds truth; policies see of it what
`care_sim.core.belief.Belief` carries.
"""

from dataclasses import dataclass, field

from care_sim.core.arrays import Floats
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import RAYS, FilmedReturns
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Place
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import Ego
from care_sim.sensors.annotated import NO_ANNOTATIONS, Annotations, Cloud, IdentifiedDetections


@dataclass(frozen=True)
class Sweep:
    """One turn of the LiDAR between two keyframes: `time_s` from the start, its own `sensor` frame,
    and its returns in that frame. Nobody annotated it: its points belong to the boxes of the coming
    keyframe in which they lie.
    """

    time_s: float
    sensor: Frame
    cloud: Cloud


@dataclass(frozen=True)
class Shot:
    """One keyframe: `time_s` from the start, `token` by which its source names it, the LiDAR's
    `sensor` frame, the car's own motion, and everything that could be seen. `sweeps` are those
    since the keyframe before, in order of time, where the source serves them.
    """

    time_s: float
    token: str
    sensor: Frame
    ego: Ego
    annotations: Annotations
    seen: IdentifiedDetections
    cloud: Cloud
    sweeps: tuple[Sweep, ...] = ()


@dataclass(frozen=True, eq=False)
class Film:
    """A scene: its name, the cameras of its car, the LiDAR's height above the road, seconds between
    keyframes, and the grid of its clouds. `place` (x, y) is the place of the first LiDAR on the
    car, or the default where a recording lacks it. `returns` are the settings of the returns in its
    clouds.

    `hidden` are the objects that its source annotates at the first keyframe though no return and no
    pixel shows them there. No shot annotates them, so nobody has to find them; they were present
    all the same. `detected` says that a detector made what the cameras have seen: it errs by
    itself. `kerbs` are the road's edges for pictures, lines (n, 2) in the world, where its source
    knows the road.
    """

    name: str
    cameras: tuple[PinholeCamera, ...]
    sensor_height_m: float
    keyframe_s: float
    shots: tuple[Shot, ...]
    hidden: Annotations = NO_ANNOTATIONS
    grid: Grid = field(default_factory=AngularGrid)
    place: tuple[float, float] = LIDAR_POSITION[:2]
    detected: bool = False
    returns: FilmedReturns = RAYS
    kerbs: tuple[Floats, ...] = ()

    @property
    def position(self) -> Place:
        """The LiDAR's x, y and z in the frame of the car, metres."""
        return *self.place, self.sensor_height_m
