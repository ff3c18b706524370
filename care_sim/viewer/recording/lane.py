"""A lane of a recording: the entities of one episode, all below its name."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr

from care_sim.core.arrays import Floats
from care_sim.viewer.recording.entities import KEYFRAME, SECONDS

THIN = -1.0
"""Radius of lines; Rerun takes a negative radius as points of the screen."""


def entity_path(lane: str, entity: str) -> str:
    """The path of an entity of an episode; the name of a lane may hold any character."""
    return f"{rr.escape_entity_path_part(lane)}/{entity}"


class Lane:
    """Logs the entities of one episode into a stream, below `name`."""

    def __init__(self, stream: rr.RecordingStream, name: str):
        self._stream = stream
        self.name = name
        self._counts: dict[str, int] = {}

    def at(self, keyframe: int, time_s: float) -> None:
        """Log everything from now on at this keyframe."""
        self._stream.set_time(KEYFRAME, sequence=keyframe)
        self._stream.set_time(SECONDS, duration=time_s)

    def log(self, entity: str, *content: Any) -> None:
        """Log at the present keyframe."""
        self._stream.log(entity_path(self.name, entity), *content)

    def log_list(self, entity: str, count: int, *content: Any) -> None:
        """Log a list of `count` things at the present keyframe."""
        # An empty list is logged once, to clear the view, and then no more.
        if count or self._counts.get(entity) != 0:
            self.log(entity, *content)
        self._counts[entity] = count

    def log_curve(
        self, entity: str, keyframes: Sequence[tuple[int, float]], values: Floats
    ) -> None:
        """Log one number per keyframe, `values` (n,), at once: it costs as much as logging one.
        `keyframes` are their numbers and times in seconds.
        """
        times = (
            rr.TimeColumn(KEYFRAME, sequence=[number for number, _ in keyframes]),
            rr.TimeColumn(SECONDS, duration=[time_s for _, time_s in keyframes]),
        )
        self._stream.send_columns(
            entity_path(self.name, entity), times, rr.Scalars.columns(scalars=values)
        )

    def fix(self, entity: str, *content: Any) -> None:
        """Log something that stays for the whole episode."""
        self._stream.log(entity_path(self.name, entity), *content, static=True)


def box_batch(table: Floats, **appearance: Any) -> rr.Boxes3D:
    """Upright boxes (n, 7) in the frame of their entity."""
    # Quaternions (0, 0, z, w) of a turn about the vertical.
    half = table[:, 6] / 2
    turns = np.column_stack([np.zeros((len(table), 2)), np.sin(half), np.cos(half)])
    return rr.Boxes3D(centers=table[:, :3], sizes=table[:, 3:6], quaternions=turns, **appearance)
