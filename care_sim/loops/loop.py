"""One keyframe of the closed loop in W worlds: fire, detect, track, act, let them move, look.

Every stage (`care_sim.loops.stages`) is compiled code over all worlds. Where a condition needs
more, that stage goes world by world. `care_sim.loops.one_world` shows the world of a loop of one.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from care_sim.base.threads import ALONE, Threads
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.loops.episode import Episode
from care_sim.loops.observation_limits import Limits
from care_sim.loops.records import Records, Sight
from care_sim.loops.stages.detecting import Detecting
from care_sim.loops.stages.driving import Driving
from care_sim.loops.stages.judging import Judging
from care_sim.loops.stages.locating import Locating
from care_sim.loops.stages.motion import Motion, steps_of
from care_sim.loops.stages.observing import Observations, Observing, room_for_observations
from care_sim.loops.stages.scanning import Scanning
from care_sim.loops.stages.sight import Seeing
from care_sim.loops.stages.state import Fired, State, load, seen_by
from care_sim.loops.stages.tracking import Tracking
from care_sim.loops.truth import Told, told_by
from care_sim.perception.found import Found
from care_sim.perception.points_only import Detector
from care_sim.world.approach import Impact
from care_sim.world.bullet import NO_BODY
from care_sim.world.world import World


class Loop:
    """W worlds, their sensors and the software of their cars, over episodes of up to `duration_s`
    seconds. The `rigs` (W,) differ at most in their budgets, the `conditions` (W,) in those of
    their cameras. Without `detectors` (W,), or where all are None, the paper's proxy detects what
    enough rays hit.

    Clearances of `exact_below_m` or more are bounds, as of `Motion.advance`; `motion.settle`
    returns the least of an episode. Scans and pictures are made on `threads`.
    """

    observed: Observations
    """Observations of the coming keyframe, arrays with a row per world."""
    fired: Fired
    """Cells fired at the last keyframe."""
    found: Found
    """Detections of the last keyframe."""
    impacts: Mapping[int, Impact]
    """The first impact after the last keyframe, by world."""
    sights: Mapping[int, tuple[Sight, ...]]
    """Sights of the actors that egos are to meet, at the last keyframe, by world."""

    def __init__(
        self,
        rigs: Sequence[Rig],
        conditions: Sequence[ClosedLoopConditions],
        duration_s: float,
        detectors: Sequence[Detector | None] = (),
        exact_below_m: float = np.inf,
        threads: Threads = ALONE,
    ):
        worlds = len(rigs)
        self.rig = rig = rigs[0]
        self.conditions = common = conditions[0]
        self.observed = room_for_observations(rig, worlds)
        self.state = state = State(worlds)
        limits = Limits(rig)
        self.locating = Locating(rig, common, limits.ego, state)
        self.scanning = Scanning(rig, common, worlds, threads)
        makers = detectors or [None] * worlds
        self._detecting = Detecting(rigs, makers, common.min_returns, threads)
        self._tracking = Tracking(rig.keyframe_s, common.velocity_keyframes)
        self.driving = Driving(rig, common, worlds)
        self._judging = Judging(rig, common, self.driving, worlds)
        self._exact_below_m = exact_below_m
        self.motion = Motion(worlds, steps_of(duration_s, rig.keyframe_s))
        self.sight = Seeing(rig, conditions, threads)
        self.observing = Observing(limits, np.array([each.budget for each in rigs]))
        self._in_view = np.zeros(worlds, np.bool_)
        self._reads_worlds = not (self.scanning.is_compiled and self.sight.is_fast)

    def begin(self, episodes: Mapping[int, Episode]) -> None:
        """Begin episodes, by the number of the world that each is played in."""
        who = np.zeros(self.state.worlds, np.bool_)
        for world, (built, seeds, _, pool) in episodes.items():
            load(self.state, world, built)
            self.locating.begin(world, seeds)
            self.scanning.begin(world, built, seeds.lidar)
            self._detecting.begin(world, built, seeds)
            self.driving.begin(world, built)
            self._judging.begin(world, built, self._detecting.is_proxy)
            self.motion.begin(world, built)
            self.sight.begin(world, built, seeds.camera, pool)
            self.observed["ranges"][world] = 0.0
            who[world] = True
        self._look(who)

    def keyframe(self, fired: Fired, who: Mask) -> Records:
        """Fire the cells in the worlds `who` (W,), act on what came back, and move these worlds on
        to their next keyframe. Records of the other worlds mean nothing.
        """
        # The scan's columns are copied before the worlds move on.
        state = self.state
        state.live[:] = who
        time = state.times.copy()
        speed = state.egos.speeds.copy()
        in_view = self._in_view.copy()
        distance = self._distance_to_target()

        # The scan, the detector and the tracker see the worlds as they were when the cells were
        # chosen.
        self.fired = fired
        returns = self.scanning.scan(state, fired)
        self.found = found = self._detecting.detect(state, returns, self.scanning.scans)
        self._tracking.update(state, found)
        tracks = self._tracking.seen(state, state.driven)
        judged = {world for world in self._judging.worlds if who[world]}
        ahead = self.driving.ahead(state, tracks, judged)
        accelerations, braking = self.driving.command(state, tracks, ahead)
        detected = self._detecting.detected & self._has_target
        built = {world: self.world(world) for world in judged}
        needless, unfounded = self._judging.judge(built, ahead, found, braking, in_view)
        self.sights = self._judging.sights(state, self.shows, self._detecting, found)

        # The commands hold until the next keyframe; then the cameras look and forecasts are due.
        passages = self.motion.advance(
            state, accelerations, self.rig.keyframe_s, self._exact_below_m, self._look_between
        )
        self.impacts = passages.impacts
        state.keyframes[who] += 1
        self._tracking.predict(state)
        self.scanning.image(returns, self.observed["ranges"], who)
        self._look(who)
        return Records(
            time,
            fired.counts.copy(),
            in_view,
            detected,
            braking.copy(),
            speed,
            distance,
            passages.nearest_m.copy(),
            passages.clearance_m.copy(),
            np.where(passages.hit, passages.impact_speed_mps, np.nan),
            needless,
            unfounded,
        )

    def world(self, world: int) -> World:
        """A world as it is at the coming keyframe."""
        return self.motion.current(self.state, world)

    def boxes(self, world: int) -> Floats:
        """(n, 7) of the ego and then every actor of a world, in the world frame. Truth."""
        # Ids count up as bodies are added. Before the ego there is the ground alone.
        bodies = slice(self.state.egos.bodies[world], self.state.bodies.counts[world])
        boxes: Floats = self.state.bodies.boxes[world, bodies]
        return boxes

    def told(self, world: int) -> Told:
        """Return data of a world's last keyframe besides ranges."""
        scan = self.scanning.scans.get(world)
        if scan is None:
            return {}
        fired = self.fired.cells[world, : self.fired.counts[world]]
        return told_by(fired, scan.cells, scan.intensities, scan.times)

    def shows(self, world: int, body: int) -> bool:
        """Whether a camera shows enough of a body of a world for a box. Truth."""
        return self.sight.shows(self.state, world, body)

    def detectable(self, who: Mask) -> Mask:
        """(W,) in which of the worlds `who` `would_detect` holds of the first-sighting actor, if
        perception reports it. Truth: for the reward alone.
        """
        reported = self.state.reported.by_body[np.arange(len(who)), self.state.egos.targets] >= 0
        return self.would_detect(self.state.egos.targets, who & self._has_target & reported)

    def would_detect(self, bodies: Integers, who: Mask) -> Mask:
        """(W,) in which of the worlds `who` a scan of every cell would give the one of the `bodies`
        (W,) there the returns that the proxy needs, whatever the detector. Truth: for rewards
        alone.
        """
        # No cell outside its hull can hit it, so these stand for all.
        state = self.state
        cells = [np.empty(0, np.int64)] * len(who)
        asked = np.flatnonzero(who).tolist()
        boxes = [seen_by(state.sensors, w, state.bodies.boxes[w, bodies[w]][None]) for w in asked]
        for world, hull in zip(asked, self.rig.hulls(np.array(boxes)), strict=True):
            cells[world] = hull
        hits = self.scanning.hits(state, who, bodies, Fired.of(cells))
        enough: Mask = who & (hits >= self.conditions.min_returns)
        return enough

    def _look_between(self, steps: int) -> None:
        """Take the pictures that are due after so many steps of the worlds."""
        due = self.state.live & (self.sight.after_steps == steps)
        if due.any():
            for world in np.flatnonzero(due & ~self.sight.is_fast).tolist():
                self.world(world)
            self.locating.place(self.state, due)
            self.sight.look_between(self.state, due)

    def _look(self, who: Mask) -> None:
        """Take the cameras' pictures and write the observations of the worlds `who`."""
        state = self.state
        state.live[:] = who
        if self._reads_worlds:
            for world in np.flatnonzero(who).tolist():
                self.world(world)
        self.locating.look(state)
        self.arrived, shown = self.sight.look(state)
        targets = state.egos.targets
        self._in_view[who] = (self._has_target & shown[np.arange(state.worlds), targets])[who]
        self.tracks = self._tracking.seen(state, state.taken)
        self.observing.write(state, self.arrived[:2], self.tracks, self.observed)

    @property
    def _has_target(self) -> Mask:
        """(W,) which episodes are about somebody."""
        targets: Mask = self.state.egos.targets != NO_BODY
        return targets

    def _distance_to_target(self) -> Floats:
        """(W,) from the LiDAR to the centre of the first-sighting actor, in the plane."""
        state = self.state
        centres = state.bodies.boxes[np.arange(state.worlds), state.egos.targets, :2]
        away = centres - state.sensors.poses[:, :2]
        return np.where(self._has_target, np.hypot(away[:, 0], away[:, 1]), np.inf)
