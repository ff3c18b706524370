"""Episodes of the vehicle study (paper, Sec. 5.5): their rows, and further notes.

Truth (the object behind a box or a track) is read for the scoring only.
"""

from collections.abc import Sequence
from typing import Any, SupportsInt

import gymnasium
import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.forgetting import (
    VEHICLE_SIGMA_M,
    Forgetting,
    ForgettingRules,
    released_cells,
    uncertainty_margin,
)
from care_sim.core.grid import Cells
from care_sim.core.residual import wedges
from care_sim.core.types import Action
from care_sim.envs.sensing import Observed, sensing
from care_sim.loops.one_world import OneWorld
from care_sim.policies import make_policy
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.mechanism_play import is_covered
from care_sim.study.run_config import Row

ASKED = ("care", "all-camera", "history")
"""The policies that are equal without a camera, by the paper (Sec. 5.5)."""
VEHICLE_LISTS = ("evidence_ages_ms", "dark_entries_alike", "dark_entry_cells", "dark_entry_covered")
VEHICLE_COUNTS = (
    "boxes",
    "turned_boxes",
    "turned_held",
    "unturned_held",
    "dark_keyframes",
    "dark_alike",
    "forecasts",
    "forecasts_in_eq4",
    "forecasts_in_margin",
    "standing_keyframes",
    "released_cells",
    "released_cells_vehicle",
)
VEHICLE_MEASURES = (
    "apart_after_s",
    "forecast_error_m",
    "forecast_error_p95_m",
    "standing_guard_least_m",
    "standing_guard_most_m",
)
"""None if the camera never came back, nothing was forecast, or the car never stood."""


def play_vehicle(batch: Sequence[EpisodeConfig]) -> list[Row | str]:
    """Play episodes in a worker, and return for each its row, or in one line why there is none."""
    return [result_or_reason(vehicle_row, config) for config in batch]


def vehicle_row(config: EpisodeConfig) -> Row:
    """Play an episode; `docs/columns.md` explains the columns of its row."""
    watches: list[VehicleWatch] = []

    def watched(env: GymEnv, _policy: object) -> GymEnv:
        watches.append(VehicleWatch(env))
        return watches[0]

    row, _ = trace(config, wrap=watched)
    return row | watches[0].columns()


