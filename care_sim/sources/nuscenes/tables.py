"""The JSON tables of a nuScenes v1.0 database. Errors name the file and the token."""

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from care_sim.base.checks import check_whole
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.sources.film_checks import STAMPS_NS, ValueRange, check_span
from care_sim.sources.nuscenes.table_files import (
    JsonRow,
    SampleStore,
    check_tokens,
    finite_numbers,
    table_rows,
)

LIDAR = "LIDAR_TOP"
CAMERA_CHANNELS = (
    "CAM_FRONT",
    "CAM_FRONT_LEFT",
    "CAM_FRONT_RIGHT",
    "CAM_BACK_LEFT",
    "CAM_BACK_RIGHT",
    "CAM_BACK",
)
UNBOUNDED: ValueRange = (float("-inf"), float("inf"))


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
        """The rows of a short table by token. Recordings and annotations are read by sample."""
        if table not in self._tables:
            rows = list(table_rows(self.path(table)))
            check_tokens(self.path(table), [row["token"] for row in rows])
            self._tables[table] = {row["token"]: row for row in rows}
        return self._tables[table]

    def row(self, table: str, token: str) -> JsonRow:
        """The row with a token."""
        rows = self.rows(table)
        if token not in rows:
            raise InvalidInput(f"{self.path(table)}: no row with the token {token!r}")
        return rows[token]

    def numbers(
        self, table: str, row: JsonRow, field: str, *shape: int, within: ValueRange = UNBOUNDED
    ) -> Floats:
        """A field of a row as an array of `shape`, finite numbers in the range `within`."""
        token = row["token"]
        values = finite_numbers(row[field], *shape)
        if values is None:
            wanted = " x ".join(map(str, shape))
            raise InvalidInput(
                f"{self.path(table)}: {token!r} has no {field} of {wanted} finite numbers"
            )
        least, most = within
        beyond = values[(values < least) | (values > most)]
        if beyond.size:
            place = f"must lie in [{least:g}, {most:g}], got {beyond[0]:g}"
            raise InvalidInput(f"{self.path(table)}: {field} of {token!r} {place}")
        return values

    def keyframe_data(self, sample: str) -> dict[str, JsonRow]:
        """The keyframe recordings of a sample by channel."""
        return {
            self.sensor_of(row)["channel"]: row
            for row in self.recordings(sample)
            if row["is_key_frame"]
        }

    def recordings(self, sample: str) -> list[JsonRow]:
        """The recordings of the keyframe of a sample, and all of its LiDAR."""
        return self._store.recordings(sample)

    def sensor_of(self, data: JsonRow) -> JsonRow:
        """The sensor that made a recording."""
        return self.row(
            "sensor", self.row("calibrated_sensor", data["calibrated_sensor_token"])["sensor_token"]
        )

    def pose_of(self, data: JsonRow) -> JsonRow:
        """The pose of the car at a recording of the LiDAR, or at a keyframe's of a camera."""
        token = data["ego_pose_token"]
        pose = self._store.pose(token)
        if pose is None:
            raise InvalidInput(f"{self.path('ego_pose')}: no row with the token {token!r}")
        return pose

    def annotations(self, sample: str) -> Sequence[JsonRow]:
        """The annotated boxes of a sample, one per instance."""
        boxes = self._store.boxes(sample)
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

    @cached_property
    def pictures(self) -> frozenset[str]:
        """The tokens and the file names of all recordings of keyframes."""
        return self._store.pictures()

    @cached_property
    def _store(self) -> SampleStore:
        lidars, cameras = self._calibrated(LIDAR), self._calibrated(*CAMERA_CHANNELS)
        return SampleStore(self.path, list(self.rows("sample")), lidars, cameras)

    def _calibrated(self, *channels: str) -> list[str]:
        """The tokens under which sensors were calibrated."""
        sensors = self.rows("sensor")
        return [
            token
            for token, row in self.rows("calibrated_sensor").items()
            if sensors.get(row["sensor_token"], {}).get("channel") in channels
        ]


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
