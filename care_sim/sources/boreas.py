"""A drive of the Boreas dataset that comes with the package (`shipped/boreas.md` has its licence).

The drive has 95 labelled frames at 4.8 Hz. Another five follow 25 s later. They are left out: their
three keyframes are fewer than the six in which a newcomer may be detected.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.checks import check_known
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.rig import LIDAR_X_M
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sources.box_films import film_of_boxes
from care_sim.sources.recordings import Recordings

BOREAS_FILE = "boreas.npz"
BOREAS_SCENE = "boreas-objects-v1"
BOREAS_CATEGORIES: dict[str, str | None] = {"Car": "car", "Pedestrian": "pedestrian", "Misc": None}
"""The class of every type of label in the drive, None outside the five classes."""
FRAMES_PER_KEYFRAME = 2
"""Keyframes are 0.41 s apart, of what the frames allow the nearest to the paper's 0.5 s."""
LONGEST_PAUSE_S = 1.0
LABEL_YAW = np.radians(-1.25)
"""The labels are turned by this against the LiDAR's poses. Without it cars that stand drift to the
side by 1.2 degrees of our way. The car itself drives along the x axis of its poses, within 0.2
degrees.
"""
LIDAR_ABOVE_ROAD_M = 2.3
"""The bottoms of labelled boxes within 15 m lie so far below the LiDAR (median)."""


@dataclass(frozen=True)
class Boreas(Recordings):
    """A drive of the Boreas dataset that comes with the package (Burnett et al. 2023, CC BY 4.0),
    seen by the set-up `sensor`.
    """

    kind = "boreas"
    licence = "CC BY 4.0"
    shipped = Path(__file__).parent / "shipped"
    sensor: str | SensorSetup = DEFAULT_SETUP

    def __post_init__(self) -> None:
        sensor_setup(self.sensor)

    def scenes(self) -> list[str]:
        """The one drive."""
        return [BOREAS_SCENE]

    def film(self, scene: str) -> Film:
        """The film of the drive, a keyframe every `FRAMES_PER_KEYFRAME` labelled frames."""
        check_known("scene of boreas", scene, self.scenes())
        with np.load(self.folder / BOREAS_FILE) as held:
            drive = dict(held)
        times = (drive["microseconds"] - drive["microseconds"][0]) * 1e-6
        pause = np.argmax(np.diff(times, append=np.inf) > LONGEST_PAUSE_S)
        keyframes = range(0, int(pause) + 1, FRAMES_PER_KEYFRAME)
        return film_of_boxes(
            scene,
            times[keyframes].tolist(),
            [_car(drive["poses"][frame]) for frame in keyframes],
            [_boxes(drive, frame) for frame in keyframes],
            self.sensor,
        )

    def files(self, scene: str) -> list[Path]:
        """The file in the package."""
        return [self.folder / BOREAS_FILE]


def _lidar(pose: Floats) -> Frame:
    """Return the frame of the LiDAR at a pose: easting, northing, altitude, roll, pitch, heading.

    The heading is that of x (ahead) from east, clockwise. The roll raises the right.
    """
    east, north, up, roll, pitch, heading = pose.tolist()
    return Frame(east, north, up, -heading, -roll, pitch)


def _car(pose: Floats) -> list[float]:
    """Return x, y, z, yaw, roll and pitch of the car, whose LiDAR is taken to stand as far before
    its middle as that of the default set-up.
    """
    frame = _lidar(pose).holding(np.array([-LIDAR_X_M, 0.0, -LIDAR_ABOVE_ROAD_M]))
    return [frame.x, frame.y, frame.z, frame.yaw, frame.roll, frame.pitch]


def _boxes(drive: dict[str, Floats], frame: int) -> list[dict[str, object]]:
    """Return the boxes of a frame, in the world, as `film_of_boxes` takes them."""
    rows = np.flatnonzero(drive["frames"] == frame)
    labels = _lidar(drive["poses"][frame]).holding(np.zeros(3), Rotation.from_euler("z", LABEL_YAW))
    world = labels.boxes_to_world(drive["boxes"][rows])
    return [
        {"id": int(number), "class": BOREAS_CATEGORIES[str(label)]}
        | {
            "size": box[3:6].tolist(),
            "pose": [*box[:3], np.arctan2(np.sin(box[6]), np.cos(box[6]))],
        }
        for number, label, box in zip(
            drive["objects"][rows], drive["types"][rows], world, strict=True
        )
    ]
