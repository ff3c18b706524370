"""Folders of logs without labels."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.perception.detectors import CLUSTER
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.sources.recordings import Recordings
from care_sim.sources.sweeps.bags import BAG_SUFFIXES, is_bag, log_of_bag
from care_sim.sources.sweeps.films import BOXES_FILE, film_of_log
from care_sim.sources.sweeps.folders import POSES_FILE, SWEEPS_FOLDER, TIMES_FILE, log_of_folder
from care_sim.sources.sweeps.reference import check_reference

SETUP_FILE = "sensor.toml"


@dataclass(frozen=True)
class Sweeps(Recordings):
    """LiDAR sweeps and poses of the car that nobody annotated: folders, MCAP files or ROS 2 bags.

    A scene is a bag (`care_sim.sources.sweeps.bags`), or a folder:

    - `sweeps/`: one file per sweep, all PCD, NPY, CSV or BIN
      (`care_sim.sources.sweeps.points.read_sweep`). A name is a time: nanoseconds, microseconds or
      milliseconds since 1970, or seconds with a decimal point. Otherwise `times.csv` has the
      columns file and time.
    - `poses.csv`: the pose of the car (the point on the road below its middle, x ahead, y left,
      z up) in a fixed world: columns time, x, y, z (metres), and yaw (radians) or qx, qy, qz, qw.
      Times are of the same clock as the sweeps'. A single row is a car that stands.
    - `camera_boxes.json`, if any: what a 2D detector reported
      (`care_sim.sources.sweeps.camera_boxes`); beside `drive.mcap` it is `drive.camera_boxes.json`.
      Without it CARE has no residual: it fires as history does.

    The folder is a scene, or its sub-folders and MCAP files are scenes. The option `sensor`, else
    `sensor.toml` in the folder or beside it, is the set-up: rows and reach of the LiDAR, its height
    (`position_m`) and the cameras. The default is `hdl-32e`. Points are in the LiDAR's axes, x
    ahead, y left, z up. Where x is to the right and y ahead, turn them, or give the set-up
    `yaw_deg = -90`; what was learned does not fit that grid.

    Keyframes are 0.5 s apart. The detector `reference` gets all points of a keyframe. What it
    detects and tracks becomes the annotations, and a cluster that appears within range is a first
    sighting, as in the paper's vehicle study (Sec. 5.5). Limitations: a reference is no truth. A
    false cluster that lasts is an event, an object that the full scan misses is none, and a track
    that breaks becomes two objects. Classes are guesses by size.
    """

    kind = "sweeps"
    suffixes = BAG_SUFFIXES
    sensor: Sensor | None = None
    reference: str = CLUSTER
    topics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (isinstance(self.topics, tuple | list) and {*map(type, self.topics)} <= {str}):
            raise InvalidInput(f"topics must be a list of names, got {shown(self.topics)}")
        object.__setattr__(self, "topics", tuple(self.topics))
        check_reference(self.reference)
        sensor_setup(self.setup)

    def scenes(self) -> list[str]:
        """The names of the folders."""
        return list(self._folders())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.sweeps.films.film_of_log`."""
        folders = self._folders()
        check_known(f"scene in {self.folder}", scene, folders)
        place = folders[scene]
        boxes = self._boxes_of(place)
        return film_of_log(
            log_of_bag(place, self.topics) if is_bag(place) else log_of_folder(place),
            sensor_setup(self.setup),
            self.reference,
            boxes if boxes.exists() else None,
        )

    def files(self, scene: str) -> list[Path]:
        """The bag, or the scene's own files."""
        folder = self._folders().get(scene, self.folder / scene)
        if is_bag(folder):
            return [folder, self._boxes_of(folder)]
        sweeps = sorted((folder / SWEEPS_FOLDER).glob("*"))
        return [*sweeps, folder / POSES_FILE, folder / TIMES_FILE, self._boxes_of(folder)]

    @property
    def setup(self) -> str | SensorSetup:
        """The option, else the file in the folder, else the default."""
        # In the folder that is named, or beside it where that is a scene.
        folder = Path(os.path.abspath(self.folder))
        own = [place / SETUP_FILE for place in (folder, folder.parent)]
        usual = next((str(path) for path in own if path.exists()), DEFAULT_SETUP)
        given = self.sensor if self.sensor is not None else usual
        return given if isinstance(given, SensorSetup) else os.fspath(given)

    def columns(self) -> dict[str, Any]:
        """The reference where it is not the usual one, and the topics where they are named."""
        told = {} if self.reference == CLUSTER else {"reference": self.reference}
        return told | ({"topics": " ".join(self.topics)} if self.topics else {})

    @staticmethod
    def _boxes_of(place: Path) -> Path:
        """Return the file of camera boxes: in the folder, or beside a file."""
        return place.with_suffix(f".{BOXES_FILE}") if place.is_file() else place / BOXES_FILE

    def _folders(self) -> dict[str, Path]:
        """Return the folder of every scene."""
        # Absolute, since a scene is called by its folder: `.` has no name.
        folder = Path(os.path.abspath(self.folder))
        for found in ([folder], sorted(folder.glob("*"))):
            scenes = {
                path.name: path for path in found if is_bag(path) or (path / SWEEPS_FOLDER).is_dir()
            }
            if scenes:
                return scenes
        raise InvalidInput(
            f"{folder}: no scene, a bag or a folder with {SWEEPS_FOLDER}/ (one file per sweep) and "
            f"{POSES_FILE} (time, x, y, z, yaw of the car)"
        )
