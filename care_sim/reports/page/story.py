"""The numbers of a story that a page plays: whole ones, lengths in centimetres and angles in
milliradians, so that an episode takes a few kilobytes. Both loops tell with them what fired and
what the policy knew.
"""

import base64
import json
import zlib
from typing import Any

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.residual import explained
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, ImageDetections

SECTORS = 128
"""Sectors in which fired cells are counted, from azimuth -pi on."""
_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
"""The digits that say how full a sector is, from none of its cells to all of them."""
CENTI = 100
MILLI = 1000
_POSE = (CENTI, CENTI, MILLI)


def packed(story: dict[str, Any]) -> str:
    """Plain data as deflated JSON in base64."""
    return base64.b64encode(
        zlib.compress(json.dumps(story, separators=(",", ":")).encode(), 9)
    ).decode()


def known_before(
    belief: Belief, sensor: Frame, rig: Rig, tracked: dict[int, list[Any]]
) -> dict[str, Any]:
    """Return the policy's knowledge in the world frame. `tracks` have id, place, velocity, and a
    flag for a missed one, drawn from its forecast. `camera` are the lines of sight of the camera's
    boxes. The last class and size of every track go into `tracked`, once for all moments.
    """
    tracks = belief.tracks
    places = sensor.boxes_to_world(tracks.boxes)
    # Tracks move on the ground: their velocities have no vertical part.
    moves = sensor.vectors_to_world(np.column_stack([tracks.velocities, np.zeros(len(tracks))]))
    for track, label, box in zip(tracks.ids.tolist(), tracks.classes, places, strict=True):
        tracked[track] = [CLASSES[label], *whole(box[3:5], CENTI)]
    columns = (
        tracks.ids,
        np.rint(places[:, [0, 1, 6]] * _POSE),
        np.rint(moves[:, :2] * CENTI),
        tracks.misses > 0,
    )
    known = explained(belief.detections, tracks, rig)
    return {
        "tracks": np.column_stack(columns).astype(np.int64).tolist(),
        "camera": sightlines(belief.detections, known, rig),
    }


def fullness(fired: Cells, grid: Grid) -> str:
    """How much of every sector fires, one digit per sector."""
    # A cell that was fired several times is as full as one that was fired once.
    once = np.unique(fired)
    counts, cells = np.zeros((2, SECTORS), np.int64)
    lidars = grid.lidars_of(once)
    for number, head in enumerate(grid.heads):
        own = head.grid
        sectors = np.floor((own.azimuths + np.pi) / (2 * np.pi) * SECTORS).astype(np.int64)
        # Cells are numbered row by row, so that the remainder is the column.
        columns = once[lidars == number] % own.columns
        counts += np.bincount(sectors[columns], minlength=SECTORS)
        cells += np.bincount(sectors, minlength=SECTORS) * own.rows
    cells = np.maximum(cells, 1)
    return "".join(
        _DIGITS[round(digit)] for digit in (counts / cells * (len(_DIGITS) - 1)).tolist()
    )


def sightlines(detections: ImageDetections, known: Mask, rig: Rig) -> list[list[int]]:
    """The left and right azimuth of every camera box in the sensor frame, and 1 where a track
    explains it.
    """
    lines = []
    for number, (left, _, right, _) in enumerate(detections.boxes.tolist()):
        camera = rig.cameras[int(detections.cameras[number])]
        # The azimuths at mid-height. Since an old picture was taken the car has turned; in the
        # sensor frame of now its boxes are turned the other way.
        ends = camera.rays(np.array([[left, camera.height / 2], [right, camera.height / 2]]))
        azimuths = np.arctan2(ends[:, 1], ends[:, 0]) - detections.yaw_changes[number]
        lines.append([*whole(azimuths, MILLI), int(known[number])])
    return lines


def whole_pose(pose: Any) -> list[int]:
    """A place in centimetres and its heading in milliradians."""
    return whole(np.asarray(pose) * _POSE, 1)  # type: ignore[no-any-return]


def whole(values: Any, scale: int) -> Any:
    """Numbers of the scale as whole ones, plain data; of a number one."""
    return np.rint(np.asarray(values, float) * scale).astype(np.int64).tolist()
