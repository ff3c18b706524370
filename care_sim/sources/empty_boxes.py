"""Boxes of a recording that hold no recorded point: how many there are, and how many newcomers."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.sensors.annotated import Annotations
from care_sim.sources.film_checks import report_once


def tell_empty_boxes(
    name: str, every: Sequence[Annotations], filled: Sequence[Mask], range_m: float
) -> None:
    """Print once how many boxes of a scene hold no recorded point, and how many newcomers there are
    without and with them.

    `every` are all annotations per keyframe, and `filled` (n,) which of them hold a point. Those
    within `range_m` metres count.
    """
    near = [planar_ranges(annotations.boxes) <= range_m for annotations in every]
    objects = [part.objects[own] for part, own in zip(every, near, strict=True)]
    holds = np.concatenate([part[own] for part, own in zip(filled, near, strict=True)])
    if holds.all():
        return
    together = np.concatenate(objects)
    # Objects of the first keyframe were present, with a point or without.
    without, with_them = (
        len(np.setdiff1d(some, objects[0])) for some in (together[holds], together)
    )
    report_once(
        f"{name}: {np.sum(~holds)} of {len(holds)} boxes within {range_m:g} m hold no recorded "
        f"point: {without} newcomers without these boxes, {with_them} with them"
    )
