"""Strata of events and object frames (paper, Sec. 3), and thirds of scenes (Sec. 5.2)."""

from collections.abc import Mapping

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import ObjectFrames

NEAR_M, FAR_M = 20.0, 35.0
"""Bounds of the range strata. 20 m is the paper's near field (Sec. 5.4); 35 m halves what is left
of the 50 m.
"""
FRONT, REAR = np.pi / 4, 3 * np.pi / 4
"""Bounds of the sectors, radians off straight ahead to either side: a quarter of the turn ahead,
one behind and one on each side, whatever the mounting of the cameras."""
SCENE_THIRDS = ("sparse", "middle", "dense")


def strata(frames: ObjectFrames) -> dict[str, dict[str, Mask]]:
    """By `range`, `azimuth` and `class`: the label of every stratum and the rows (r,) that lie in
    it.

    The strata of one kind share no row and leave none out. A bound belongs to the farther stratum,
    and to the one farther from straight ahead.
    """
    # Two bounds make three strata; what is neither near nor far is the one between, so that no row
    # is in two of them or in none.
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
    }


def thirds(counts: Mapping[str, float]) -> dict[str, list[str]]:
    """Scenes ranked by one number per scene (tracked objects, explained detections), cut in three,
    sparse first.

    The parts differ by a scene at most; scenes of equal number stand in the order of their names.
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
