"""Folders of nuScenes databases."""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_flag, check_known, check_whole
from care_sim.base.digests import Stamp, file_digest, file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.loops.film import Film
from care_sim.sources.nuscenes import splits
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.films import nuscenes_film, sweep_files
from care_sim.sources.nuscenes.pictures import CAMERA_TIMES, OWN
from care_sim.sources.nuscenes.table_files import FIELDS, JsonRow
from care_sim.sources.nuscenes.tables import Database
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class NuScenes(Recordings):
    """A nuScenes v1.0 database: the scenes of a `split`, of a `version` if the folder holds
    several. A scene without recorded sweeps is played on its boxes as bodies.

    The cameras' boxes come from the file `camera_detections`, or else from annotations. A detector
    gets `sweeps` of the LiDAR at a keyframe: its own, and the last of those since the keyframe
    before, under whose mask they were fired (`care_sim.loops.held_mask`). `camera_times` says when
    pictures are taken: each camera at its `own` time, or all at that of the `sweep`. With
    `empty_boxes` also boxes without a recorded point are annotated.
    """

    kind = "nuscenes"
    split: str = "val"
    version: str | None = None
    camera_detections: Path | None = None
    sweeps: int = 1
    camera_times: str = OWN
    empty_boxes: bool = False

    def __post_init__(self) -> None:
        check_whole("sweeps", self.sweeps, 1)
        check_known("camera_times", self.camera_times, CAMERA_TIMES)
        check_flag("empty_boxes", self.empty_boxes)

    def scenes(self) -> list[str]:
        """The names of the split's scenes. Prints a line where an official one is held in part."""
        names = list(self._rows())
        splits.tell_missing(_database(self.folder, self.version), self.split)
        return names

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.nuscenes.films.nuscenes_film`."""
        rows = self._rows()
        check_known(f"scene of the split {self.split} in {self.folder}", scene, rows)
        detections = _detections(self.camera_detections) if self.camera_detections else None
        return nuscenes_film(
            _database(self.folder, self.version),
            rows[scene],
            detections=detections,
            sweeps=self.sweeps,
            camera_times=self.camera_times,
            empty_boxes=self.empty_boxes,
        )

    def files(self, scene: str) -> list[Path]:
        """All tables that are read, the sweeps of the scene, and the camera detections."""
        tables, sweeps = _tables(self.folder, self.version), self._sweep_files(scene)
        return [*tables, *sweeps, *filter(None, [self.camera_detections])]

    def columns(self) -> dict[str, Any]:
        """The hash of the camera detections where there are some, and each option that is not at
        its default.
        """
        told: dict[str, Any] = {}
        if self.camera_detections:
            told["camera_detections"] = file_digest(self.camera_detections)
        if self.sweeps > 1:
            told["sweeps"] = self.sweeps
        if self.camera_times != OWN:
            told["camera_times"] = self.camera_times
        if self.empty_boxes:
            told["empty_boxes"] = True
        return told

    def scene_columns(self, scene: str) -> dict[str, Any]:
        """Say that points are those of rays at boxes, where no sweep of the scene is recorded."""
        files = self._sweep_files(scene)
        return {} if any(map(os.path.exists, files)) or not files else {"points": "boxes"}

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
    return tuple(sweep_files(database, rows[scene], sweeps)) if scene in rows else ()


def _detections(path: Path) -> DetectionFile:
    return _read_detections(path, file_stamp(path))


@lru_cache(maxsize=1)
def _read_detections(path: Path, _stamp: Stamp) -> DetectionFile:
    return DetectionFile(path)
