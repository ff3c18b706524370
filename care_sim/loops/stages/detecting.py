"""The detectors of all worlds.

The paper's proxy (`care_sim.perception.proxy`) and the measured detectors
(`care_sim.perception.measured`) detect in compiled code, any other detector world by world.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, places
from care_sim.core.rig import Rig
from care_sim.core.rows import copy_row
from care_sim.core.types import Scan
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.gathering import Gathering, acted_on
from care_sim.loops.stages.scanning import Returns
from care_sim.loops.stages.state import Reported, Sensors, State, seen_by
from care_sim.perception.found import Found
from care_sim.perception.matching import found_objects
from care_sim.perception.measured.candidates import SCORE, SEEN, Candidates, X
from care_sim.perception.measured.detector import MeasuredDetector
from care_sim.perception.points_only import Detector
from care_sim.perception.proxy import count_hits
from care_sim.sensors.annotated import NO_OBJECT, Annotations, cloud_of
from care_sim.world.world import World


class Detecting:
    """The `detectors` (W,); all None for the proxy with its threshold, or all measured with equal
    parameters. Returned arrays are reused at the next keyframe.
    """

    bodies: dict[int, Integers]
    """By world, the bodies that a detector of one world found, by the scoring's match."""
    detected: Mask
    """(W,) where the first-sighting actor is detected at the last keyframe."""

    def __init__(
        self,
        rigs: Sequence[Rig],
        detectors: Sequence[Detector | None],
        min_returns: int,
        threads: Threads,
    ):
        worlds = len(detectors)
        self._rigs = rigs
        self._makers = detectors
        self._least = min_returns
        self._ones: dict[int, _OneDetector] = {}
        self.is_proxy = all(one is None for one in detectors)
        """Whether all detect by the number of returns."""
        first, self._measured = detectors[0], None
        # A class with its own `begin` detects by what that returns.
        if isinstance(first, MeasuredDetector) and type(first).begin is MeasuredDetector.begin:
            self._measured = first.worlds(worlds, rigs[0], False, threads)
        self.bodies = {}
        self.detected = np.zeros(worlds, np.bool_)
        self._found = Found.of(worlds)

    def begin(self, world: int, built: World, seeds: SensorSeeds) -> None:
        """Begin an episode."""
        maker = self._makers[world]
        if self._measured is not None:
            self._measured.begin(world, seeds.detector, len(built.labels()))
        elif maker is not None:
            self._ones[world] = _OneDetector(self._rigs[world], maker, built, seeds.detector)

    def detect(self, state: State, returns: Returns, scans: Mapping[int, Scan]) -> Found:
        """The detections in the worlds that are live. `scans` are those of LiDARs that fire world
        by world.
        """
        live, reported, found = state.live, state.reported, self._found
        counts, cells, ranges, ids = returns
        if self._measured is not None:
            candidates = self._measured.advance(live, state.sensors.poses)
            _see(live, state.sensors, candidates)
            given = reported[:4], (counts, cells, ids), (counts, cells, ranges)
            found = self._measured.report(live, *given, found)
        elif self.is_proxy:
            found = found.with_room(reported.bodies.shape[1])
            _detect(live, counts, ids, reported, self._least, found)
        else:
            return self._one_by_one(state, returns, scans)
        self._found = found
        is_used = np.arange(found.objects.shape[1]) < found.counts[:, None]
        self.detected = (is_used & (found.objects == state.egos.targets[:, None])).any(axis=1)
        return found

    def _one_by_one(self, state: State, returns: Returns, scans: Mapping[int, Scan]) -> Found:
        told = {}
        for world in places(state.live):
            own = world, slice(returns.counts[world])
            scan = scans.get(world) or Scan(returns.cells[own].copy(), returns.ranges[own].copy())
            told[world] = self._ones[world].detect(state, world, scan, returns.ids[own])
        most = max((len(classes) for classes, *_ in told.values()), default=0)
        found = self._found = self._found.with_room(most)
        for world, (classes, boxes, behind, bodies) in told.items():
            own = world, slice(len(classes))
            found.counts[world] = len(classes)
            found.classes[own], found.boxes[own], found.objects[own] = classes, boxes, behind
            self.bodies[world] = bodies
            self.detected[world] = state.egos.targets[world] in bodies
        return found

    def bodies_found(self, found: Found, world: int) -> Integers:
        """(n,) all bodies that are detected in a world, and NO_OBJECT for a false box."""
        return self.bodies[world] if world in self._ones else found.behind(world)


class _OneDetector:
    """A detector that detects world by world, in one of them."""

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
        cloud = cloud_of(scan, objects, self._grid)
        present = _present(state, world)
        if self._gathering is not None:
            cloud = self._gathering.add(cloud, state.taken.frame(world))
        detector.at(None, sensor)
        detections, behind = detector.detect(cloud, present)
        if detector.track_score:
            sure = acted_on(detections, detector.track_score)
            if not sure.all():
                detections, behind = detections.take(sure), behind[sure]
        candidates = present.take((present.objects[:, None] == behind).any(axis=1))
        bodies = candidates.objects[found_objects(candidates, detections)]
        return detections.classes, detections.boxes, behind, bodies


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
) -> None:
    """Fill `found` with the reported bodies that at least `least` returns hit. `ids` (W, F) are the
    bodies of the returns, `counts` (W,) of them in use.
    """
    for w in range(len(live)):
        if not live[w]:
            continue
        known = reported.bodies[w, : reported.counts[w]]
        hits = count_hits(known, ids[w, : counts[w]])
        count = 0
        for row in range(len(known)):
            if hits[row] >= least:
                found.classes[w, count] = reported.classes[w, row]
                found.objects[w, count] = known[row]
                copy_row(reported.boxes[w, row], found.boxes[w, count])
                count += 1
        found.counts[w] = count


@compiled(brief=True)
def _see(live: Mask, sensors: Sensors, candidates: Candidates) -> None:
    """Fill in the boxes of candidates in the sensor frames."""
    for w in range(len(live)):
        if live[w]:
            rows = candidates.rows[w, : candidates.counts[w]]
            rows[:, SEEN:] = seen_by(sensors, w, rows[:, X:SCORE])
