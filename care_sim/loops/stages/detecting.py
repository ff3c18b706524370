"""The detectors of all worlds.

The paper's proxy (`care_sim.perception.proxy`) detects in compiled code, any other detector world
by world.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, filled
from care_sim.core.rig import Rig
from care_sim.core.types import Scan
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.gathering import Gathering, acted_on
from care_sim.loops.stages.scanning import Returns
from care_sim.loops.stages.state import Reported, State
from care_sim.perception.matching import found_objects
from care_sim.perception.points_only import Detector
from care_sim.perception.proxy import count_hits
from care_sim.sensors.annotated import NO_OBJECT, Annotations, cloud_of, pointless_cloud
from care_sim.world.world import World


class Found(NamedTuple):
    """Detections of W worlds: `counts` (W,), `classes` (W, D), and `boxes` (W, D, 7) in the sensor
    frames. `objects` (W, D) are the bodies behind them or NO_OBJECT. `tracks` (W, D) are the ids
    from the track memory.
    """

    counts: Integers
    classes: Integers
    boxes: Floats
    objects: Integers
    tracks: Integers

    def behind(self, world: int) -> Integers:
        """(n,) the bodies behind the detections of a world."""
        behind: Integers = self.objects[world, : self.counts[world]]
        return behind


class Detecting:
    """The `detectors` (W,); all None for the proxy with its threshold. Returned arrays are reused
    at the next keyframe.
    """

    bodies: list[Integers]
    """(W,) the bodies that a detector other than the proxy found, by the scoring's match."""
    detected: Mask
    """(W,) where the first-sighting actor is detected at the last keyframe."""

    def __init__(self, rigs: Sequence[Rig], detectors: Sequence[Detector | None], min_returns: int):
        worlds = len(detectors)
        self._rigs = rigs
        self._makers = detectors
        self._least = min_returns
        self._ones: list[_OneDetector | None] = [None] * worlds
        self.is_proxy = all(one is None for one in detectors)
        """Whether all detect by the number of returns."""
        self.bodies = [np.empty(0, np.int64)] * worlds
        self.detected = np.zeros(worlds, np.bool_)
        empty = np.empty((worlds, 0), np.int64)
        none = np.zeros(worlds, np.int64)
        self._found = Found(none, empty, np.empty((worlds, 0, 7)), empty, empty)

    def begin(self, world: int, built: World, seeds: SensorSeeds) -> None:
        """Begin an episode."""
        maker = self._makers[world]
        if maker is not None:
            self._ones[world] = _OneDetector(self._rigs[world], maker, built, seeds.detector)

    def detect(self, state: State, returns: Returns, scans: Sequence[Scan | None]) -> Found:
        """The detections in the worlds that are live. `scans` (W,) are those of LiDARs that fire
        world by world.
        """
        found = self._found
        if self.is_proxy:
            shape = state.reported.bodies.shape
            if found.objects.shape != shape:
                room = [np.empty(shape, np.int64) for _ in range(3)]
                found = Found(found.counts, room[0], np.empty((*shape, 7)), *room[1:])
                self._found = found
            hits = state.live, returns.counts, returns.ids
            told = state.egos.targets, self.detected
            _detect(*hits, state.reported, self._least, found, *told)
            return found
        for world in np.flatnonzero(state.live).tolist():
            one = self._ones[world]
            assert one is not None
            count = returns.counts[world]
            scan = scans[world] or Scan(
                returns.cells[world, :count].copy(), returns.ranges[world, :count].copy()
            )
            classes, boxes, behind, self.bodies[world] = one.detect(
                state, world, scan, returns.ids[world, :count]
            )
            self.detected[world] = state.egos.targets[world] in self.bodies[world]
            found.counts[world] = len(classes)
            found = self._found = Found(
                found.counts,
                filled(found.classes, world, classes),
                filled(found.boxes, world, boxes),
                filled(found.objects, world, behind),
                filled(found.tracks, world, behind),
            )
        return found

    def bodies_found(self, found: Found, world: int) -> Integers:
        """(n,) all bodies that are detected in a world."""
        return found.behind(world) if self.is_proxy else self.bodies[world]


class _OneDetector:
    """A detector other than the proxy in one world."""

    def __init__(
        self, rig: Rig, detector: Detector, built: World, seed: np.random.SeedSequence
    ) -> None:
        self._grid = rig.grid
        self._detector = detector.begin(seed, rig, is_filmed=False)
        several = detector.gathers > 1
        self._gathering = Gathering(detector.gathers, rig.keyframe_s) if several else None
        # By number of a body: itself, or NO_OBJECT for what is not reported. The last place is that
        # of NO_BODY, the one before stands for all higher numbers.
        reported = np.array([*built.labels()], np.int64)
        self._named = np.full(int(reported.max(initial=0)) + 3, NO_OBJECT)
        self._named[reported] = reported

    def detect(
        self, state: State, world: int, scan: Scan, bodies: Integers
    ) -> tuple[Integers, Floats, Integers, Integers]:
        """Classes (n,), sensor-frame boxes (n, 7) and the body (n,) behind each detection or
        NO_OBJECT, of the returns of `bodies`; and (k,) all bodies that were found.

        Found bodies are scored by the class-consistent 2 m match (paper, Remark 1). Only bodies
        with returns in a box count. Otherwise a box on the end of a lorry would find a person
        hidden behind it.
        """
        detector, sensor = self._detector, state.sensors.frame(world)
        objects = self._named[np.minimum(bodies, len(self._named) - 2)]
        cloud = (
            cloud_of(scan, objects, self._grid)
            if detector.wants_points
            else pointless_cloud(scan, objects)
        )
        present = _present(state, world)
        if self._gathering is not None:
            cloud = self._gathering.add(cloud, state.taken.frame(world))
        detector.at(None, sensor)
        detections, behind = detector.detect(cloud, present)
        if detector.track_score:
            sure = acted_on(detections, detector.track_score)
            if not sure.all():
                detections, behind = detections.take(sure), behind[sure]
        given = detections.classes, detections.boxes, behind
        if detector.is_matched:
            return *given, behind[behind != NO_OBJECT]
        candidates = present.take((present.objects[:, None] == behind).any(axis=1))
        return *given, candidates.objects[found_objects(candidates, detections)]


def _present(state: State, world: int) -> Annotations:
    """The reported bodies of a world."""
    counts, bodies, classes, boxes, _ = state.reported
    own = world, slice(counts[world])
    return Annotations(bodies[own].copy(), classes[own].copy(), boxes[own].copy())


@compiled(brief=True)
def _detect(
    live: Mask,
    counts: Integers,
    ids: Integers,
    reported: Reported,
    least: int,
    found: Found,
    targets: Integers,
    detected: Mask,
) -> None:
    """Fill `found` with the reported bodies that at least `least` returns hit, and `detected` (W,)
    with whether these bodies hold the target. `ids` (W, F) are the bodies of the returns, `counts`
    (W,) of them in use.
    """
    for w in range(len(live)):
        if not live[w]:
            continue
        known = reported.bodies[w, : reported.counts[w]]
        hits = count_hits(known, ids[w, : counts[w]])
        count, detected[w] = 0, False
        for row in range(len(known)):
            if hits[row] >= least:
                detected[w] |= known[row] == targets[w]
                found.classes[w, count] = reported.classes[w, row]
                found.objects[w, count] = known[row]
                for k in range(7):
                    found.boxes[w, count, k] = reported.boxes[w, row, k]
                count += 1
        found.counts[w] = count
