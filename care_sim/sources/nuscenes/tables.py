"""The JSON tables of a nuScenes v1.0 database. Errors name the file and the token."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from care_sim.base.checks import check_whole
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.sources.nuscenes.table_files import DROPPED, JsonRow, indexed_rows, read_json
from care_sim.sources.plausible import STAMPS_NS, ValueRange, check_span

UNBOUNDED: ValueRange = (float("-inf"), float("inf"))

FIELDS: dict[str, dict[str, type]] = {
    "scene": {"name": str, "first_sample_token": str, "last_sample_token": str},
    "sample": {"timestamp": int, "next": str},
    "sample_data": {
        "sample_token": str,
        "ego_pose_token": str,
        "calibrated_sensor_token": str,
        "filename": str,
        "is_key_frame": bool,
    },
    "calibrated_sensor": {
        "sensor_token": str,
        "translation": list,
        "rotation": list,
        "camera_intrinsic": list,
    },
    "sensor": {"channel": str},
    "ego_pose": {"translation": list, "rotation": list},
    "sample_annotation": {
        "sample_token": str,
        "instance_token": str,
        "visibility_token": str,
        "translation": list,
        "size": list,
        "rotation": list,
        "num_lidar_pts": int,
        "num_radar_pts": int,
    },
    "instance": {"category_token": str},
    "category": {"name": str},
    "visibility": {"level": str},
}
"""What is read of each table, beside its token."""


class Database:
    """The tables of `<root>/<version>`. Without a version, the only folder `v1.0-*` in the root is
    taken.

    Raises InvalidInput for a missing or truncated table, a row without a field or with another kind
    of value in it, a token that points nowhere.
    """

    def __init__(self, root: Path, version: str | None = None):
        self.root = root
        self.folder = root / version if version else _only_version(root)
        self._tables: dict[str, dict[str, JsonRow]] = {}

    def path(self, table: str) -> Path:
        """The file of a table."""
        return self.folder / f"{table}.json"

    def rows(self, table: str) -> dict[str, JsonRow]:
        """The rows of a table by token. Of recordings and car poses only those of keyframes are
        kept, about one in six.
        """
        if table not in self._tables:
            self._tables[table] = self._read(table)
        return self._tables[table]

    def row(self, table: str, token: str) -> JsonRow:
        """The row with a token."""
        rows = self.rows(table)
        if token not in rows:
            raise InvalidInput(f"{self.path(table)}: no row with the token {token!r}")
        return rows[token]

    def numbers(
        self, table: str, token: str, field: str, *shape: int, within: ValueRange = UNBOUNDED
    ) -> Floats:
        """A field of finite numbers as an array of `shape`, all in the range `within`."""
        found = self.row(table, token)[field]
        try:
            values = np.array(found)
        except ValueError:
            values = np.empty(0)
        if values.shape != shape or values.dtype.kind not in "if" or not np.isfinite(values).all():
            wanted = " x ".join(map(str, shape))
            raise InvalidInput(
                f"{self.path(table)}: {token!r} has no {field} of {wanted} finite numbers"
            )
        least, most = within
        beyond = values[(values < least) | (values > most)]
        if beyond.size:
            place = f"must lie in [{least:g}, {most:g}], got {beyond[0]:g}"
            raise InvalidInput(f"{self.path(table)}: {field} of {token!r} {place}")
        return values.astype(float)

    def keyframe_data(self, sample: str) -> dict[str, JsonRow]:
        """The keyframe recordings of a sample by channel."""
        return {self.sensor_of(row)["channel"]: row for row in self._data_of_samples[sample]}

    def sensor_of(self, data: JsonRow) -> JsonRow:
        """The sensor that made a recording."""
        return self.row(
            "sensor", self.row("calibrated_sensor", data["calibrated_sensor_token"])["sensor_token"]
        )

    def annotations(self, sample: str) -> Sequence[JsonRow]:
        """The annotated boxes of a sample, one per instance."""
        boxes = self._boxes_of_samples[sample]
        for token, count in Counter(box["instance_token"] for box in boxes).items():
            if count > 1:
                table = self.path("sample_annotation")
                raise InvalidInput(
                    f"{table}: the sample {sample!r} holds the instance {token!r} {count} times"
                )
        return boxes

    def samples(self, scene: JsonRow) -> list[JsonRow]:
        """The samples of a scene in order of time."""
        found: list[JsonRow] = []
        token = scene["first_sample_token"]
        while token or not found:
            row = self.row("sample", token)
            _check_stamp(self.path("sample"), row)
            # Ascending times also rule out a chain of samples that comes back to itself.
            if found and row["timestamp"] <= found[-1]["timestamp"]:
                raise InvalidInput(
                    f"{self.path('sample')}: {token!r} is no later than the sample before it"
                )
            found.append(row)
            token = row["next"]
        if found[-1]["token"] != scene["last_sample_token"]:
            end = found[-1]["token"]
            wanted = scene["last_sample_token"]
            raise InvalidInput(
                f"{self.path('sample')}: {scene['name']} ends with {end!r}, and should with "
                f"{wanted!r}"
            )
        check_span(self.path("sample"), (found[-1]["timestamp"] - found[0]["timestamp"]) * 1e-6)
        return found

    def _read(self, table: str) -> dict[str, JsonRow]:
        """The rows and fields that are needed. Whatever else a table holds is dropped while it is
        parsed, to save memory.
        """
        kinds = {"token": str, **FIELDS[table]}

        def taken(row: JsonRow) -> object:
            return (
                {name: row[name] for name in kinds if name in row}
                if self._is_needed(table, row)
                else DROPPED
            )

        return indexed_rows(self.path(table), read_json(self.path(table), taken), kinds)

    def _is_needed(self, table: str, row: JsonRow) -> bool:
        """Whether a row is kept. A row that lacks the field that decides stays, to be refused with
        its name.
        """
        if table == "sample_data":
            return row.get("is_key_frame") is not False
        if table == "ego_pose" and "token" in row:
            # Poses are recorded for every sweep and picture, and only those of keyframes are
            # needed. The first pose therefore has `sample_data` read, if it was not yet.
            return str(row["token"]) in self._poses_of_keyframes
        return True

    @cached_property
    def _poses_of_keyframes(self) -> frozenset[str]:
        """The pose tokens of the recordings of keyframes."""
        return frozenset(row["ego_pose_token"] for row in self.rows("sample_data").values())

    @cached_property
    def pictures(self) -> frozenset[str]:
        """The tokens and the file names of all recordings of keyframes."""
        return frozenset(
            name
            for token, row in self.rows("sample_data").items()
            for name in (token, row["filename"])
        )

    @cached_property
    def _data_of_samples(self) -> dict[str, list[JsonRow]]:
        return _grouped(self.rows("sample_data").values())

    @cached_property
    def _boxes_of_samples(self) -> dict[str, list[JsonRow]]:
        boxes = self.rows("sample_annotation").values()
        # A box of a sample that there is not would be missed in silence.
        for box in boxes:
            self.row("sample", box["sample_token"])
        return _grouped(boxes)


def _check_stamp(path: Path, sample: JsonRow) -> None:
    least, most = (nanoseconds // 1000 for nanoseconds in STAMPS_NS)
    check_whole(f"{path}: timestamp of {sample['token']!r}", sample["timestamp"], least, most)


def _only_version(root: Path) -> Path:
    versions = sorted(path for path in root.glob("v1.0-*") if path.is_dir())
    if len(versions) != 1:
        found = ", ".join(path.name for path in versions) or "none"
        raise InvalidInput(
            f"{root}: must hold one folder v1.0-*, or the version must be named; found: {found}"
        )
    return versions[0]


def _grouped(rows: Iterable[JsonRow]) -> dict[str, list[JsonRow]]:
    groups: dict[str, list[JsonRow]] = defaultdict(list)
    for row in rows:
        groups[row["sample_token"]].append(row)
    return groups
