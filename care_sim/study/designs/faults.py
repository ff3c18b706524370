"""The study of faults: every fault of camera, LiDAR and odometry, from none to strong."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import DEFAULTS
from care_sim.study.designs.variants import Place, Variant
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.run_config import Row

FAULT_PLACES = (Place("dartout", 0.10), Place("dense", 0.03))
"""The paper's budgets: for injected faults, and for comparing the reserves."""
FAULT_POLICIES = ("history", "all-camera", "care", "full")
_BLACKOUT_START_S = 2.0
"""Seconds. The person comes into the camera's view 2.4 to 2.9 s after the start."""
_DEAD: tuple[tuple[int, ...], ...] = ((), (11,), (10, 11), (10, 11, 12), (9, 10, 11, 12))
"""Dead rows grow from the middle of the rows that meet a person at the full scan's 16 m, 1 to 6
degrees below the horizon.
"""


@dataclass(frozen=True)
class Fault:
    """A fault from none, the first level, to strong. The labels of the levels are its strength in
    `unit`.
    """

    title: str
    unit: str
    levels: tuple[Variant, ...]
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title}, {self.unit}"


def _growing(parameter: str, *values: float, start: float = 0, **given: Any) -> tuple[Variant, ...]:
    # At strength 0 nothing else of the fault has an effect, and the level is the usual one. A burst
    # of one keyframe is no burst, but its share of misses stays.
    first = Variant(f"{start:g}", given if start else {})
    return (first, *(Variant(f"{value:g}", {parameter: value, **given}) for value in values))


FAULTS = (
    # The strengths of each fault grow from the first on. Values by which results are compared with
    # the paper are among them: misses of 0.2 and 0.4, a latency of 1 and 2 keyframes.
    Fault("missed objects", "share", _growing("false_negative_rate", 0.2, 0.4, 0.6, 0.8, 1.0)),
    Fault(
        "misses in bursts",
        "keyframes, at a share of 0.4",
        _growing("false_negative_burst", 5, 10, 20, start=1, false_negative_rate=0.4),
    ),
    Fault(
        "misses growing with distance",
        "share a metre",
        _growing("false_negative_per_m", 0.01, 0.02, 0.04),
    ),
    Fault(
        "false detections",
        "boxes a picture",
        _growing("false_positive_rate", 1.0, 2.0, 4.0, 8.0, 16.0),
    ),
    Fault("latency", "keyframes", _growing("camera_latency", 1, 2, 3, 5)),
    Fault("jitter of the latency", "most keyframes", _growing("camera_jitter", 1, 2, 4)),
    Fault(
        f"blackout from {_BLACKOUT_START_S:.1f} s",
        "s",
        _growing("blackout_s", 0.5, 1.0, 2.0, blackout_start_s=_BLACKOUT_START_S),
    ),
    Fault(
        "camera turned",
        "sigma in degrees",
        _growing("camera_rotation_sigma_deg", 0.5, 1.0, 2.0, 4.0),
    ),
    Fault("camera shifted", "sigma in m", _growing("camera_position_sigma_m", 0.05, 0.1, 0.2)),
    Fault("lost returns", "share", _growing("lidar_dropout", 0.1, 0.2, 0.4, 0.6)),
    Fault(
        "range noise",
        "sigma in m",
        _growing("lidar_range_sigma", 0.02, 0.1, 0.5),
        (
            "The proxy detector's boxes are true whatever the ranges; of the study's policies "
            "none reads ranges.",
        ),
    ),
    Fault(
        "dead rows",
        "rows",
        tuple(Variant(f"{len(rows)}", {"lidar_dead_rows": rows} if rows else {}) for rows in _DEAD),
    ),
    Fault("noise of the car's speed", "sigma in m/s", _growing("ego_speed_sigma", 0.25, 0.5, 1.0)),
)


_VARIED = frozenset(name for fault in FAULTS for level in fault.levels for name in level.changes)
_SHARED = {*DEFAULTS, "sensor", "sensor_hash", "detector"} - _VARIED
"""Columns that no fault changes."""


def fault_study(
    seeds: Sequence[int], also: Sequence[str] = (), **common: Any
) -> list[EpisodeConfig]:
    """Return every policy at every strength of every fault in both places. `also` are further
    policies, `common` further fields of `EpisodeConfig`. Raises InvalidInput for a field that is a
    fault.
    """
    for name in sorted(_VARIED):
        if common.get(name, DEFAULTS[name]) != DEFAULTS[name]:
            raise InvalidInput(
                f"{name} is a fault that grows: the study takes no other start of it"
            )
    shared = {name: value for name, value in common.items() if name not in _VARIED}
    made: list[EpisodeConfig] = []
    for place, fault in product(FAULT_PLACES, FAULTS):
        for level in fault.levels:
            grown = Variant(level.label, {**shared, **level.changes})
            made += grown.configurations(place, [*FAULT_POLICIES, *also], seeds)
    return list(dict.fromkeys(made))


def faults_alone(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with only their faults: conditions shared by all rows are left out."""
    return [{name: value for name, value in row.items() if name not in _SHARED} for row in rows]
