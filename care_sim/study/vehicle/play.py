"""An episode of the vehicle study: the row of an episode, and what was noted beside it."""

from collections.abc import Sequence
from typing import Any

import gymnasium

from care_sim.core.types import Action
from care_sim.envs.sensing import Observed, sensing
from care_sim.policies import make_policy
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.run_config import Row
from care_sim.study.vehicle.evidence import Evidence, Forecasts
from care_sim.study.vehicle.guard import Fallback, Guard

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
