"""A lane of a recording: the entities of one episode, all below its name."""

from typing import Any

import numpy as np
import rerun as rr

from care_sim.frames import Floats
from care_sim.viewer.entities import KEYFRAME, SECONDS

UP = (0.0, 0.0, 1.0)


class Lane:
    """Logs below `name` into a stream."""

    def __init__(self, stream: rr.RecordingStream, name: str):
        self._stream, self.name = stream, name

    def at(self, keyframe: int, time_s: float) -> None:
        """What is logged from now on belongs to this keyframe."""
        self._stream.set_time(KEYFRAME, sequence=keyframe)
        self._stream.set_time(SECONDS, duration=time_s)

    def log(self, entity: str, *content: Any) -> None:
        """Log at the present keyframe."""
        self._stream.log(f"{self.name}/{entity}", *content)

    def fix(self, entity: str, *content: Any) -> None:
        """Log what holds for the whole episode."""
        self._stream.log(f"{self.name}/{entity}", *content, static=True)


def boxes(table: Floats, **looks: Any) -> rr.Boxes3D:
    """Boxes (n, 7), upright, in the frame of their entity."""
    half = table[:, 6] / 2
    turns = np.column_stack([np.zeros((len(table), 2)), np.sin(half), np.cos(half)])
    return rr.Boxes3D(centers=table[:, :3], sizes=table[:, 3:6], quaternions=turns, **looks)
