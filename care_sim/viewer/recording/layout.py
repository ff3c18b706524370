"""The blueprint: which views a recording opens with, and where."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from care_sim.viewer.palette import BACKGROUND
from care_sim.viewer.recording.entities import ABOUT_ENTITY, SECONDS
from care_sim.viewer.recording.lane import entity_path

_EYE_M = (-11.0, 0.0, 6.0)
"""Where the chase view looks from: behind the car and above it, in the sensor frame."""
_TARGET_M = (12.0, 0.0, -1.0)
"""Where it looks to."""
_CLOSED_LOOP = {
    "Who is seen, who brakes": (rrb.StateTimelineView, "states/**"),
    "Speed, m/s": (rrb.TimeSeriesView, "measures/speed"),
    "Clearance, m": (rrb.TimeSeriesView, "measures/clearance"),
}
_OPEN_LOOP = {
    "Objects within 50 m, and found": (rrb.TimeSeriesView, "measures/objects", "measures/found")
}
"""Views of the curves and states, by their titles: their kinds, and what they show of each lane."""
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
