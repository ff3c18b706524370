"""A file that the Rerun viewer plays: episodes in lanes, side by side."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from care_sim.base.errors import InvalidInput, printable, unknown
from care_sim.base.files import RERUN, replacing
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import Watched
from care_sim.viewer.palette import BACKGROUND, Colour
from care_sim.viewer.recording.entities import ABOUT_ENTITY, SECONDS, about, entities_of
from care_sim.viewer.recording.lane import Lane, entity_path
from care_sim.viewer.recording.measure_log import MeasureLog
from care_sim.viewer.recording.picture_log import PictureLog
from care_sim.viewer.recording.space_log import SpaceLog

_EYE_M = (-11.0, 0.0, 6.0)
"""View point of the chase view: behind and above the car, in the sensor frame."""
_TARGET_M = (12.0, 0.0, -1.0)
"""Target of the chase view."""
_CLOSED_LOOP = {
    "Who is seen, who brakes": (rrb.StateTimelineView, "states/**"),
    "Speed, m/s": (rrb.TimeSeriesView, "measures/speed"),
    "Clearance, m": (rrb.TimeSeriesView, "measures/clearance"),
}
_OPEN_LOOP = {
    "Objects within 50 m, and found": (rrb.TimeSeriesView, "measures/objects", "measures/found")
}
"""Views of the curves and states, by title: kind, and the entities of each lane."""
_GRID_TITLE = (
    "fired: blue exploitation, orange reserve, grey floor, green chosen by a raw action, purple "
    "along in a window"
)


def blueprint(lanes: Sequence[str], open_loop: bool = False) -> rrb.Blueprint:
    """The views of one episode, or of several side by side."""
    curves = [
        view(contents=[entity_path(lane, entity) for lane in lanes for entity in shown], name=title)
        for title, (view, *shown) in (_OPEN_LOOP if open_loop else _CLOSED_LOOP).items()
    ]
    story = _one(lanes[0], curves) if len(lanes) == 1 else _several(lanes, curves)
    time = rrb.TimePanel(state="collapsed", timeline=SECONDS, play_state="playing", loop_mode="all")
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"), time
    return rrb.Blueprint(story, *panels, auto_layout=False, auto_views=False)


def _one(lane: str, curves: Sequence[rrb.View]) -> rrb.Vertical:
    words = rrb.Tabs(
        rrb.TextLogView(
            origin=entity_path(lane, "events"),
            name="What happened",
            columns=rrb.TextLogColumns(text_log_columns=["Body"]),
        ),
        rrb.TextDocumentView(origin=entity_path(lane, "outcome"), name="Outcome"),
        rrb.TextDocumentView(origin=ABOUT_ENTITY, name="About"),
    )
    budget = rrb.TimeSeriesView(origin=entity_path(lane, "budget"), name="Budget, percent")
    side = rrb.Vertical(_camera(lane), words, row_shares=[3, 2])
    below = rrb.Horizontal(*curves, budget)
    return rrb.Vertical(
        rrb.Horizontal(_chase(lane), side, column_shares=[3, 2]),
        _grid(lane),
        below,
        row_shares=[5, 1.7, 2],
    )


def _several(lanes: Sequence[str], curves: Sequence[rrb.View]) -> rrb.Vertical:
    columns = [
        rrb.Vertical(_chase(lane), _camera(lane), _grid(lane), row_shares=[4, 3, 1.3])
        for lane in lanes
    ]
    below = rrb.Horizontal(*curves)
    return rrb.Vertical(rrb.Horizontal(*columns), below, row_shares=[4, 0.5 + 0.4 * len(lanes)])


def _chase(lane: str) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin=entity_path(lane, "world/lidar"),
        contents=[
            f"+ {entity_path(lane, 'world/**')}",
            f"- {entity_path(lane, 'world/lidar/camera/**')}",
        ],
        name=f"{lane}: the street",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=_EYE_M, look_target=_TARGET_M, eye_up=(0, 0, 1)),
    )


def _camera(lane: str) -> rrb.Spatial2DView:
    name = f"{lane}: camera: blue explained, orange residual, red missed by fault"
    return rrb.Spatial2DView(origin=entity_path(lane, "world/lidar/camera"), name=name)


def _grid(lane: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(origin=entity_path(lane, "grid"), name=f"{lane}: {_GRID_TITLE}")


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
    """A recording, which writes `path` when it is closed. `lanes` are the names of its episodes,
    all of the closed loop, or all of the `open_loop`. Until then everything is held in memory: 1 to
    9 MB per episode.

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
            # Rerun's own writer is a thread. A full disk ends the thread, and waiting for it would
            # then never end. So the recording is held in memory, and written here.
            self._memory = self._stream.memory_recording()
            self._stream.send_blueprint(blueprint(self._lanes, open_loop), make_active=False)
        self._file.callback(self._write)
        self._stream.send_recording_name(printable(path.stem))
        page = rr.TextDocument(about(entities_of(open_loop)), media_type=rr.MediaType.MARKDOWN)
        self._stream.log(ABOUT_ENTITY, page, static=True)

    def episode(self, name: str, loop: OneWorld | OpenLoop) -> "RecordedEpisode":
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

    def __init__(self, lane: Lane, loop: OneWorld | OpenLoop, colour: Colour):
        self._lane = lane
        # A film has no driver, so no guarded strip.
        guarded_m = loop.guarded_m if isinstance(loop, OneWorld) else 0.0
        self._space = SpaceLog(lane, loop.rig, guarded_m)
        self._pictures = PictureLog(lane, loop)
        self._curves = MeasureLog(lane, loop.rig.budget, colour, isinstance(loop, OpenLoop))

    def look(self, loop: OneWorld | OpenLoop) -> None:
        """Take the camera's picture of the keyframe that is about to be played."""
        self._pictures.look(loop)

    def keep(self, watched: Watched) -> None:
        """Log a keyframe that was played."""
        self._lane.at(watched.record.index, watched.record.time_s)
        self._space.log(watched)
        self._pictures.log(watched)
        self._curves.log(watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log the result."""
        self._curves.end(outcome)
