"""Strata of events and object frames (paper, Sec. 3), and thirds of scenes (Sec. 5.2).

The paper stratifies by range and azimuth. Class and `entry` are ours. `entry` is how an object came
within the scored range R, by the place where the film first shows it. On a street that is its first
return or camera pixel. In a recording its box first holds a point there, or without points is first
labelled.

- `emergence`: nearer than R minus `RING_WIDTH_M`, presumably from behind a body;
- `ring`: from there to R, presumably over the edge of the range;
- `beyond`: farther off than R, so that it was shown before it was scored;
- `at start`: no event, since it was present at scene start (`care_sim.evaluation.sightings`).

Entries are of objects: all object frames of an object lie in the stratum of its entry.
"""

from collections.abc import Mapping

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import RANGE_M, Sightings

NEAR_M, FAR_M = 20.0, 35.0
"""Bounds of the range strata. 20 m is the paper's near field (Sec. 5.4); 35 m halves what is left
of the 50 m.
"""
FRONT, REAR = np.pi / 4, 3 * np.pi / 4
"""Bounds of the sectors, radians off straight ahead to either side: a quarter of the turn ahead,
one behind and one on each side, whatever the mounting of the cameras."""
RING_WIDTH_M = 5.0
"""Width of the ring within R, metres: an object that closes at 10 m/s covers 5 m in a keyframe of
0.5 s.
"""
ENTRY = "entry"
ENTRIES = EMERGENCE, RING, BEYOND, AT_START = ("emergence", "ring", "beyond", "at start")
"""The kind of strata by entry, and its strata; see above."""
EMERGING, ENTERING = "emerging", "entering"
NEWCOMERS = {EMERGING: (EMERGENCE,), ENTERING: (RING, BEYOND)}
"""The two kinds of newcomers by their entries: emerging from behind something near, and entering
the range. Every table of first sightings shows them apart.
"""
SCENE_THIRDS = ("sparse", "middle", "dense")


def strata(sightings: Sightings) -> dict[str, dict[str, Mask]]:
    """Return, by `range`, `azimuth`, `class` and `entry`, the label of every stratum and its rows
    (r,) of `sightings.frames`.

    The strata of one kind share no row and leave none out. A bound belongs to the farther stratum,
    and to the one farther from straight ahead.
    """
    frames = sightings.frames
    # Two bounds make three strata. Rows neither near nor far are between, so every row is in
    # exactly one stratum.
    near, far = frames.ranges < NEAR_M, frames.ranges >= FAR_M
    off = np.abs(frames.azimuths)
    front, rear = off < FRONT, off >= REAR
    return {
        "range": {
            f"below {NEAR_M:.0f} m": near,
            f"{NEAR_M:.0f} to {FAR_M:.0f} m": ~near & ~far,
            f"from {FAR_M:.0f} m": far,
        },
        "azimuth": {"front": front, "side": ~front & ~rear, "rear": rear},
        "class": {name: frames.classes == index for index, name in enumerate(CLASSES)},
        ENTRY: _entries(sightings),
    }


def _entries(sightings: Sightings) -> dict[str, Mask]:
    frames = sightings.frames
    first = sightings.first_ranges
    # Objects with an event have entered; all others were present at scene start.
    came = np.isin(frames.objects, frames.objects[sightings.events])
    beyond = first > RANGE_M
    near = first < RANGE_M - RING_WIDTH_M
    masks = (came & near, came & ~near & ~beyond, came & beyond, ~came)
    return dict(zip(ENTRIES, masks, strict=True))


def thirds(counts: Mapping[str, float]) -> dict[str, list[str]]:
    """Rank scenes by one number per scene (tracked objects, explained detections) and cut them in
    three, sparse first.

    The parts differ by at most a scene. Scenes of equal number are in the order of their names.
    """
    # The name decides between equal numbers: the thirds must not depend on the order of the scenes.
    ranked = sorted(counts, key=lambda scene: (counts[scene], scene))
    # Rounded bounds spread the remainder, so that no third is larger than another by two.
    bounds = [
        round(part * len(ranked) / len(SCENE_THIRDS)) for part in range(len(SCENE_THIRDS) + 1)
    ]
    return {
        name: ranked[start:end]
        for name, start, end in zip(SCENE_THIRDS, bounds, bounds[1:], strict=False)
    }