class VehicleWatch(gymnasium.Wrapper[Observed, Action, Observed, Action]):
    """Notes every keyframe before it is played, and leaves the episode as it is.

    It also runs Algorithm 3, once as in simulation (sigma_pos 0) and once as on the paper's vehicle
    (0.4 m), and computes the demands of other policies.
    """

    def __init__(self, env: GymEnv):
        super().__init__(env)
        self._inner = sensing(env)

    def reset(self, **given: Any) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode."""
        self._observation, info = self.env.reset(**given)
        self._asked = [make_policy(name, self._inner) for name in ASKED]
        rules = ForgettingRules(), ForgettingRules(position_sigma_m=VEHICLE_SIGMA_M)
        self._forgetting = [Forgetting(each, self._inner.rig) for each in rules]
        self._shown: set[int] = set()
        self._lists: dict[str, list[int]] = {name: [] for name in VEHICLE_LISTS}
        self._counts = dict.fromkeys(VEHICLE_COUNTS, 0)
        self._errors_m: list[float] = []
        self._guards_m: list[float] = []
        self._apart_after_s: float | None = None
        return self._observation, info

    def step(self, action: Action) -> tuple[Observed, Any, bool, bool, dict[str, Any]]:
        """Note the keyframe, then play it."""
        loop = self._inner.loop
        self._note_evidence(loop)
        self._note_forecasts(loop)
        self._note_guard(loop)
        if self._inner.conditions.blackout_s:
            self._note_blackout(loop)
        result = self.env.step(action)
        self._observation = result[0]
        return result

    def columns(self) -> Row:
        """Return the notes as columns of a row."""
        errors, guards = self._errors_m, self._guards_m
        measures = {
            "apart_after_s": self._apart_after_s,
            "forecast_error_m": float(np.mean(errors)) if errors else None,
            "forecast_error_p95_m": float(np.percentile(errors, 95)) if errors else None,
            "standing_guard_least_m": min(guards, default=None),
            "standing_guard_most_m": max(guards, default=None),
        }
        return {name: tuple(own) for name, own in self._lists.items()} | self._counts | measures

    def _count(self, **added: SupportsInt) -> None:
        for name, number in added.items():
            self._counts[name] += int(number)

    def _note_evidence(self, loop: OneWorld) -> None:
        """Note the age of the pictures. Count the boxes taken before a turn whose wedge holds the
        centre of their object, with and without compensation.

        A box counts as turned if the car has since turned by at least a column: compensation does
        not move others.
        """
        detections = loop.belief.detections
        if not len(detections):
            return
        # All boxes of a keyframe are of the newest picture that has arrived.
        self._lists["evidence_ages_ms"].append(round(1e3 * float(detections.ages[0])))
        known = loop.detected_bodies != NO_OBJECT
        turned = known & (np.abs(detections.yaw_changes) >= loop.rig.grid.column_width)
        self._count(boxes=known.sum(), turned_boxes=turned.sum())
        if not turned.any():
            return
        boxes = loop.world.boxes_of(loop.detected_bodies[turned])
        cells = loop.rig.grid.cells_at(loop.sensor.boxes_to_local(boxes)[:, :3])
        held, unturned = (
            sum(
                bool(np.isin(own, wedge).any())
                for own, wedge in zip(cells, each.take(turned), strict=True)
            )
            for each in (wedges(detections, loop.rig), wedges(detections.unturned(), loop.rig))
        )
        self._count(turned_held=held, unturned_held=unturned)

    def _note_forecasts(self, loop: OneWorld) -> None:
        """Note the errors of forecasts of tracks with a velocity. Count those with an azimuth error
        within Eq. 4's margin, and within that of a full hull.
        """
        tracks = loop.belief.tracks.take(loop.belief.tracks.hits > 1)
        if not len(tracks):
            return
        true = loop.true_boxes(tracks)
        self._errors_m += np.hypot(*(tracks.boxes - true)[:, :2].T).tolist()
        azimuths, wanted = (np.arctan2(boxes[:, 1], boxes[:, 0]) for boxes in (tracks.boxes, true))
        away = np.abs((azimuths - wanted + np.pi) % (2 * np.pi) - np.pi)
        columns = away / loop.rig.grid.column_width
        margin = uncertainty_margin(VEHICLE_SIGMA_M, tracks.boxes, loop.rig)
        self._count(
            forecasts=len(tracks),
            forecasts_in_eq4=(columns <= margin).sum(),
            forecasts_in_margin=(columns <= loop.rig.azimuth_margin).sum(),
        )

    def _note_guard(self, loop: OneWorld) -> None:
        """Note the guard of a standing car, and the cells that forgetting releases without and with
        the margin of Eq. 4.
        """
        belief = loop.belief
        # Standing is judged by truth; the guard gets the odometry's reading.
        if loop.world.ego_motion.speed == 0:
            self._guards_m.append(ForgettingRules().guard_distance(belief.ego.speed))
            self._count(standing_keyframes=1)
        hulls = loop.rig.hulls(belief.tracks.boxes)
        released = []
        for forgetting in self._forgetting:
            forgetting.advance(belief.tracks, belief.ego)
            kept = forgetting.exploitation(belief.tracks)
            released.append(released_cells(hulls, kept, loop.rig.grid.size))
        self._count(released_cells=released[0], released_cells_vehicle=released[1])

    def _note_blackout(self, loop: OneWorld) -> None:
        """Note at every keyframe of a blackout whether all compared policies fire alike, and after
        it when they first differ.
        """
        conditions = self._inner.conditions
        entries = self._new_entries(loop)
        ended_s = conditions.blackout_start_s + conditions.blackout_s
        # A late picture from before the blackout still counts: the camera is off once none is left.
        dark = conditions.black_at(loop.world.time) and not len(loop.belief.detections)
        lit_again = loop.world.time >= ended_s - LAST_BITS_S and self._apart_after_s is None
        if not (dark or lit_again):
            return
        first, *others = (
            self._inner.would_fire(policy(self._observation)) for policy in self._asked
        )
        alike = all(np.array_equal(first, cells) for cells in others)
        if not dark:
            self._apart_after_s = None if alike else max(0.0, loop.world.time - ended_s)
            return
        self._count(dark_keyframes=1, dark_alike=alike)
        tracked = loop.rig.hulls(loop.belief.tracks.boxes).cells
        for hull in entries:
            self._lists["dark_entries_alike"].append(int(alike))
            self._lists["dark_entry_cells"].append(int(np.isin(hull, first).sum()))
            self._lists["dark_entry_covered"].append(int(is_covered(hull, tracked)))

    def _new_entries(self, loop: OneWorld) -> Sequence[Cells]:
        """Return the hulls of the bodies that a faultless camera shows for the first time.
        Initially visible bodies are no entries.
        """
        shown = {body for body in loop.world.labels() if loop.shows(body)}
        entries = sorted(shown - self._shown)
        self._shown |= shown
        boxes = loop.world.boxes_of(np.array(entries if loop.index else [], np.int64))
        return loop.rig.hulls(loop.sensor.boxes_to_local(boxes))
