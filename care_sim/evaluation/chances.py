"""The chance that a detector reports each newcomer in its first keyframe, given its returns.

A measured detector (`care_sim.perception.measured`) and the graded proxy detect by chance. The
chance depends only on the returns on an object. It is exact in the object's first keyframe, since
no earlier draw could have moved a cell towards or away from the object. Later it would be biased:
luck lasts, and a lucky object is tracked.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.open_loop import OpenLoop
from care_sim.perception.detectors import GRADED
from care_sim.perception.measured.detector import cell_angles, sweep_weights
from care_sim.perception.measured.recall import FIRST_HIT, recall
from care_sim.perception.measured.tables import MEASURED, measurement
from care_sim.perception.proxy import CURVES, Curves, chance, read_curves
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud

_Rule = Callable[[str, Floats, Floats], Floats]
"""Maps a class, and returns (n,) now and on average per sweep, to chances (n,)."""


class Chances:
    """Meter of the returns on every annotated object, keyframe by keyframe of an open loop."""

    def __init__(
        self, rule: _Rule, weights: Floats, angles: Floats, rig: Rig, counts_all: bool = False
    ):
        self._rule, self._counts_all = rule, counts_all
        self._weights, self._angles = weights, angles
        self._heads = [head.first for head in rig.grid.heads]
        self._counts: list[dict[int, float]] = []
        self._noted: list[tuple[Integers, Floats, Floats]] = []

    @classmethod
    def of(cls, detector: str, parameters: Mapping[str, Any], rig: Rig) -> "Chances | None":
        """Return the meter of a detector, None if its chances are unknown."""
        alike = np.ones(len(rig.grid.heads))
        if detector == GRADED:
            file = parameters.get("file")
            curves = CURVES if file is None else read_curves(file)
            # The graded proxy counts the returns of all sweeps.
            return cls(partial(_graded, curves), np.ones(1), alike, rig, counts_all=True)
        if detector not in MEASURED:
            return None
        first_hit = parameters.get("first_hit", FIRST_HIT)
        weights = sweep_weights(measurement(detector), first_hit, rig.keyframe_s, is_filmed=True)
        angles = alike if parameters.get("worth") else cell_angles(rig)
        return cls(measured_rule(detector, parameters), weights, angles, rig)

    def note(self, loop: OpenLoop) -> None:
        """Note the keyframe that was just played."""
        annotations = loop.film.shots[loop.index - 1].annotations
        now = self._returns(loop.handed, annotations)
        if not self._counts_all:
            now = now / max(len(loop.handed.poses), 1)
        self._counts.insert(0, dict(zip(annotations.objects.tolist(), now.tolist(), strict=True)))
        del self._counts[len(self._weights) :]
        # The first keyframes have the total weight of all later ones.
        known = self._weights[: len(self._counts)]
        earlier = [
            [counts.get(each, 0.0) for counts in self._counts]
            for each in annotations.objects.tolist()
        ]
        # Gathered sweeps are averaged already.
        is_averaged = bool(loop.handed.poses) or not known.any()
        average: Floats = np.array(earlier).reshape(-1, len(known)) @ known
        average = now if is_averaged else average / known.sum()
        self._noted.append((annotations.classes, now, average))

    def of_events(self, sightings: Sightings) -> Floats:
        """Return the chances (e,) of `sightings.events`, once all keyframes are noted."""
        rows = np.flatnonzero(sightings.in_range)[sightings.events]
        classes, now, average = (
            np.concatenate(part)[rows] for part in zip(*self._noted, strict=True)
        )
        chances = np.zeros(len(rows))
        for label, name in enumerate(CLASSES):
            own = classes == label
            chances[own] = self._rule(name, now[own], average[own])
        return chances

    def _returns(self, cloud: Cloud, annotations: Annotations) -> Floats:
        """Return the number of returns (n,) on each object, in cells of the default grid."""
        order = np.argsort(annotations.objects)
        ascending = annotations.objects[order]
        places = np.searchsorted(ascending, cloud.objects)
        # Returns of objects beyond the last one find a number that no return has.
        own = np.append(ascending, NO_OBJECT - 1)[places] == cloud.objects
        heads = np.searchsorted(self._heads, cloud.cells[own], side="right") - 1
        places = order[places[own]]
        return np.asarray(np.bincount(places, self._angles[heads], len(annotations)), float)


def _graded(curves: Curves, name: str, now: Floats, _average: Floats) -> Floats:
    """Return the chances of the graded proxy."""
    return chance(name, now.astype(np.int64), curves)


def measured_rule(detector: str, parameters: Mapping[str, Any]) -> _Rule:
    """Return the rule of a measured detector: chances (n,) from a class, and the returns (n,) in
    this keyframe and on average per sweep.
    """
    table = measurement(detector).recall
    worth = np.full(len(CLASSES), parameters.get("worth") or np.nan)
    worth = np.where(np.isnan(worth), table.worth, worth)

    def rule(name: str, now: Floats, average: Floats) -> Floats:
        label = CLASSES.index(name)
        if not table.known[label]:
            return np.zeros(len(now))
        least = parameters.get("track_score")
        given = now * worth[label], average * worth[label]
        return recall(detector, name, *given, least, first_hit=0.0)

    return rule
