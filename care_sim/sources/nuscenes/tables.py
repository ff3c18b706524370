"""The JSON tables of a nuScenes v1.0 database; a token that points nowhere is named with its file."""

import json
from collections import defaultdict
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from care_sim.errors import InvalidInput

Row = dict[str, Any]

FIELDS = {
    "scene": ("name", "first_sample_token"),
    "sample": ("timestamp", "next"),
    "sample_data": ("sample_token", "ego_pose_token", "calibrated_sensor_token", "filename", "is_key_frame"),
    "calibrated_sensor": ("sensor_token", "translation", "rotation", "camera_intrinsic"),
    "sensor": ("channel", "modality"),
    "ego_pose": ("translation", "rotation"),
    "sample_annotation": (
        "sample_token", "instance_token", "visibility_token", "translation", "size", "rotation",
        "num_lidar_pts", "num_radar_pts",
    ),
    "instance": ("category_token",),
    "category": ("name",),
    "visibility": ("level",),
}  # fmt: skip
"""What is read of each table, beside its token."""


class Database:
    """The tables of `<root>/<version>`. Without a version, the only folder `v1.0-*` in the root is taken.

    Raises InvalidInput for a missing or truncated table, a row without a field, a token that points nowhere.
    """

    def __init__(self, root: Path, version: str | None = None):
        self.root = root
        self.folder = root / version if version else _only_version(root)
        self._tables: dict[str, dict[str, Row]] = {}

    def path(self, table: str) -> Path:
        """The file of a table."""
        return self.folder / f"{table}.json"

    def rows(self, table: str) -> dict[str, Row]:
        """All rows of a table by token."""
        if table not in self._tables:
            self._tables[table] = _indexed(self.path(table), FIELDS[table])
        return self._tables[table]

    def row(self, table: str, token: str) -> Row:
        """The row with a token."""
        rows = self.rows(table)
        if token not in rows:
            raise InvalidInput(f"{self.path(table)}: no row with the token {token!r}")
        return rows[token]

    def keyframe_data(self, sample: str) -> dict[str, Row]:
        """The keyframe recordings of a sample by channel."""
        return {self.sensor_of(row)["channel"]: row for row in self._data_of_samples[sample]}

    def sensor_of(self, data: Row) -> Row:
        """The sensor that made a recording."""
        return self.row("sensor", self.row("calibrated_sensor", data["calibrated_sensor_token"])["sensor_token"])

    def annotations(self, sample: str) -> Sequence[Row]:
        """The annotated boxes of a sample."""
        return self._boxes_of_samples[sample]

    def samples(self, scene: Row) -> list[Row]:
        """The samples of a scene in order of time."""
        found: list[Row] = []
        token = scene["first_sample_token"]
        while token:
            row = self.row("sample", token)
            if found and row["timestamp"] <= found[-1]["timestamp"]:
                raise InvalidInput(f"{self.path('sample')}: {token!r} is no later than the sample before it")
            found.append(row)
            token = row["next"]
        return found

    @cached_property
    def _data_of_samples(self) -> dict[str, list[Row]]:
        keyframes = (row for row in self.rows("sample_data").values() if row["is_key_frame"])
        return _grouped(keyframes)

    @cached_property
    def _boxes_of_samples(self) -> dict[str, list[Row]]:
        return _grouped(self.rows("sample_annotation").values())


def read_json(path: Path) -> Any:
    """The content of a JSON file. Raises InvalidInput for one that is missing or truncated."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def _only_version(root: Path) -> Path:
    versions = sorted(path for path in root.glob("v1.0-*") if path.is_dir())
    if len(versions) != 1:
        found = ", ".join(path.name for path in versions) or "none"
        raise InvalidInput(f"{root}: must hold one folder v1.0-*, or the version must be named; found: {found}")
    return versions[0]


def _indexed(path: Path, fields: Sequence[str]) -> dict[str, Row]:
    rows = read_json(path)
    if not isinstance(rows, list):
        raise InvalidInput(f"{path}: must hold a list of rows")
    for number, row in enumerate(rows):
        for name in ("token", *fields):
            if not isinstance(row, dict) or name not in row:
                token = row.get("token") if isinstance(row, dict) else None
                raise InvalidInput(f"{path}: row {token or number} lacks {name!r}")
    return {row["token"]: row for row in rows}


def _grouped(rows: Any) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["sample_token"]].append(row)
    return groups
