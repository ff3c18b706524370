"""A file that the Rerun viewer plays: episodes in lanes, side by side."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rerun as rr

from care_sim.base.errors import InvalidInput, printable, unknown
from care_sim.base.files import RERUN, replacing
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import Watched
from care_sim.viewer.palette import Colour
from care_sim.viewer.recording.entities import ABOUT_ENTITY, about, entities_of
from care_sim.viewer.recording.lane import Lane
from care_sim.viewer.recording.layout import blueprint
from care_sim.viewer.recording.measure_log import MeasureLog
from care_sim.viewer.recording.picture_log import PictureLog
from care_sim.viewer.recording.space_log import SpaceLog

_LANES = (
    (170, 225, 110),
    (230, 120, 200),
    (240, 200, 70),
    (130, 160, 255),
    (255, 120, 90),
    (225, 225, 225),
)
"""Colours of the curves of episodes that are played side by side."""


@contextmanager
def _without_settings() -> Iterator[None]:
    """Hide the environment's settings of Rerun, which may switch a recording off."""
    hidden = {name: os.environ.pop(name) for name in [*os.environ] if name.startswith("RERUN")}
    try:
        yield
    finally:
        os.environ.update(hidden)


class Recording(AbstractContextManager["Recording"]):
    """Writes `path` when it is closed; `lanes` are the names of the episodes that will be in it,
    all of the closed loop, or of the `open_loop`.
    Until then all is held in memory: 1 to 9 MB per episode.

    Raises InvalidInput for a lane with the name of the page `about`, and as
    `care_sim.base.files.replacing` does.
    """

    def __init__(self, path: Path, lanes: Sequence[str], open_loop: bool = False):
        if ABOUT_ENTITY in lanes:
            raise InvalidInput(
                f"{ABOUT_ENTITY!r} is a page of every recording: name the episode otherwise"
            )
        self._lanes = tuple(lanes)
        self._file = ExitStack()
        self._unfinished = self._file.enter_context(replacing(path, RERUN))
        with _without_settings():
            self._stream = rr.RecordingStream("care-sim")
            # Rerun's own writer is a thread. A full disk ends it, and whatever waits for it then
            # waits for ever: so the recording is held in memory, and written here.
            self._memory = self._stream.memory_recording()
            self._stream.send_blueprint(blueprint(self._lanes, open_loop), make_active=False)
        self._file.callback(self._write)
        self._stream.send_recording_name(printable(path.stem))
        page = rr.TextDocument(about(entities_of(open_loop)), media_type=rr.MediaType.MARKDOWN)
        self._stream.log(ABOUT_ENTITY, page, static=True)

    def episode(self, name: str, loop: ClosedLoop | OpenLoop) -> "RecordedEpisode":
        """Begin the lane `name`. Raises InvalidInput for a name that is none of `lanes`."""
        if name not in self._lanes:
            raise unknown("lane", name, self._lanes)
        colour = _LANES[self._lanes.index(name) % len(_LANES)]
        return RecordedEpisode(Lane(self._stream, name), loop, colour)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file. Raises OSError where it cannot be written."""
        self._file.close()

    def _write(self) -> None:
        self._unfinished.write_bytes(self._memory.drain_as_bytes())
        self._stream.disconnect()


class RecordedEpisode:
    """Logs one episode, keyframe by keyframe, of either loop."""

    def __init__(self, lane: Lane, loop: ClosedLoop | OpenLoop, colour: Colour):
        self._lane = lane
        # A film has no driver, who would guard a strip.
        guarded_m = loop.guarded_m if isinstance(loop, ClosedLoop) else 0.0
        self._space = SpaceLog(lane, loop.rig, guarded_m)
        self._pictures = PictureLog(lane, loop)
        self._curves = MeasureLog(lane, loop.rig.budget, colour, isinstance(loop, OpenLoop))

    def look(self, loop: ClosedLoop | OpenLoop) -> None:
        """Take the camera's picture of the keyframe that is about to be played."""
        self._pictures.look(loop)

    def keep(self, watched: Watched) -> None:
        """Log a keyframe that was played."""
        self._lane.at(watched.record.index, watched.record.time_s)
        self._space.log(watched)
        self._pictures.log(watched)
        self._curves.log(watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log how it ended."""
        self._curves.end(outcome)
