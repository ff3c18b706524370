"""Which environments can be played as arrays."""

from care_sim.core.conditions import IDEAL_CAMERA
from care_sim.core.grid import AngularGrid
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.scenarios import CutInEnv, DartoutEnv, DenseEnv, R157Env, ScenarioEnv
from care_sim.scenarios.cutin import CutIn
from care_sim.scenarios.dartout import Dartout
from care_sim.scenarios.dense import Dense
from care_sim.scenarios.r157.scenario import R157

STRAIGHT = (Dartout, Dense, CutIn, R157)
"""Scenarios on a straight road, without a route, a plan of speeds or an end before their time."""
PLAIN = (DartoutEnv, DenseEnv, CutInEnv, R157Env, ScenarioEnv)
"""Environments that do nothing of their own in a step. A class that derives from them may."""


def why_separate(env: ClosedLoopEnv) -> str | None:
    """Why worlds of an environment are played one after the other, None if as arrays."""
    conditions, rig = env.conditions, env.rig
    if type(env.scenario) not in STRAIGHT:
        return f"the scenario {env.scenario_name}"
    if type(env) not in PLAIN:
        return f"the class {type(env).__name__}"
    reasons = {
        "the engine": conditions.engine != "fast",
        "the detector": not env.detects_by_returns,
        "the driver": conditions.driver != "fixed",
        "the hardware": rig.firing != "cells",
        "the LiDAR": not isinstance(rig.grid, AngularGrid)
        or rig.grid.is_tilted
        or bool(rig.sensor_y_m),
        "beams": conditions.shapes_beams,
        "faults of the LiDAR": bool(
            conditions.lidar_range_sigma
            or conditions.lidar_dropout
            or conditions.lidar_dead_rows
            or conditions.lidar_crosstalk
        ),
        "odometry and localisation": bool(
            conditions.ego_speed_sigma
            or conditions.ego_position_sigma_m
            or conditions.ego_yaw_sigma_deg
        ),
        "the camera": conditions.camera_profile != IDEAL_CAMERA
        or bool(
            conditions.false_positive_rate
            or conditions.camera_latency_s
            or conditions.camera_rotation_sigma_deg
            or conditions.camera_position_sigma_m
        ),
    }
    return next((name for name, holds in reasons.items() if holds), None)
