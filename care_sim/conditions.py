"""The conditions of an environment: how well the car senses, and how its budget is spent.

The fields are at once keyword arguments of the environments, options of the command line and columns of
the results. Every fault is off by default.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from care_sim.allocation import RESERVE_FRACTION
from care_sim.errors import InvalidInput, check_number, check_whole, is_number
from care_sim.grid import AZIMUTH_MARGIN, ELEVATION_MARGIN

MIN_RETURNS = 3
"""Fired rays that must hit an object. The fewest that span a surface."""
CONFIDENCE = 0.25
"""The public confidence threshold of the paper's camera detector (Remark 2)."""
MOST_GHOSTS = 64
"""False detections a picture, on average: half as many as a policy is shown at most."""


@dataclass(frozen=True, kw_only=True)
class CameraFaults:
    """What the camera gets wrong."""

    false_negative_rate: float = 0.0
    """Share of the objects in a picture that the camera misses, 0 to 1."""
    false_negative_per_m: float = 0.0
    """How much that share grows with every metre of distance, up to 1."""
    false_negative_burst: int = 1
    """Keyframes that a miss lasts; the share of misses stays what it is."""
    false_positive_rate: float = 0.0
    """Mean number of boxes in a picture that show nothing; else they are like the true ones, which they are drawn from
    (`care_sim.sensors.ghosts`), so that where the camera never sees anybody there are none.
    """
    camera_latency: int = 0
    """Age of the camera's detections in whole keyframes."""
    camera_jitter: int = 0
    """Most keyframes by which a picture may come later still; drawn evenly from 0 to this."""
    blackout_start_s: float = 0.0
    """When the camera goes black, seconds from the start; it does only with `blackout_s`."""
    blackout_s: float = 0.0
    """How long the camera's pictures are black, seconds."""
    camera_rotation_sigma_deg: float = 0.0
    """Spread of the error in yaw and pitch with which the camera is mounted, degrees; drawn once an episode."""
    camera_position_sigma_m: float = 0.0
    """Spread of the error in x, y and z with which the camera is mounted, metres; drawn once an episode."""

    def _check_camera(self) -> None:
        check_number("false_negative_rate", self.false_negative_rate, 0, 1)
        check_whole("false_negative_burst", self.false_negative_burst, 1)
        check_whole("camera_latency", self.camera_latency, 0)
        check_whole("camera_jitter", self.camera_jitter, 0)
        check_number("false_positive_rate", self.false_positive_rate, 0, MOST_GHOSTS)
        for name in ("false_negative_per_m", "blackout_start_s", "blackout_s"):
            check_number(name, getattr(self, name), 0)
        check_number("camera_rotation_sigma_deg", self.camera_rotation_sigma_deg, 0)
        check_number("camera_position_sigma_m", self.camera_position_sigma_m, 0)

    def black_at(self, time_s: float) -> bool:
        """Whether a picture taken at `time_s` is black."""
        return self.blackout_start_s - 1e-9 <= time_s < self.blackout_start_s + self.blackout_s - 1e-9


@dataclass(frozen=True, kw_only=True)
class LidarFaults:
    """What the LiDAR gets wrong."""

    lidar_range_sigma: float = 0.0
    """Gaussian noise on every range, metres, folded back at 0 and at the reach; policies meet it, the proxy detector,
    whose boxes are true, does not.
    """
    lidar_dropout: float = 0.0
    """Share of returns that are lost, 0 to 1."""
    lidar_dead_rows: tuple[int, ...] = ()
    """Elevation rows that fire and return nothing; row 0 is the highest."""

    def _check_lidar(self) -> None:
        check_number("lidar_dropout", self.lidar_dropout, 0, 1)
        check_number("lidar_range_sigma", self.lidar_range_sigma, 0)
        rows: Any = self.lidar_dead_rows
        if not isinstance(rows, list | tuple | np.ndarray) or np.ndim(rows) != 1:
            raise InvalidInput(f"lidar_dead_rows must be a list of rows, got {rows!r}")
        for row in rows:
            check_whole("lidar_dead_rows", row, 0)
        object.__setattr__(self, "lidar_dead_rows", tuple(sorted({int(row) for row in rows})))


@dataclass(frozen=True, kw_only=True)
class Sensing(CameraFaults, LidarFaults):
    """How well the car senses: engine, thresholds, and everything that degrades camera, LiDAR and odometry."""

    ego_speed_sigma: float = 0.0
    """Gaussian noise on the car's own speed, as policy and controller read it, m/s; no sign is read."""
    engine: str = "fast"
    """What casts the rays and draws the pictures of the closed loop: `fast`, compiled, or `bullet`, PyBullet's own, the
    reference.
    """
    min_returns: int = MIN_RETURNS
    """Fired rays that must hit an object for it to be detected."""
    camera_confidence: float = CONFIDENCE
    """Least confidence of a camera detection, 0 to 1; visible pixels decide, and the least box has 0.25."""

    def __post_init__(self) -> None:
        self._check_camera()
        self._check_lidar()
        check_number("ego_speed_sigma", self.ego_speed_sigma, 0)
        if not isinstance(self.engine, str):
            raise InvalidInput(f"engine must be a name, got {self.engine!r}")
        check_whole("min_returns", self.min_returns, 1)
        check_number("camera_confidence", self.camera_confidence, 0, 1)
        self._settle_numbers()

    def _settle_numbers(self) -> None:
        """Make every number the int or float that it is declared as, so that equal conditions are written alike."""
        for field in fields(self):
            value, declared = getattr(self, field.name), type(field.default)
            if declared in (int, float) and is_number(value) and declared(value) == value:
                object.__setattr__(self, field.name, declared(value))


@dataclass(frozen=True, kw_only=True)
class Conditions(Sensing):
    """All conditions: sensing, and how the budget is spent.

    `care_sim.types.Rig` checks what the allocator is given, the environments whether engine and rows exist.
    """

    reserve_fraction: float = RESERVE_FRACTION
    """Share rho of the budget that the allocator keeps for the reserve, 0 to 1."""
    floor: bool = True
    """Whether the shared random floor spends what the policy leaves of the budget."""
    floor_seed: int = 0
    """Which of the random floors that the episode's seed holds."""
    azimuth_margin: int = AZIMUTH_MARGIN
    """Columns by which hulls and wedges are dilated."""
    elevation_margin: int = ELEVATION_MARGIN
    """Rows by which hulls and wedges are dilated."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("floor_seed", self.floor_seed, 0)
        if not isinstance(self.floor, bool):
            raise InvalidInput(f"floor must be True or False, got {self.floor!r}")


DEFAULTS = {field.name: field.default for field in fields(Conditions)}
CAMERA_FAULTS = tuple(field.name for field in fields(CameraFaults))
UNFELT_BY_FULL = (
    *CAMERA_FAULTS,
    "camera_confidence",
    "reserve_fraction",
    "floor",
    "floor_seed",
    "azimuth_margin",
    "elevation_margin",
)
"""A scan of every cell asks neither the camera nor the allocator."""
