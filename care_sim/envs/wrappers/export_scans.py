"""Scans as files that other tools read: point clouds, with poses and boxes beside them."""

import errno
import json
from collections.abc import Mapping
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_path
from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_open3d
from care_sim.base.files import replacing, why_unwritable, write_text
from care_sim.core.arrays import Floats
from care_sim.core.firing.actions import SHARES
from care_sim.core.grid import Cells
from care_sim.core.types import CLASSES, Action, Tracks
from care_sim.envs.wrappers.record_rerun import Watching, numbered
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import Watched
from care_sim.policies.base import Policy

_UNITS_NOTE = (
    "Metres, seconds, radians. Boxes: centre x, y, z, length, width, height, yaw. World frame: x "
    "along the road, y left, z up, in the open loop as its source has it. Sensor frame, that of "
    "points and tracks: x forward, y left, z up; sensor_in_world is its origin, then yaw, pitch "
    "and roll, turned about z, then y, then x. Cells: row * columns + column; row 0 is the "
    "highest, column 0 begins at the azimuth heading - field_of_view / 2, straight behind on a "
    "grid that goes all round, and the others follow to the left; pitch raises the heading, roll "
    "lowers its right. Of several LiDARs rows are numbered on from grid to grid, and places tell "
    "where each stands in the sensor frame, which is that of the first. Ego and bodies are truth, "
    "in the world frame."
)
POINT_BYTES = 4 * 3 + 4 + 1
"""Bytes per point of a cloud: three coordinates, cell and share."""


class ExportScans(Watching):
    """Writes every scan of an episode as a point cloud, with what stood around it.

    ### Files
    The first episode goes to the folder `path`, later ones to `NAME-1`, `NAME-2` beside it. Metres,
    seconds, radians; boxes are centre x, y, z, length, width, height, yaw.

    - `000.pcd`, binary: the returns of keyframe 0. Fields are `x y z` (float32, sensor frame: x
      forward, y left, z up), `cell` (int32, row * columns + column) and `share` (uint8, an index
      into the `shares` of `episode.json`).
    - `000.json`: `keyframe` and `time_s`. The truth in the world frame: `sensor_in_world` (x, y, z,
      yaw, pitch, roll), `ego` (box), `bodies` (`name`, `class` or null, `box`). In this frame x is
      along the road, y left, z up; in the open loop it is the source's. In the sensor frame are
      `tracks` (`id`, `class`, `box` of the forecast, `velocity` over ground). Cells that fired are
      in `fired`, each once per shot. The closed loop adds `detected` (the first-sighting actor),
      `braking`, `speed_mps`. In the open loop bodies are the annotated objects, each with `found`
      by this keyframe, `scored` (within range) and `appearing` (its first sighting).
    - `episode.json`: `units`, `grid`, `classes`, `shares`, and `outcome`, null until the end.

    A point is on the middle ray of its cell, at the range that the policy was shown. Points of a
    recording are anywhere in their cells, and the file holds the nearest of each cell.

    ### Arguments
    `path` of the folder, one for every environment of a vector; `policy`, the `care_sim.Policy`
    that acts, as for `RecordRerun`. Raises `care_sim.MissingExtra` without the extra `open3d`.
    Raises `care_sim.InvalidInput` for an environment that is no loop of CARE-Sim and for a folder
    that already holds scans. Raises OSError if the folder cannot be written.

    ### Example
    ```python
    env = gymnasium.make("CARE-Dartout-v0")
    policy = care_sim.make_policy("history", env)
    with ExportScans(env, "scans", policy=policy) as env:
        observation, info = env.reset(seed=0)
        env.step(policy(observation))  # and so on, until terminated or truncated
    ```
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Action],
        path: "str | PathLike[str]",
        policy: Policy | None = None,
    ):
        super().__init__(env, policy)
        check_path("path", path)
        self._open3d: ModuleType = import_open3d()
        self._path = self._folder = Path(path)

    def begin(self, loop: OneWorld | OpenLoop, episode: int) -> None:
        """Make the folder."""
        self._folder = numbered(self._path, episode)
        if any(self._folder.glob("[0-9]*.pcd")):
            raise InvalidInput(f"{self._folder} holds scans already: name another folder")
        self._folder.mkdir(parents=True, exist_ok=True)
        self._describe(None)

    def keep(self, watched: Watched) -> None:
        """Write the two files of a keyframe."""
        stem = f"{watched.record.index:03d}"
        cells, points = watched.returned(self._inner.rig.grid)
        self._write_cloud(
            self._folder / f"{stem}.pcd", points, cells, watched.shares.ravel()[cells]
        )
        write_text(self._folder / f"{stem}.json", json.dumps(described(watched)) + "\n")

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Write the result."""
        self._describe(outcome)

    def _describe(self, outcome: Mapping[str, Any] | None) -> None:
        content = {
            "units": _UNITS_NOTE,
            "grid": asdict(self._inner.rig.grid),
            "classes": CLASSES,
            "shares": SHARES,
            "outcome": outcome,
        }
        write_text(self._folder / "episode.json", json.dumps(content, indent=1) + "\n")

    def _write_cloud(
        self, file: Path, points: Floats, cells: Cells, shares: NDArray[np.uint8]
    ) -> None:
        tensor = self._open3d.core.Tensor
        cloud = self._open3d.t.geometry.PointCloud(tensor(points.astype(np.float32)))
        cloud.point["cell"] = tensor(cells.astype(np.int32)[:, None])
        cloud.point["share"] = tensor(shares.astype(np.uint8)[:, None])
        with replacing(file) as unfinished:
            written = self._open3d.t.io.write_point_cloud(str(unfinished), cloud)
            # Open3D does not report a full disk.
            if not written or unfinished.stat().st_size < len(points) * POINT_BYTES:
                reason = why_unwritable(unfinished) or "the point cloud could not be written"
                raise OSError(errno.EIO, reason, str(file))


def described(watched: Watched) -> dict[str, Any]:
    """Return the surroundings of a scan as plain data; see `ExportScans`."""
    situation, record = watched.situation, watched.record
    sensor = situation.sensor
    told = {
        "keyframe": record.index,
        "time_s": record.time_s,
        "sensor_in_world": [sensor.x, sensor.y, sensor.z, sensor.yaw, sensor.pitch, sensor.roll],
        "ego": situation.ego.tolist(),
        "bodies": _bodies(watched),
        "tracks": _tracks(situation.belief.tracks),
        "fired": watched.fired.tolist(),
    }
    if isinstance(record, Keyframe):
        told |= {name: getattr(record, name) for name in ("detected", "braking", "speed_mps")}
    return told


def _bodies(watched: Watched) -> list[dict[str, Any]]:
    situation, record = watched.situation, watched.record
    classes = [None if label is None else CLASSES[label] for label in situation.labels]
    told = zip(situation.names, classes, situation.bodies, strict=True)
    bodies = [{"name": name, "class": kind, "box": box.tolist()} for name, kind, box in told]
    if isinstance(record, Keyframe):
        return bodies
    states = {name: getattr(record, name).tolist() for name in ("found", "scored", "appearing")}
    return [body | {name: states[name][row] for name in states} for row, body in enumerate(bodies)]


def _tracks(tracks: Tracks) -> list[dict[str, Any]]:
    columns = zip(tracks.ids, tracks.classes, tracks.boxes, tracks.velocities, strict=True)
    return [
        {
            "id": int(number),
            "class": CLASSES[label],
            "box": box.tolist(),
            "velocity": velocity.tolist(),
        }
        for number, label, box, velocity in columns
    ]
