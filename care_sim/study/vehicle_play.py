"""Episodes of the vehicle study (paper, Sec. 5.5): their rows, and what is noted beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Integers
from care_sim.core.belief import Observation
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
from care_sim.envs.sensing import Observed, SensingEnv, sensing
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.mechanism_play import is_covered
from care_sim.study.run_config import Row


class Evidence:
    """Ages of the pictures that decisions rest on, and of the boxes taken before a turn those whose
    wedge holds their object: its centre, as it stands at the decision.

    A box counts as turned where the car has since turned by a column or more; compensation can move
    no other. Truth, that is which object lies behind a box, is read for the scoring alone.
    """

    def __init__(self) -> None:
        self._ages_ms: list[int] = []
        self._boxes = 0
        self._turned = np.zeros(3, np.int64)
        """Turned boxes, and those whose wedge holds the object with and without compensation."""

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        detections = loop.belief.detections
        if not len(detections):
            return
        # All boxes of a keyframe are of the newest picture that has arrived.
        self._ages_ms.append(round(1e3 * float(detections.ages[0])))
        known = loop.detected_bodies != NO_OBJECT
        self._boxes += int(known.sum())
        turned = known & (np.abs(detections.yaw_changes) >= loop.rig.grid.column_width)
        if not turned.any():
            return
        boxes = loop.world.boxes_of(loop.detected_bodies[turned])
        cells = loop.rig.grid.cells_at(loop.sensor.boxes_to_local(boxes)[:, :3])
        held = [
            sum(
                bool(np.isin(own, wedge).any())
                for own, wedge in zip(cells, each.take(turned), strict=True)
            )
            for each in (wedges(detections, loop.rig), wedges(detections.unturned(), loop.rig))
        ]
        self._turned += [int(turned.sum()), *held]

    def columns(self) -> Row:
        """As columns of a row."""
        turned, held, held_unturned = self._turned.tolist()
        return {
            "evidence_ages_ms": tuple(self._ages_ms),
            "boxes": self._boxes,
            "turned_boxes": turned,
            "turned_held": held,
            "unturned_held": held_unturned,
        }


class Forecasts:
    """Errors of the forecasts of tracks that have a velocity, against where their objects are."""

    def __init__(self) -> None:
        self._errors_m: list[float] = []
        self._held = np.zeros(2, np.int64)
        """Forecasts whose error in azimuth lies within Eq. 4's margin, and within a full hull's."""

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        tracks = loop.belief.tracks.take(loop.belief.tracks.hits > 1)
        if not len(tracks):
            return
        true = loop.true_boxes(tracks)
        self._errors_m += np.hypot(*(tracks.boxes - true)[:, :2].T).tolist()
        azimuths, wanted = (np.arctan2(boxes[:, 1], boxes[:, 0]) for boxes in (tracks.boxes, true))
        away = np.abs((azimuths - wanted + np.pi) % (2 * np.pi) - np.pi)
        columns = away / loop.rig.grid.column_width
        margin = uncertainty_margin(VEHICLE_SIGMA_M, tracks.boxes, loop.rig)
        self._held += [
            int((columns <= margin).sum()),
            int((columns <= loop.rig.azimuth_margin).sum()),
        ]

    def columns(self) -> Row:
        """As columns of a row."""
        errors = self._errors_m
        eq4, full = self._held.tolist()
        return {
            "forecasts": len(errors),
            "forecast_error_m": float(np.mean(errors)) if errors else None,
            "forecast_error_p95_m": float(np.percentile(errors, 95)) if errors else None,
            "forecasts_in_eq4": eq4,
            "forecasts_in_margin": full,
        }


class Guard:
    """Runs Algorithm 3 beside the policy that plays, once as in simulation (sigma_pos 0) and once
    as on the paper's vehicle (0.4 m).
    """

    def __init__(self, loop: ClosedLoop):
        self._rules = ForgettingRules()
        vehicle = replace(self._rules, position_sigma_m=VEHICLE_SIGMA_M)
        self._forgetting = [Forgetting(rules, loop.rig) for rules in (self._rules, vehicle)]
        self._standing_guards_m: list[float] = []
        self._released = np.zeros(2, np.int64)

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        belief = loop.belief
        # Whether the car stands is the truth; what the guard is told is what odometry reads.
        if loop.world.ego_motion.speed == 0:
            self._standing_guards_m.append(self._rules.guard_distance(belief.ego.speed))
        hulls = loop.rig.hulls(belief.tracks.boxes)
        for forgetting in self._forgetting:
            forgetting.advance(belief.tracks, belief.ego)
        kept = [forgetting.exploitation(belief.tracks) for forgetting in self._forgetting]
        self._released += [released_cells(hulls, sets, loop.rig.grid.size) for sets in kept]

    def columns(self) -> Row:
        """As columns of a row."""
        guards = self._standing_guards_m
        released, with_margin = self._released.tolist()
        return {
            "standing_keyframes": len(guards),
            "standing_guard_least_m": min(guards, default=None),
            "standing_guard_most_m": max(guards, default=None),
            "released_cells": released,
            "released_cells_vehicle": with_margin,
        }


class Fallback:
    """Asks policies at every keyframe of a blackout, and after it until they differ, what they
    would fire on the belief of the policy that plays.

    A new entry is a body that a faultless camera shows for the first time. Truth is read for the
    scoring alone.
    """

    def __init__(self, env: SensingEnv[ClosedLoop], asked: Mapping[str, Policy]):
        self._env = env
        self._asked = asked
        self._shown: set[int] = set()
        self._dark = np.zeros(2, np.int64)
        """Keyframes in the dark, and those at which all fire alike."""
        self._entries_alike: list[int] = []
        self._entry_cells: list[int] = []
        self._entry_covered: list[int] = []
        self._apart_after_s: float | None = None

    def look(self, observation: Observation) -> None:
        """Note the coming keyframe, of which policies see the `observation`."""
        loop = self._env.loop
        faults = self._env.conditions
        if not faults.blackout_s:
            return
        entries = self._new_entries(loop)
        ended_s = faults.blackout_start_s + faults.blackout_s
        # A late picture of before the blackout still counts: the camera is away once none is left.
        dark = faults.black_at(loop.world.time) and not len(loop.belief.detections)
        lit_again = loop.world.time >= ended_s - LAST_BITS_S and self._apart_after_s is None
        if not (dark or lit_again):
            return
        fired = [self._env.would_fire(policy(observation)) for policy in self._asked.values()]
        alike = all(np.array_equal(cells, fired[0]) for cells in fired[1:])
        if dark:
            self._dark += [1, alike]
            self._note_entries(loop, entries, fired[0], alike)
        elif not alike:
            self._apart_after_s = max(0.0, loop.world.time - ended_s)

    def _new_entries(self, loop: ClosedLoop) -> Integers:
        """(n,) the bodies that a faultless camera shows for the first time."""
        shown = {body for body in loop.world.labels() if loop.shows(body)}
        entries = sorted(shown - self._shown)
        self._shown |= shown
        return np.array(entries, np.int64)

    def _note_entries(self, loop: ClosedLoop, entries: Integers, fired: Cells, alike: bool) -> None:
        """Note how many cells each of the new `entries` is given."""
        # A belief of no keyframe before: what is there at the start is no entry.
        if not loop.index:
            return
        boxes = loop.sensor.boxes_to_local(loop.world.boxes_of(entries))
        tracked = loop.rig.hulls(loop.belief.tracks.boxes).cells
        for hull in loop.rig.hulls(boxes):
            self._entries_alike.append(int(alike))
            self._entry_cells.append(int(np.isin(hull, fired).sum()))
            self._entry_covered.append(int(is_covered(hull, tracked)))

    def columns(self) -> Row:
        """As columns of a row."""
        dark, alike = self._dark.tolist()
        return {
            "dark_keyframes": dark,
            "dark_alike": alike,
            "dark_entries_alike": tuple(self._entries_alike),
            "dark_entry_cells": tuple(self._entry_cells),
            "dark_entry_covered": tuple(self._entry_covered),
            "apart_after_s": self._apart_after_s,
        }


ASKED = ("care", "all-camera", "history")
"""The policies of which the paper says that they are one without a camera (Sec. 5.5)."""
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
"""Nothing where the camera never came back, nothing was forecast, or the car never stood."""


def play_vehicle(batch: Sequence[EpisodeConfig]) -> list[Row | str]:
    """What a worker does: play episodes, and give for each its row, or in one line why there is
    none.
    """
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
    """Notes every keyframe before it is played, and leaves the episode as it is."""

    def __init__(self, env: GymEnv):
        super().__init__(env)
        self._inner = sensing(env)

    def reset(self, **given: Any) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode."""
        self._observation, info = self.env.reset(**given)
        loop = self._inner.loop
        asked = {name: make_policy(name, self._inner) for name in ASKED}
        self._evidence = Evidence()
        self._fallback = Fallback(self._inner, asked)
        self._forecasts = Forecasts()
        self._guard = Guard(loop)
        return self._observation, info

    def step(self, action: Action) -> tuple[Observed, Any, bool, bool, dict[str, Any]]:
        """Note the keyframe, then play it."""
        loop = self._inner.loop
        for note in (self._evidence, self._forecasts, self._guard):
            note.look(loop)
        self._fallback.look(self._observation)
        result = self.env.step(action)
        self._observation = result[0]
        return result

    def columns(self) -> Row:
        """What was noted, as columns of a row."""
        notes = (self._evidence, self._fallback, self._forecasts, self._guard)
        return {name: value for note in notes for name, value in note.columns().items()}
