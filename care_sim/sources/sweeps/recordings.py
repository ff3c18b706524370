"""Folders of logs without labels."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.perception.detectors import CLUSTER
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.sources.film_checks import FULL_TURN
from care_sim.sources.recordings import Recordings
from care_sim.sources.sweeps.bags import BAG_SUFFIXES, is_bag, log_of_bag
from care_sim.sources.sweeps.films import BOXES_FILE, film_of_log
from care_sim.sources.sweeps.logs import Log
from care_sim.sources.sweeps.points import READERS, read_sweep
from care_sim.sources.sweeps.reference import check_reference
from care_sim.sources.sweeps.tables import columns_of, in_seconds, read_csv

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
      (`care_sim.sources.sweeps.films`); beside `drive.mcap` it is `drive.camera_boxes.json`.
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


SWEEPS_FOLDER, POSES_FILE, TIMES_FILE = "sweeps", "poses.csv", "times.csv"
_TURN = ("qx", "qy", "qz", "qw")
_LEAST_NAME = 1e9
"""A whole number below this may be the number of a sweep, and is no time."""


def log_of_folder(folder: Path) -> Log:
    """Return the log in a folder: `sweeps/`, files of one kind, `poses.csv`, and `times.csv` where
    the names of the sweeps are not their times.

    Raises InvalidInput for what is missing or ambiguous.
    """
    sweeps = _sweep_files(folder / SWEEPS_FOLDER)
    times = _times(folder, sweeps)
    order = np.argsort(times, kind="stable")
    files = [sweeps[row] for row in order.tolist()]
    path = folder / POSES_FILE
    return Log(
        folder.name,
        str(folder / SWEEPS_FOLDER),
        times[order],
        lambda number: read_sweep(files[number]),
        _poses(path),
        str(path),
    )


def _sweep_files(folder: Path) -> list[Path]:
    found = sorted(path for path in folder.glob("*") if path.suffix in READERS)
    kinds = sorted({path.suffix for path in found})
    if len(kinds) != 1:
        raise InvalidInput(
            f"{folder}: sweeps must be files of one kind, {', '.join(READERS)}, got "
            f"{' and '.join(kinds) or 'none'}"
        )
    return found


def _times(folder: Path, sweeps: list[Path]) -> Floats:
    """Return (n,) the seconds of the sweeps, by `times.csv`, else by their names."""
    path = folder / TIMES_FILE
    if path.exists():
        table = read_csv(path)
        times = in_seconds(columns_of(path, table, ["time"])[:, 0])
        names = map(str, table["file"].to_pylist() if "file" in table.column_names else ())
        told = dict(zip(names, times.tolist(), strict=False))
        for sweep in sweeps:
            if sweep.name not in told:
                raise InvalidInput(f"{path}: no row of columns file and time for {sweep.name}")
        return np.array([told[sweep.name] for sweep in sweeps])
    for sweep in sweeps:
        whole, point, part = sweep.stem.partition(".")
        is_time = whole.isdecimal() and (part.isdecimal() if point else True)
        if not is_time or not (point or float(whole[:40]) >= _LEAST_NAME):
            raise InvalidInput(
                f"{sweep}: its name is no time: nano-, micro- or milliseconds since 1970, or "
                f"seconds with a decimal point; write {TIMES_FILE} with the columns file and time"
            )
    return in_seconds(np.array([float(sweep.stem[:40]) for sweep in sweeps]))


def _poses(path: Path) -> Floats:
    """Return (m, 8) seconds, x, y, z and quaternion x, y, z, w of the car."""
    if not path.is_file():
        raise InvalidInput(
            f"{path}: no such file; it holds the poses of the car, columns time, x, y, z (metres) "
            "and yaw (radians) or qx, qy, qz, qw; a single row where the car stands"
        )
    table = read_csv(path)
    place = columns_of(path, table, ("time", "x", "y", "z"))
    if "yaw" in table.column_names:
        (yaws,) = columns_of(path, table, ["yaw"]).T
        wrong = ~(np.abs(yaws) <= FULL_TURN)
        if wrong.any():
            got = shown(float(yaws[wrong.argmax()]))
            raise InvalidInput(f"{path}: yaw must be radians within a full turn, got {got}")
        turns = Rotation.from_euler("Z", yaws[:, None]).as_quat()
    else:
        turns = columns_of(path, table, _TURN)
    return np.column_stack([in_seconds(place[:, 0]), place[:, 1:], turns])
