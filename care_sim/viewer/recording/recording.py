"""A file that the Rerun viewer plays: episodes in lanes, side by side."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rerun as rr

from care_sim.base.errors import InvalidInput, printable, unknown
from care_sim.base.files import RERUN, replacing
from care_sim.core.rig import Rig
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.film_watcher import WatchedScene
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import WatchedKeyframe
from care_sim.viewer.recording.entities import (
    ABOUT_ENTITY,
    ENTITIES,
    FOUND_RGB,
    LANES,
    NO_CLASS,
    NOT_FOUND_RGB,
    SCENE_ENTITIES,
    about,
)
from care_sim.viewer.recording.found_log import FoundLog
from care_sim.viewer.recording.lane import Lane
from care_sim.viewer.recording.layout import blueprint
from care_sim.viewer.recording.measure_log import MeasureLog
from care_sim.viewer.recording.picture_log import PictureLog, empty_photo, photograph
from care_sim.viewer.recording.space_log import SpaceLog


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
        told = about(SCENE_ENTITIES if open_loop else ENTITIES)
        self._stream.log(
            ABOUT_ENTITY, rr.TextDocument(told, media_type=rr.MediaType.MARKDOWN), static=True
        )

    def episode(self, name: str, loop: ClosedLoop | OpenLoop) -> "RecordedEpisode | RecordedScene":
        """Begin the lane `name`. Raises InvalidInput for a name that is none of `lanes`."""
        if name not in self._lanes:
            raise unknown("lane", name, self._lanes)
        colour = LANES[self._lanes.index(name) % len(LANES)]
        lane = Lane(self._stream, name)
        if isinstance(loop, OpenLoop):
            return RecordedScene(lane, loop.rig, colour)
        return RecordedEpisode(lane, loop.rig, loop.guarded_m, colour)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file. Raises OSError where it cannot be written."""
        self._file.close()

    def _write(self) -> None:
        self._unfinished.write_bytes(self._memory.drain_as_bytes())
        self._stream.disconnect()


class RecordedEpisode:
    """Logs one episode, keyframe by keyframe."""

    def __init__(self, lane: Lane, rig: Rig, guarded_m: float, colour: tuple[int, int, int]):
        self._lane = lane
        self._space = SpaceLog(lane, rig, guarded_m)
        self._pictures = PictureLog(lane, rig)
        self._curves = MeasureLog(lane, rig.budget, colour)
        self._photo = b""

    def look(self, loop: ClosedLoop) -> None:
        """Take the camera's picture of the keyframe that is about to be played."""
        self._photo = photograph(loop)

    def keep(self, watched: WatchedKeyframe) -> None:
        """Log a keyframe that was played."""
        frame = watched.record
        self._lane.at(frame.index, frame.time_s)
        state = "detected" if frame.detected else "in view" if frame.in_view else "out of view"
        self._space.log(watched, state)
        self._pictures.log(watched, self._photo)
        self._curves.log(watched, state)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log how it ended."""
        self._curves.end(outcome)


class RecordedScene:
    """Logs one play of the open loop, keyframe by keyframe."""

    def __init__(self, lane: Lane, rig: Rig, colour: tuple[int, int, int]):
        self._lane = lane
        self._space = SpaceLog(lane, rig, guarded_m=0.0)
        self._pictures = PictureLog(lane, rig)
        self._pictures.fix_photo(empty_photo(rig.cameras[0]))
        self._curves = FoundLog(lane, rig.budget, colour)

    def look(self, _loop: OpenLoop) -> None:
        """Nothing: a film keeps no pictures."""

    def keep(self, watched: WatchedScene) -> None:
        """Log a keyframe that was played."""
        record = watched.record
        self._lane.at(record.index, record.time_s)
        colours = [
            FOUND_RGB if found else NOT_FOUND_RGB if scored else NO_CLASS
            for found, scored in zip(record.found, record.scored, strict=True)
        ]
        self._space.log(watched, "", colours)
        self._pictures.log(watched)
        self._curves.log(watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log how it ended."""
        self._curves.end(outcome)
