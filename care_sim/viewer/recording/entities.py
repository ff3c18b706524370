"""Entities of a recording: each with its content, unit and frame."""

ABOUT_ENTITY = "about"
"""The page about the recording; every other entity belongs to an episode."""
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
"""Most returns drawn. If there are more, only every second or third is drawn: full scans would fill
9 MB in 6 s.
"""

ENTITIES = {
    "world": "axes: x along the road, y left, z up; metres",
    "world/bodies": "boxes of all actors or annotated objects (truth); world frame",
    "world/first_sighting": "box of the first-sighting actor (truth), coloured by `states/actor`",
    "world/ego": "box of the car; world frame",
    "world/driven": "the way of the car's centre so far, on the ground; world frame",
    "world/lidar": "the sensor frame in the world: x forward, y left, z up; what is below is in it",
    "world/lidar/path": "the strip that the controller guards, as far as it is drawn; sensor frame",
    "world/lidar/returns": f"points, coloured by share, at most {MOST_POINTS}; sensor frame",
    "world/lidar/tracks": "forecasts for this keyframe, faint where the last scan missed them",
    "world/lidar/velocities": "their motion over ground in the next second, m/s; sensor axes",
    "world/lidar/wedges/residual": f"edges of wedges that no forecast explains, {WEDGE_M:.0f} m",
    "world/lidar/wedges/explained": f"edges of wedges that a forecast explains, {WEDGE_M:.0f} m",
    "world/lidar/camera": "the first camera that the policy knows, its picture before any fault",
    "world/lidar/camera/explained": "detections that a forecast explains, as they arrived; pixels",
    "world/lidar/camera/residual": "detections that no forecast explains; pixels",
    "world/lidar/camera/missed": "what the camera without its faults would add; pixels",
    "grid": "the angular grid as the car sees it: left is left, ahead in the middle if all round",
    "grid/cells": (
        f"share of every cell; pixel x = A - 1 - column, y = {ROW_PIXELS} * row (row 0 the "
        "highest); several LiDARs one below the other"
    ),
    "grid/hulls": "outlines of the dilated hulls of forecasts; pixels of `grid/cells`",
    "grid/wedges/residual": "outlines of the dilated wedges of the residual",
    "grid/wedges/explained": "outlines of the dilated wedges of explained detections",
    "measures/speed": "the car's speed at the scan, m/s",
    "measures/distance": "sensor to the centre of the first-sighting actor at the scan, m",
    "measures/clearance": "least distance of its hull to the car's until the next keyframe, m",
    "measures/braking": "1 while the brake is on, else 0",
    "measures/objects": "annotated objects within 50 m",
    "measures/found": "how many of them this scan found",
    "budget/exploitation": "cells fired for exploitation, percent of the budget",
    "budget/reserve": "cells fired for the reserve, percent of the budget",
    "budget/floor": "cells that the random floor filled up, percent of the budget",
    "budget/chosen": "cells that a raw action scored, with no known share, percent of the budget",
    "budget/along": "cells of a window that nothing asked for, percent of the budget",
    "states/actor": "the first-sighting actor: out of view, in view, or detected by this scan",
    "states/brake": "on or off",
    "events": "what changed, or who appears for the first time, in words",
    "outcome": "the result of the episode, as `info` has it at the end",
}
"""Entities of both loops, each below the name of its lane, and their content."""

_CLOSED_LOOP_ALONE = (
    "world/first_sighting",
    "world/lidar/path",
    "measures/speed",
    "measures/distance",
    "measures/clearance",
    "measures/braking",
    "states/actor",
    "states/brake",
)
_OPEN_LOOP_ALONE = ("measures/objects", "measures/found")


def entities_of(open_loop: bool) -> dict[str, str]:
    """The entities that a recording of one of the loops holds."""
    others = _CLOSED_LOOP_ALONE if open_loop else _OPEN_LOOP_ALONE
    return {path: content for path, content in ENTITIES.items() if path not in others}


def about(entities: dict[str, str]) -> str:
    """The entities, as a table in Markdown."""
    rows = "\n".join(f"| `{path}` | {content} |" for path, content in entities.items())
    return (
        "Recorded with CARE-Sim. Metres, seconds, radians; timelines `seconds` (of the scan) and "
        "`keyframe` (from 0).\n"
        "Bodies, pictures, what was missed and the states are truth, which no policy is shown.\n"
        "Actors are coloured by class, grey where perception reports none. Annotated objects are "
        "green where this scan found them, orange where it did not, grey beyond 50 m.\n\n"
        f"| entity | content |\n|---|---|\n{rows}\n"
    )


def _listed(paths: tuple[str, ...]) -> str:
    return ", ".join(f"`{path}`" for path in paths)


__doc__ = (
    f"{__doc__}\n\n{about(ENTITIES)}\n"
    f"The closed loop alone has {_listed(_CLOSED_LOOP_ALONE)}; the open loop alone has "
    f"{_listed(_OPEN_LOOP_ALONE)}.\n"
)
