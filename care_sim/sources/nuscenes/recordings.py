"""Folders of nuScenes databases. And which scenes a split holds: the official splits, and those of
`splits.json`.
"""

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_flag, check_known, check_whole
from care_sim.base.digests import Stamp, file_digest, file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.loops.film import Film
from care_sim.sources.film_checks import report_once
from care_sim.sources.nuscenes.cameras import CAMERA_TIMES, OWN
from care_sim.sources.nuscenes.detections import DetectionFile
from care_sim.sources.nuscenes.films import nuscenes_film, sweep_files
from care_sim.sources.nuscenes.table_files import FIELDS, JsonRow, read_json
from care_sim.sources.nuscenes.tables import Database
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class NuScenes(Recordings):
    """A nuScenes v1.0 database: the scenes of a `split`, of a `version` if the folder holds
    several. A scene without recorded sweeps is played on its boxes as bodies.

    The cameras' boxes come from the file `camera_detections`, or else from annotations. A detector
    gets `sweeps` of the LiDAR at a keyframe: its own, and the last of those since the keyframe
    before, under whose mask they were fired (`care_sim.loops.open_loop`). `camera_times` says when
    pictures are taken: each camera at its `own` time, or all at that of the `sweep`. With
    `empty_boxes` also boxes without a recorded point are annotated.
    """

    kind = "nuscenes"
    licence = "CC BY-NC-SA 4.0, not for commercial use"
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
        report_missing(_database(self.folder, self.version), self.split)
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

    def log(self, scene: str) -> str:
        """Return the token of the scene's log, which most scenes share with others."""
        return _logs(_database(self.folder, self.version))[scene]

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
            for row in split_scenes(_database(self.folder, self.version), self.split)
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


@lru_cache(maxsize=1)
def _logs(database: Database) -> dict[str, str]:
    """The log of every scene. Converted tables may lack logs: each scene is then its own."""
    rows = read_json(database.path("scene"))
    return {row["name"]: str(row.get("log_token", row["name"])) for row in rows}


def _detections(path: Path) -> DetectionFile:
    return _read_detections(path, file_stamp(path))


@lru_cache(maxsize=1)
def _read_detections(path: Path, _stamp: Stamp) -> DetectionFile:
    return DetectionFile(path)


# Runs of scene numbers.
_OFFICIAL = {
    "train": """
1-2 4-11 19-34 41-76 120-135 138-139 149-152 154-155 157-168 170-185 187-188 190-196 199-200
202-204 206-214 218-220 222 224-264 283-306 315-318 321 323-324 328 347-386 388-403 405-408
410-459 461-465 467-469 471-472 474-480 499-502 504-515 517-518 525-539 541-546 566 568 570-578
580 582-600 639-679 681 683-689 695-698 700-701 703-719 726-728 730-731 733-741 744 746-747
749-752 757-765 767-769 786-787 789-792 803-806 808-813 815-817 819-822 847-856 858 860-866
868-873 875-878 880 882-903 945 947 949 952-953 955-961 975-984 988-992 994-1025 1044-1058
1074-1102 1104-1110
""",
    "val": """
3 12-18 35-36 38-39 92-110 221 268-278 329-332 344-346 519-524 552-565 625-627 629-630 632-638
770-771 775 777-778 780-784 794-800 802 904-917 919-931 962-963 966-969 971-972 1059-1073
""",
    "mini_train": "61 553 655 757 796 1077 1094 1100",
    "mini_val": "103 916",
}


def _names(runs: str) -> tuple[str, ...]:
    ends = [[int(end) for end in run.split("-")] for run in runs.split()]
    return tuple(f"scene-{number:04}" for run in ends for number in range(run[0], run[-1] + 1))


OFFICIAL = {split: _names(runs) for split, runs in _OFFICIAL.items()}
"""The scenes of the official splits with published boxes (nuScenes devkit, utils/splits.py). The
split `test` has none.
"""


def split_scenes(database: Database, split: str = "val") -> list[JsonRow]:
    """Return the database's scenes of a split: an official one, `all`, or one in
    `<root>/<version>/splits.json`. That file maps names of splits to lists of names of scenes.

    Raises InvalidInput for an unknown split, a scene of `splits.json` that the database lacks, and
    an empty split.
    """
    by_name = {row["name"]: row for row in database.rows("scene").values()}
    # An official split names scenes of which a database may hold a few; a split of its own must be
    # whole, and comes before an official one of the same name.
    held = {name: [one for one in names if one in by_name] for name, names in OFFICIAL.items()}
    known = {"all": sorted(by_name), **held, **_own_splits(database)}
    check_known("split", split, known)
    for name in known[split]:
        if name not in by_name:
            where = _own_file(database)
            table = database.path("scene")
            raise InvalidInput(f"{where}: the split {split!r} names {name!r}, which {table} lacks")
    if not known[split]:
        some = ", ".join(
            name for name, names in known.items() if names and by_name.keys() >= set(names)
        )
        raise InvalidInput(
            f"{database.path('scene')}: holds no scene of the split {split!r}; splits it holds: "
            f"{some or 'none'}"
        )
    return [by_name[name] for name in known[split]]


def report_missing(database: Database, split: str) -> None:
    """Print a line once where the database holds only some scenes of an official split."""
    names = () if split in _own_splits(database) else OFFICIAL.get(split, ())
    held = {row["name"] for row in database.rows("scene").values()}
    if count := len(set(names) - held):
        report_once(
            f"{database.path('scene')}: holds {len(names) - count} of the {len(names)} scenes of "
            f"the split {split}"
        )


def _own_file(database: Database) -> Path:
    return database.folder / "splits.json"


def _own_splits(database: Database) -> dict[str, list[str]]:
    path = _own_file(database)
    splits = read_json(path) if path.exists() else {}
    if not isinstance(splits, dict):
        raise InvalidInput(f"{path}: must map names of splits to lists of names of scenes")
    for split, names in splits.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise InvalidInput(f"{path}: the split {split!r} must be a list of names of scenes")
        if len(set(names)) < len(names):
            raise InvalidInput(f"{path}: the split {split!r} names a scene twice")
    return splits
