"""The page of the environments of the closed loop, on their conditions: default and values are read
off the fields.
"""

from dataclasses import fields

from care_sim.base.checks import allowed
from care_sim.core.conditions import ClosedLoopConditions

_ROWS = (
    ("reserve_fraction", "allocator", "rho, the share of the budget kept for the reserve"),
    ("floor", "allocator", "whether the random floor spends what the policy leaves"),
    ("floor_seed", "allocator", "which of the random floors that the seed holds"),
    ("azimuth_margin elevation_margin", "allocator", "cells by which hulls are dilated"),
    ("cell_order", "allocator", "in which order the cells of a set are taken"),
    ("firing", "LiDAR", 'what fires as a whole, "cells", "tiles:4x8", ... (3)'),
    ("engine", "sensors", 'what casts the rays, "fast" or "bullet"'),
    ("min_returns", "LiDAR detector", "fired rays that must hit an object"),
    ("velocity_keyframes", "tracker", "detections that make the velocity of a track"),
    ("camera_confidence", "camera detector", "least confidence of a detection"),
    ("sweep_mask", "open loop", "which mask the sweeps between keyframes fire"),
    ("clutter", "streets of the open loop", "whether they are less clean (6)"),
    ("camera_profile", "camera", "the detector that it is like"),
    ("false_negative_rate", "camera", "share of the objects that it misses"),
    ("false_negative_per_m", "camera", "growth of that share with distance, 1/m"),
    ("false_negative_burst", "camera", "keyframes that a miss lasts"),
    ("false_positive_rate", "camera", "mean number of false boxes per picture"),
    ("camera_latency", "camera", "age of its detections, keyframes"),
    ("camera_latency_s", "camera", "age of its detections, s; not with `camera_latency`"),
    ("camera_jitter", "camera", "most keyframes by which a picture comes later still"),
    ("blackout_start_s blackout_s", "camera", "begin and length of a blackout, s"),
    (
        "camera_rotation_sigma_deg",
        "camera",
        "spread of the mount's error in yaw and pitch, degrees",
    ),
    ("camera_position_sigma_m", "camera", "spread of the mount's error in x, y and z, m"),
    ("lidar_range_sigma", "LiDAR", "noise on every range, m"),
    ("lidar_dropout", "LiDAR", "share of the returns that are lost"),
    ("lidar_dead_rows", "LiDAR", "elevation rows that return nothing; row 0 is the highest"),
    ("lidar_stated_range_m", "returns", "range that its data sheet states, m (5)"),
    ("lidar_stated_reflectance", "returns", "reflectance at which it is stated"),
    ("visibility_m", "returns", "meteorological visibility in fog, m"),
    ("rain_mm_h", "returns", "rain, mm/h"),
    ("lidar_divergence_mrad", "returns", "angle between opposite edges of a beam, mrad"),
    ("lidar_returns", "returns", "which echo of a beam"),
    ("lidar_sweep_s", "returns", "how long a sweep takes, whose columns fire one by one, s"),
    ("lidar_compensated", "returns", "whether its points are freed of the ego's motion"),
    ("lidar_crosstalk", "returns", "share of the cells with the pulse of another LiDAR"),
    ("ego_speed_sigma", "odometry", "noise on the car's own speed, m/s"),
    ("ego_position_sigma_m ego_yaw_sigma_deg", "localisation", "errors of its pose, m, degrees"),
    ("ego_pose_correlation_s", "localisation", "how long these errors last, s"),
    ("driver", "driver", "who brakes (4)"),
    ("brake_mps2", "fixed driver", "its deceleration, m/s^2"),
    ("brake_reaction_s", "fixed driver", "from decision to full braking, s"),
    ("brake_standstill_m", "fixed driver", "gap at which it means to stand, m"),
    ("brake_horizon_s", "fixed driver", "how far ahead it foresees an entry, s"),
    ("brake_side_margin_m", "fixed driver", "room that it keeps on either side, m"),
    ("brake_release_s", "fixed driver", "time of free way before it lets go, s"),
    ("brake_for_oncoming", "fixed driver", "whether it foresees how near a track comes by itself"),
    ("comfort_mps2", "driver", "acceleration back to cruising speed, m/s^2"),
)
"""The names of conditions that are told together, whose they are, what they mean."""
_FIELDS = {field.name: field for field in fields(ClosedLoopConditions)}


def _line(names: str, whose: str, meaning: str) -> str:
    """A row of the table. Values that all of its conditions have are told once."""
    told = [_FIELDS[name] for name in names.split()]
    conditions = ", ".join(f"`{field.name}`" for field in told)
    defaults = ", ".join(dict.fromkeys(f"{field.default!r}" for field in told))
    values = "; ".join(dict.fromkeys(allowed(field).removeprefix("of ") for field in told))
    return f"| {conditions} | {defaults} | {values} | {whose} | {meaning} |"


_TABLE = "\n".join(_line(*row) for row in _ROWS)

CONDITIONS = f"""
The conditions are the fields of `care_sim.core.conditions.ClosedLoopConditions`, which says
more of each. Faults are off by default and drawn by the seed.

| condition | default | values | of | meaning |
|---|---|---|---|---|
{_TABLE}

(3) `care_sim.core.firing`; B is then the cells of the units that the budget buys. (4)
`care_sim.driving.braking` and `care_sim.driving.drivers`. Only `fixed` has the settings
that begin with `brake_`. (5) `care_sim.core.conditions`; at 0 all that is in reach
returns. (6) `docs/clutter.md`.
"""
