"""The table of conditions in docstrings and pages, with defaults and values of the fields."""

from dataclasses import fields

from care_sim.base.checks import allowed
from care_sim.core.conditions import ClosedLoopConditions

_ROWS = (
    ("reserve_fraction", "allocator", "share rho of the budget for the reserve"),
    ("floor", "allocator", "whether a random floor spends unused budget"),
    ("floor_seed", "allocator", "number of the random floor of the seed"),
    ("azimuth_margin elevation_margin", "allocator", "cells by which hulls and wedges are dilated"),
    ("cell_order", "allocator", "order of the cells inside a set"),
    ("firing", "LiDAR", 'unit that fires as a whole, "tiles:4x8", ... (`care_sim.core.firing`)'),
    ("engine", "sensors", 'ray caster, "fast" or "bullet"'),
    ("min_returns", "LiDAR detector", "returns that detect an object"),
    ("velocity_keyframes", "tracker", "detections that a track's velocity is fitted to"),
    ("camera_confidence", "camera detector", "least confidence of a camera detection"),
    ("sweep_mask", "open loop", "mask of the sweeps between two keyframes"),
    ("clutter", "streets of the open loop", "kerbs, plants, poles and lost returns"),
    ("camera_profile", "camera", "measured detector that it imitates"),
    ("false_negative_rate", "camera", "share of missed objects"),
    ("false_negative_per_m", "camera", "growth of that share per metre, 1/m"),
    ("false_negative_burst", "camera", "keyframes per miss"),
    ("false_positive_rate", "camera", "mean number of false boxes per picture"),
    ("camera_latency", "camera", "age of the detections, keyframes"),
    ("camera_latency_s", "camera", "age of the detections, s; not with `camera_latency`"),
    ("camera_jitter", "camera", "largest random extra delay, keyframes"),
    ("blackout_start_s blackout_s", "camera", "start and length of a blackout, s"),
    (
        "camera_rotation_sigma_deg",
        "camera",
        "standard deviation of the mount's yaw and pitch error",
    ),
    ("camera_position_sigma_m", "camera", "standard deviation of the mount's position error, m"),
    ("lidar_range_sigma", "LiDAR", "standard deviation of the range noise, m"),
    ("lidar_dropout", "LiDAR", "share of lost returns"),
    ("lidar_dead_rows", "LiDAR", "rows without returns; row 0 is the highest"),
    ("lidar_stated_range_m", "returns", "range that the data sheet states, m; 0 is off"),
    ("lidar_stated_reflectance", "returns", "target reflectance at that range"),
    ("visibility_m", "returns", "meteorological visibility in fog, m"),
    ("rain_mm_h", "returns", "rain, mm/h"),
    ("lidar_divergence_mrad", "returns", "full beam angle, mrad"),
    ("lidar_returns", "returns", "which echo of a beam counts"),
    ("lidar_sweep_s", "returns", "duration of a sweep whose columns fire one by one, s"),
    ("lidar_compensated", "returns", "whether the ego's motion is removed from its points"),
    ("lidar_crosstalk", "returns", "share of cells with a pulse of another LiDAR"),
    ("ego_speed_sigma", "odometry", "noise on the ego speed, m/s"),
    ("ego_position_sigma_m ego_yaw_sigma_deg", "localisation", "pose errors, m, degrees"),
    ("ego_pose_correlation_s", "localisation", "correlation time of the pose errors, s"),
    ("driver", "driver", "braking rule (`care_sim.driving.drivers`)"),
    ("brake_mps2", "fixed driver", "deceleration, m/s^2"),
    ("brake_reaction_s", "fixed driver", "from decision to full braking, s"),
    ("brake_standstill_m", "fixed driver", "gap at standstill, m"),
    ("brake_horizon_s", "fixed driver", "horizon for objects that enter the way, s"),
    ("brake_side_margin_m", "fixed driver", "margin at either side, m"),
    ("brake_release_s", "fixed driver", "time of free way before release, s"),
    ("brake_for_oncoming", "fixed driver", "whether it predicts oncoming tracks"),
    ("comfort_mps2", "driver", "acceleration back to cruising speed, m/s^2"),
)
"""Names of conditions that share a row, what they belong to, what they mean."""
_FIELDS = {field.name: field for field in fields(ClosedLoopConditions)}


def _line(names: str, whose: str, meaning: str) -> str:
    """Return a row of the table. Values that its conditions share appear once."""
    told = [_FIELDS[name] for name in names.split()]
    conditions = ", ".join(f"`{field.name}`" for field in told)
    defaults = ", ".join(dict.fromkeys(f"{field.default!r}" for field in told))
    values = "; ".join(dict.fromkeys(allowed(field).removeprefix("of ") for field in told))
    return f"| {conditions} | {defaults} | {values} | {whose} | {meaning} |"


_TABLE = "\n".join(_line(*row) for row in _ROWS)

CONDITIONS = f"""
The conditions are the fields of `care_sim.core.conditions.ClosedLoopConditions`. Faults are off
by default, and the seed draws them.

| condition | default | values | of | meaning |
|---|---|---|---|---|
{_TABLE}
"""
