"""Folders of recorded drives by a text, such as `argoverse2:FOLDER`: which scenes they hold, and
their films.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

from care_sim.base.checks import check_known, check_path, check_whole
from care_sim.base.digests import Stamp, file_stamp
from care_sim.base.errors import InvalidInput, shown
from care_sim.loops.film import Film
from care_sim.sources.argoverse2 import films as argoverse2
from care_sim.sources.argoverse2.tables import POSE_FILE, annotation_file
from care_sim.sources.nuscenes import films, splits
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.table_files import FIELDS, JsonRow
from care_sim.sources.nuscenes.tables import Database


@dataclass(frozen=True)
class Recordings(ABC):
    """The recorded scenes in a folder. Raises InvalidInput, with file and token, for what cannot be
    read.
    """

    kind: ClassVar[str] = ""
    """What a built-in one is called; one of another package is called by its entry or place."""
    folder: Path

    @abstractmethod
    def scenes(self) -> list[str]:
        """The names of all scenes, in order."""

    @abstractmethod
    def film(self, scene: str) -> Film:
        """The film of a scene by name."""

    def files(self, scene: str) -> list[Path]:
        """Return all files and folders that `film` reads, missing ones included: a play is played
        again after one of them has changed. By default that is the whole folder.
        """
        return [self.folder]


@dataclass(frozen=True)
class Argoverse2(Recordings):
    """Argoverse 2 sensor logs; a scene is a log."""

    kind = "argoverse2"

    def scenes(self) -> list[str]:
        """The names of the log folders."""
        return list(self._logs())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.argoverse2.films.argoverse2_film`."""
        logs = self._logs()
        check_known(f"log in {self.folder}", scene, logs)
        return argoverse2.argoverse2_film(logs[scene])

    def files(self, scene: str) -> list[Path]:
        """Poses and annotations."""
        log = self._logs().get(scene, self.folder / scene)
        try:
            return [log / POSE_FILE, annotation_file(log)]
        except InvalidInput:  # `film` refuses the scene
            return [log / POSE_FILE]

    def _logs(self) -> dict[str, Path]:
        return {log.name: log for log in argoverse2.logs(self.folder)}


@dataclass(frozen=True)
class NuScenes(Recordings):
    """A nuScenes v1.0 database: the scenes of a `split`, of a `version` if the folder holds
    several. The cameras' boxes come from the file `camera_detections`, or else from projected
    annotations. A detector gets `sweeps` of the LiDAR at a keyframe: its own, and the last of those
    since the keyframe before, under whose mask they were fired (`care_sim.loops.held_mask`).
    """

    kind = "nuscenes"
    split: str = "val"
    version: str | None = None
    camera_detections: Path | None = None
    sweeps: int = 1

    def __post_init__(self) -> None:
        check_whole("sweeps", self.sweeps, 1)

    def scenes(self) -> list[str]:
        """The names of the split's scenes."""
        return list(self._rows())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.nuscenes.films.nuscenes_film`."""
        rows = self._rows()
        check_known(f"scene of the split {self.split} in {self.folder}", scene, rows)
        detections = _detections(self.camera_detections) if self.camera_detections else None
        return films.nuscenes_film(
            _database(self.folder, self.version),
            rows[scene],
            detections=detections,
            sweeps=self.sweeps,
        )

    def files(self, scene: str) -> list[Path]:
        """All tables that are read, the sweeps of the scene, and the camera detections."""
        tables, sweeps = _tables(self.folder, self.version), self._sweep_files(scene)
        return [*tables, *sweeps, *filter(None, [self.camera_detections])]

    def _sweep_files(self, scene: str) -> tuple[Path, ...]:
        """Return no file where the tables are damaged. `film` then refuses the scene."""
        try:
            return _sweep_files(_database(self.folder, self.version), scene, self.sweeps)
        except InvalidInput:
            return ()

    def _rows(self) -> dict[str, JsonRow]:
        return {
            row["name"]: row
            for row in splits.scenes(_database(self.folder, self.version), self.split)
        }


RECORDING_KINDS: dict[str, type[Recordings]] = {made.kind: made for made in (Argoverse2, NuScenes)}


def recordings(text: str, options: Mapping[str, object] | None = None) -> Recordings:
    """The recordings that a text `KIND:FOLDER` names, with the `options` of its kind; those that
    are None are not given. Raises InvalidInput for another text, a folder that is none, an option
    that the kind does not have.
    """
    kind, colon, folder = text.partition(":") if isinstance(text, str) else ("", "", "")
    if not (colon and folder) or kind not in RECORDING_KINDS:
        known = ", ".join(f"{name}:FOLDER" for name in RECORDING_KINDS)
        raise InvalidInput(
            f"source must be {known}, or one of your own, MODULE:CLASS, got {shown(text)}"
        )
    return recordings_in(RECORDING_KINDS[kind], kind, folder, options or {})


def recordings_in(
    kind: type[Recordings], name: str, folder: str, options: Mapping[str, object]
) -> Recordings:
    """The recordings of a kind, called by `name`, in a folder, with those of the `options` that are
    not None. Raises InvalidInput for a folder that is none, an option that the kind does not have.
    """
    check_path("source", folder)
    folder = os.path.expanduser(folder)
    if not os.path.isdir(folder):
        raise InvalidInput(f"source {name}:{folder}: {folder} is no folder")
    given = {name: value for name, value in options.items() if value is not None}
    for option in given:
        if option not in {field.name for field in fields(kind)}:
            raise InvalidInput(f"{option} has no meaning for {name} recordings")
    if "camera_detections" in given:
        check_path("camera_detections", given["camera_detections"])
        given["camera_detections"] = Path(os.path.expanduser(str(given["camera_detections"])))
    for option in {"split", "version"} & set(given):
        if not isinstance(given[option], str):
            raise InvalidInput(f"{option} must be a name, got {shown(given[option])}")
    return kind(Path(folder), **given)


# Tables and detections are large and the same for all scenes: the last ones stay read, until one
# of their files changes.
def _database(root: Path, version: str | None) -> Database:
    return _read_database(root, version, tuple(map(file_stamp, _tables(root, version))))


def _tables(root: Path, version: str | None) -> list[Path]:
    database = Database(root, version)
    return [database.path(table) for table in FIELDS]


@lru_cache(maxsize=1)
def _read_database(root: Path, version: str | None, _stamps: tuple[Stamp, ...]) -> Database:
    return Database(root, version)


@lru_cache(maxsize=1000)
def _sweep_files(database: Database, scene: str, sweeps: int) -> tuple[Path, ...]:
    rows = {row["name"]: row for row in database.rows("scene").values()}
    return tuple(films.sweep_files(database, rows[scene], sweeps)) if scene in rows else ()


def _detections(path: Path) -> DetectionFile:
    return _read_detections(path, file_stamp(path))


@lru_cache(maxsize=1)
def _read_detections(path: Path, _stamp: Stamp) -> DetectionFile:
    return DetectionFile(path)
