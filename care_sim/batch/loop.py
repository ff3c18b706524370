"""One keyframe of many worlds: fire, detect, track, act, let the worlds move, look.

The stages are those of `care_sim.loops.closed_loop.ClosedLoop`, each over all worlds at once.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.batch.motion import Motion, steps_of
from care_sim.batch.scanning import Choice, Scanning
from care_sim.batch.sight import Sight
from care_sim.batch.state import BatchState, Fired, load, place_sensors, seen_by_each
from care_sim.batch.tracking import Braking, Tracking
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.loops.episode import Episode
from care_sim.loops.observation_limits import Limits
from care_sim.loops.records import Records
from care_sim.world.approach import Impact
from care_sim.world.bullet import NO_BODY

# Which column of a table tells the camera, by which bounds differ.
_CAMERA, _NO_CAMERA = ImageDetections.CAMERA, -1

Observations = dict[str, NDArray[np.float32]]


class Observing:
    """Writes what the policies are told, within the limits of observations. Of a budget of the
    `budgets` (W,) each is told its share of the cells.
    """

    def __init__(self, rig: Rig, budgets: Integers):
        self._rig = rig
        self._limits = Limits(rig)
        self._shares = (budgets[:, None] / rig.grid.size).astype(np.float32)
        cameras = self._limits.most_by_camera
        self._detection_bounds = self._limits.detections[0], cameras
        self._track_bounds = self._limits.tracks[0], self._limits.tracks[1][None]

    def write(
        self,
        state: BatchState,
        detections: tuple[Integers, Floats],
        tracks: tuple[Integers, Floats],
        observed: Observations,
    ) -> None:
        """Write all but `ranges` of the worlds that play into `observed`. `detections` and
        `tracks` are numbers of rows (W,) and rows (W, n, 9) and (W, n, 13).
        """
        who = state.live
        egos = state.egos
        numbers = np.stack([egos.speeds, egos.yaw_rates, egos.accelerations], axis=1)
        observed["ego"][who] = np.clip(numbers, *self._limits.ego)[who]
        observed["budget"][who] = self._shares[who]
        fits = _put(*detections, *self._detection_bounds, _CAMERA, observed["detections"], who)
        fits &= _put(*tracks, *self._track_bounds, _NO_CAMERA, observed["tracks"], who)
        for world in np.flatnonzero(who & ~fits).tolist():
            self._mend(world, detections, tracks, observed)

    def _mend(
        self,
        world: int,
        detections: tuple[Integers, Floats],
        tracks: tuple[Integers, Floats],
        observed: Observations,
    ) -> None:
        """Write the tables of a world with numbers beyond the limits, or too many rows."""
        rows = (table[world, : counts[world]].copy() for counts, table in (detections, tracks))
        belief = self._limits.belief(
            Ego(),
            ImageDetections.from_checked_rows(next(rows)),
            Tracks.from_checked_rows(next(rows)),
            observed["ranges"][world],
        )
        told = belief.to_observation()
        for name in ("detections", "tracks"):
            observed[name][world] = told[name]


@compiled(brief=True)
def _put(
    counts: Integers,
    rows: Floats,
    least: Floats,
    most: Floats,
    camera: int,
    table: NDArray[np.float32],
    who: Mask,
) -> Mask:
    """Write `rows` (W, n, k) into the `table` (W, m, k) of the worlds `who`, and -1 before what is
    left over; (W,) whether all were between `least` (k,) and `most` (c, k), and no more than m.

    Row by row `most` is that of the number in the column `camera`, or the only one.
    """
    fits = np.ones(len(counts), np.bool_)
    for w in range(len(counts)):
        if not who[w]:
            continue
        count = min(counts[w], table.shape[1])
        fits[w] = count == counts[w]
        for n in range(count):
            bound = int(rows[w, n, camera]) if camera >= 0 else 0
            for k in range(table.shape[2]):
                number = rows[w, n, k]
                table[w, n, k] = number
                if not least[k] <= number <= most[bound, k]:
                    fits[w] = False
        for n in range(count, table.shape[1]):
            for k in range(table.shape[2]):
                table[w, n, k] = 0.0
            table[w, n, 0] = -1.0
    return fits


class BatchLoop:
    """W worlds, their sensors and the software of their cars, over episodes of up to `duration_s`
    seconds. Observations are written into `observed`, arrays with a row per world. The `rigs` (W,)
    differ at most in their budgets, the `conditions` (W,) in those of their cameras.

    Unless `exact`, records tell the clearance as `Motion.advance` does, and `motion.settle`
    tells the least of an episode.
    """

    fired: Fired
    """What was fired at the last keyframe."""
    impacts: Mapping[int, Impact]
    """The first impact after the last keyframe, by world."""

    def __init__(
        self,
        rigs: Sequence[Rig],
        conditions: Sequence[ClosedLoopConditions],
        duration_s: float,
        observed: Observations,
        exact: bool = True,
    ):
        worlds = len(observed["budget"])
        budgets = np.array([each.budget for each in rigs])
        rig, common = rigs[0], conditions[0]
        self.state = BatchState(worlds)
        self._rig = rig
        self._observed = observed
        self._choice = Choice(rig, common, budgets)
        self._scanning = Scanning(rig, common)
        # Its tables are of other sizes than those of what is fired, so that it has its own.
        self._asking = Scanning(rig, common)
        self._tracking = Tracking(rig.keyframe_s, common.velocity_keyframes)
        self._braking = Braking(rig, common, worlds)
        self._exact = exact
        self.motion = Motion(worlds, steps_of(duration_s, rig.keyframe_s))
        self._sight = Sight(rig, conditions)
        self._observing = Observing(rig, budgets)
        self._min_returns = common.min_returns
        self._in_view = np.zeros(worlds, np.bool_)

    def begin(self, episodes: Mapping[int, Episode]) -> None:
        """Begin episodes, by the number of the world that each is played in."""
        who = np.zeros(self.state.worlds, np.bool_)
        for world, episode in episodes.items():
            built = episode.world
            load(self.state, world, built)
            self._choice.begin(world, episode.floor)
            self._braking.begin(world, built.ego_motion.speed, built.has_oncoming)
            self.motion.begin(world, built)
            self._sight.begin(world, built, episode.seeds.camera)
            self._observed["ranges"][world] = 0.0
            who[world] = True
        self._look(who)

    def keyframe(self, scores: NDArray[np.float32], who: Mask) -> Records:
        """Fire what `scores` (W, E, A) demand in the worlds `who` (W,), act on what came back, and
        move these worlds on to their next keyframe. What the records say of the others means
        nothing.
        """
        # What is recorded of the scan is taken before the worlds move on.
        state = self.state
        state.live[:] = who
        time = state.times.copy()
        speed = state.egos.speeds.copy()
        in_view = self._in_view.copy()
        distance = self._distance_to_target()

        self.fired = fired = self._choice.fired(scores, who, state.keyframes)
        returns = self._scanning.scan(state, fired)
        found = self._scanning.found(state, returns)
        self._tracking.update(state, found)
        accelerations, braking = self._braking.command(who, *self._tracking.seen(state), speed)
        in_use = np.arange(found.rows.shape[1]) < found.counts[:, None]
        bodies = np.take_along_axis(state.reported.bodies, np.where(in_use, found.rows, 0), axis=1)
        targeted = ((bodies == state.egos.targets[:, None]) & in_use).any(axis=1)
        detected = targeted & self._has_target

        # The command holds until the next keyframe; then the cameras look and forecasts are due.
        passages = self.motion.advance(state, accelerations, self._rig.keyframe_s, self._exact)
        self.impacts = passages.impacts
        state.keyframes[who] += 1
        self._tracking.predict(state)
        self._scanning.image(fired, returns, self._observed["ranges"], who)
        self._look(who)
        return Records(
            time,
            fired.counts.copy(),
            in_view,
            detected,
            braking.copy(),
            speed,
            distance,
            passages.nearest_m,
            passages.clearance_m,
            np.where(passages.hit, passages.impact_speed_mps, np.nan),
            # The proxy, the only detector here, reports bodies alone.
            np.zeros(state.worlds, np.bool_),
        )

    def detectable(self, who: Mask) -> Mask:
        """(W,) in which of the worlds `who` a scan of every cell would give the first-sighting
        actor the returns that the proxy needs. Truth: for the reward alone.
        """
        # No cell outside its hull can hit it, so these stand for all.
        state = self.state
        rows = np.arange(state.worlds)
        reported = state.reported.by_body[rows, state.egos.targets] >= 0
        asked = np.flatnonzero(who & self._has_target & reported)
        targets = state.egos.targets[asked]
        hulls = self._rig.hulls(
            seen_by_each(state.sensors, asked, state.bodies.boxes[asked, targets])
        )
        most = int(hulls.sizes.max(initial=0))
        cells = np.zeros((state.worlds, most), np.int64)
        counts = np.zeros(state.worlds, np.int64)
        for world, hull in zip(asked.tolist(), hulls, strict=True):
            cells[world, : len(hull)] = hull
            counts[world] = len(hull)
        state.live[:] = False
        state.live[asked] = True
        returns = self._asking.scan(state, Fired(counts, cells))
        in_use = np.arange(most) < counts[:, None]
        hits = ((returns.ids == state.egos.targets[:, None]) & in_use).sum(axis=1)
        result: Mask = state.live & (hits >= self._min_returns)
        return result

    def close(self) -> None:
        """Free what the stages hold."""
        self.motion.close()

    def _look(self, who: Mask) -> None:
        """Take the cameras' pictures and write what the policies of the worlds `who` are told."""
        state = self.state
        state.live[:] = who
        place_sensors(state, self._rig.sensor_position)
        arrived, shown = self._sight.look(state)
        targets = state.egos.targets
        self._in_view[who] = (self._has_target & shown[np.arange(state.worlds), targets])[who]
        self._observing.write(state, arrived, self._tracking.seen(state), self._observed)

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
