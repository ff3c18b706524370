"""What a recording holds: every entity with its content, unit and frame."""

from collections.abc import Mapping

from care_sim.core.types import CLASSES

ABOUT_ENTITY = "about"
"""The page that says what a recording holds; every other entity is one of an episode."""
SECONDS = "seconds"
"""The timeline of the time of the scan."""
KEYFRAME = "keyframe"
"""The timeline of the number of the keyframe, from 0."""

ROW_PIXELS = 2
"""Pixel rows per row of cells in the picture of the grid: a row is about twice as high as a column
is wide.
"""
WEDGE_M = 30.0
"""Length at which a wedge, which has no depth, is drawn."""
MOST_POINTS = 6000
"""Of more returns, only every second or third is drawn: full scans would fill 9 MB in 6 s."""

ENTITIES = {
    "world": "axes: x along the road, y left, z up; metres",
    "world/bodies": (
        "boxes of all actors (truth), coloured by class, grey where perception reports none; "
        "world frame"
    ),
    "world/first_sighting": (
        "box of the first-sighting actor (truth), coloured by `states/actor`; world frame"
    ),
    "world/ego": "box of the car; world frame",
    "world/driven": "the way of the car's centre so far, on the ground; world frame",
    "world/lidar": (
        "the sensor frame in the world: x forward, y left, z up; metres. What is below it is in "
        "this frame"
    ),
    "world/lidar/path": "the strip that the controller guards, as far as it is drawn; sensor frame",
    "world/lidar/returns": (
        f"points, coloured by share; every nth of more than {MOST_POINTS} returns; sensor frame"
    ),
    "world/lidar/tracks": (
        "forecasts for this keyframe, faint when the last scan missed them; sensor frame"
    ),
    "world/lidar/velocities": "their motion over ground in the next second, m/s; sensor axes",
    "world/lidar/wedges/residual": (
        f"edges of the wedges that no forecast explains, {WEDGE_M:.0f} m; sensor frame"
    ),
    "world/lidar/wedges/explained": "the same of those that a forecast explains",
    "world/lidar/camera": (
        "the camera that the policy knows, and its picture before any fault; pixels"
    ),
    "world/lidar/camera/explained": "detections that a forecast explains, as they arrived; pixels",
    "world/lidar/camera/residual": "detections that no forecast explains; pixels",
    "world/lidar/camera/missed": (
        "what the camera without its faults would have given besides; pixels"
    ),
    "grid": (
        "the angular grid as the car sees it: left is left; one that goes all round has ahead in "
        "the middle and behind at both ends"
    ),
    "grid/cells": (
        f"share of every cell; pixel x = A - 1 - column, y = {ROW_PIXELS} * row (row 0 the "
        "highest); several LiDARs one below the other"
    ),
    "grid/hulls": "dilated hulls of the forecasts, as outlines; pixels of `grid/cells`",
    "grid/wedges/residual": "dilated wedges of the residual, as outlines; pixels of `grid/cells`",
    "grid/wedges/explained": (
        "dilated wedges of explained detections, as outlines; pixels of `grid/cells`"
    ),
    "measures/speed": "the car's speed at the scan, m/s",
    "measures/distance": (
        "sensor to the centre of the first-sighting actor at the scan, planar, metres"
    ),
    "measures/clearance": (
        "hull to hull to that actor, at its least until the next keyframe, metres"
    ),
    "measures/braking": "1 while the brake is on, else 0",
    "budget/exploitation": "cells fired for exploitation, percent of the budget",
    "budget/reserve": "cells fired for the reserve, percent of the budget",
    "budget/floor": "cells that the random floor filled up, percent of the budget",
    "budget/chosen": (
        "cells that a raw action scored, whose share is not known, percent of the budget"
    ),
    "budget/along": "cells of a window that nothing asked for, percent of the budget",
    "states/actor": (
        "the first-sighting actor: in or out of view of the unimpaired camera, or detected by "
        "this scan"
    ),
    "states/brake": "on or off",
    "events": "what changed, in words",
    "outcome": "the result of the episode, `care_sim.loops.records.Outcome`",
}
"""Entities of an episode, each below the name of its lane, and what they hold."""

_OF_CARS_THAT_ACT = (
    "world/first_sighting",
    "world/lidar/path",
    "measures/speed",
    "measures/distance",
    "measures/clearance",
    "measures/braking",
    "states/actor",
    "states/brake",
)
SCENE_ENTITIES = {
    **{name: told for name, told in ENTITIES.items() if name not in _OF_CARS_THAT_ACT},
    "world/bodies": (
        "boxes of the annotated objects (truth): green found by this scan, orange not found, grey "
        "beyond 50 m; world frame"
    ),
    "world/lidar/camera": "the first camera that the policy knows; of its picture nothing is kept",
    "measures/objects": "annotated objects within 50 m",
    "measures/found": "how many of them this scan found",
    "events": "who appears for the first time, and whether it was found at once",
    "outcome": "the result of the play, `care_sim.evaluation.recall.SceneOutcome`",
}
"""The same of a play of the open loop."""

BODY_COLOURS = dict(
    zip(
        CLASSES,
        [(88, 142, 212), (196, 154, 92), (206, 112, 178), (146, 190, 92), (240, 200, 70)],
        strict=True,
    )
)
NO_CLASS = (120, 124, 132)
SHARE_COLOURS = (
    (38, 41, 48),
    (80, 200, 255),
    (255, 150, 30),
    (112, 116, 132),
    (170, 225, 110),
    (150, 120, 170),
)
"""Not fired, exploitation, reserve, floor, chosen, along."""
EXPLAINED_RGB = (80, 200, 255)
RESIDUAL_RGB = (255, 150, 30)
MISSED_RGB = (255, 80, 120)
_OUT_OF_VIEW_RGB = (225, 225, 225)
_IN_VIEW_RGB = (255, 170, 40)
_DETECTED_RGB = (80, 230, 110)
EGO_RGB = (200, 204, 212)
COASTING_RGB = (110, 130, 165)
BRAKE_RGB = (255, 80, 70)
PATH_RGB = (46, 54, 68)
ACTOR_COLOURS = {
    "out of view": _OUT_OF_VIEW_RGB,
    "in view": _IN_VIEW_RGB,
    "detected": _DETECTED_RGB,
}
FOUND_RGB = _DETECTED_RGB
NOT_FOUND_RGB = _IN_VIEW_RGB
LANES = (
    (170, 225, 110),
    (230, 120, 200),
    (240, 200, 70),
    (130, 160, 255),
    (255, 120, 90),
    (225, 225, 225),
)
"""Colours of the curves of episodes that are played side by side."""


def about(entities: Mapping[str, str] = ENTITIES) -> str:
    """The entities, as a table in Markdown."""
    return (
        "Recorded with CARE-Sim. Metres, seconds, radians; timelines `seconds` (of the scan) and "
        "`keyframe` (from 0).\n"
        "Bodies, pictures, what was missed and the states are truth, which no policy is shown.\n\n"
        f"{_table(entities)}"
    )


def _table(entities: Mapping[str, str]) -> str:
    rows = "\n".join(f"| `{path}` | {content} |" for path, content in entities.items())
    return f"| entity | content |\n|---|---|\n{rows}\n"


_OTHERWISE = {name: told for name, told in SCENE_ENTITIES.items() if told != ENTITIES.get(name)}
__doc__ = (
    f"{__doc__}\n\n{about()}\n"
    f"Of the open loop {', '.join(f'`{name}`' for name in _OF_CARS_THAT_ACT)} are missing, and "
    f"these hold something else:\n\n{_table(_OTHERWISE)}"
)
