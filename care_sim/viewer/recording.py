"""A file that the Rerun viewer plays: episodes in lanes, side by side."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import rerun as rr

from care_sim.loop import ClosedLoop
from care_sim.moments import Moment
from care_sim.types import Rig
from care_sim.viewer.curves import Curves
from care_sim.viewer.entities import LANES, about
from care_sim.viewer.lane import Lane
from care_sim.viewer.layout import blueprint
from care_sim.viewer.photo import photograph
from care_sim.viewer.pictures import Pictures
from care_sim.viewer.space import Space


class Recording(AbstractContextManager["Recording"]):
    """Writes `path`; `lanes` are the names of the episodes that will be in it. Raises OSError where it cannot."""

    def __init__(self, path: Path, lanes: Sequence[str]):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        self._lanes = tuple(lanes)
        self._stream = rr.RecordingStream("care-sim")
        self._stream.save(path, default_blueprint=blueprint(self._lanes))
        self._stream.send_recording_name(path.stem)
        self._stream.log("about", rr.TextDocument(about(), media_type=rr.MediaType.MARKDOWN), static=True)

    def episode(self, name: str, loop: ClosedLoop) -> "Episode":
        """Begin the lane `name`, one of those announced."""
        colour = LANES[self._lanes.index(name) % len(LANES)]
        return Episode(Lane(self._stream, name), loop.rig, loop.world.ego_kind.size[1], colour)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file."""
        self._stream.flush()
        self._stream.disconnect()


class Episode:
    """Logs one episode, moment by moment."""

    def __init__(self, lane: Lane, rig: Rig, ego_width_m: float, colour: tuple[int, int, int]):
        self._lane = lane
        self._space, self._pictures = Space(lane, rig, ego_width_m), Pictures(lane, rig)
        self._curves = Curves(lane, rig.budget, colour)
        self._photo = b""

    def look(self, loop: ClosedLoop) -> None:
        """Take the camera's picture of the keyframe that is about to be played."""
        self._photo = photograph(loop)

    def keep(self, moment: Moment) -> None:
        """Log a keyframe that was played."""
        frame = moment.frame
        self._lane.at(frame.index, frame.time_s)
        state = "detected" if frame.detected else "in view" if frame.in_view else "out of view"
        self._space.log(moment, state)
        self._pictures.log(moment, self._photo)
        self._curves.log(moment, state)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log how it ended."""
        self._curves.end(outcome)
