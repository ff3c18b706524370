"""The table of conditions in docstrings and pages, with defaults and values of the fields."""

from dataclasses import Field, fields
from typing import Any

from care_sim.base.checks import allowed
from care_sim.core.conditions import ClosedLoopConditions

_ROWS = (
    ("reserve_fraction", "share rho of the budget for the reserve"),
    ("floor", "a random floor spends unused budget"),
    ("floor_seed", "number of the random floor"),
    ("azimuth_margin elevation_margin", "cells that dilate hulls and wedges"),
    ("cell_order", "order of cells inside a set"),
    ("firing", "unit that fires as a whole (`care_sim.core.firing`)"),
    ("engine", 'ray caster, "fast" or "bullet"'),
    ("min_returns", "returns per detection"),
    ("velocity_keyframes", "detections per velocity"),
    ("camera_confidence", "least confidence"),
    ("sweep_mask", "mask of sweeps between keyframes"),
    ("clutter", "streets with kerbs, plants, poles, lost returns"),
    ("camera_profile", "measured detector to imitate"),
    ("false_negative_rate false_negative_per_m", "share of missed objects, its growth per metre"),
    ("false_negative_burst", "keyframes per miss"),
    ("false_positive_rate", "mean false boxes per picture"),
    ("camera_latency", "age of detections, keyframes"),
    ("camera_latency_s", "the same in seconds"),
    ("camera_jitter", "largest random extra delay, keyframes"),
    ("blackout_start_s blackout_s", "start and length, s"),
    ("camera_rotation_sigma_deg camera_position_sigma_m", "errors of the mount"),
    ("lidar_range_sigma", "range noise, m"),
    ("lidar_dropout", "share of lost returns"),
    ("lidar_dead_rows", "rows without returns; row 0 is the highest"),
    ("lidar_stated_range_m", "range on the data sheet; 0 is off"),
    ("lidar_stated_reflectance", "target reflectance at that range"),
    ("visibility_m rain_mm_h", "fog and rain; 0 is off"),
    ("lidar_divergence_mrad", "full beam angle"),
    ("lidar_returns", "which echo of a beam counts"),
    ("lidar_sweep_s", "duration of a sweep, column by column"),
    ("lidar_compensated", "remove the ego's motion from its points"),
    ("lidar_crosstalk", "share of cells with another LiDAR's pulse"),
    ("ego_speed_sigma", "noise of the odometry, m/s"),
    ("ego_position_sigma_m ego_yaw_sigma_deg", "pose errors"),
    ("ego_pose_correlation_s", "correlation time of pose errors"),
    ("driver", "braking rule (`care_sim.driving.drivers`)"),
    ("brake_mps2", "deceleration"),
    ("brake_reaction_s", "from decision to full braking"),
    ("brake_standstill_m", "gap at standstill"),
    ("brake_horizon_s", "prediction of objects that enter the way"),
    ("brake_side_margin_m", "margin at either side"),
    ("brake_release_s", "free way before release"),
    ("brake_for_oncoming", "predict oncoming tracks"),
    ("comfort_mps2", "acceleration back to cruising speed"),
)
"""Names of conditions that share a row, and what they mean."""
_FIELDS = {field.name: field for field in fields(ClosedLoopConditions)}


def _line(names: str, meaning: str) -> str:
    """Return a row of the table. Values that its conditions share appear once."""
    told = [_FIELDS[name] for name in names.split()]
    conditions = ", ".join(f"`{field.name}`" for field in told)
    defaults = ", ".join(dict.fromkeys(_plain(field.default) for field in told))
    values = "; ".join(dict.fromkeys(_values(field) for field in told))
    return f"| {conditions} | {defaults}{values and f' ({values})'} | {meaning} |"


def _plain(default: object) -> str:
    return f"{default:g}" if isinstance(default, float) else str(default)


def _values(field: Field[Any]) -> str:
    """Return the other values: a range as 0–1, or names."""
    values = allowed(field)
    if not values.startswith("of "):
        return values.replace(" to ", "–")
    return ", ".join(
        each for each in values.removeprefix("of ").split(", ") if each != field.default
    )


_TABLE = "\n".join(_line(*row) for row in _ROWS)

CONDITIONS = f"""
The conditions are the fields of `care_sim.core.conditions.ClosedLoopConditions`. Faults are off
by default, and the seed draws them. `sigma` is a standard deviation.
`brake_...` set the fixed driver.

| condition | default (other values) | meaning |
|---|---|---|
{_TABLE}
"""
