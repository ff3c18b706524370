"""The arguments of a vector environment; every world may have its own of some of them. And which
environments can be played as arrays.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.conditions import CAMERA_FAULTS, DEFAULTS, IDEAL_CAMERA
from care_sim.core.grid import AngularGrid
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.scenarios import CutInEnv, DartoutEnv, DenseEnv, R157Env, ScenarioEnv
from care_sim.scenarios.cutin import CutIn
from care_sim.scenarios.dartout import Dartout, Dense
from care_sim.scenarios.r157 import R157

OF_EACH_WORLD = ("budget", *CAMERA_FAULTS, "camera_confidence")
"""Arguments that may be a list, of a value for each world: what an allocator has to cope with."""

Maker = partial[ClosedLoopEnv]


def makers_of(kind: type[ClosedLoopEnv], arguments: Mapping[str, Any], worlds: int) -> list[Maker]:
    """What makes the single environment of each of so many worlds, from the `arguments` of their
    vector environment. Raises InvalidInput for a list of another length, and for one of what all
    worlds share.
    """
    for name, default in DEFAULTS.items():
        lists_itself = name in OF_EACH_WORLD or isinstance(default, tuple)
        if not lists_itself and _is_list(arguments.get(name)):
            raise InvalidInput(
                f"{name} takes one value for all worlds, got {shown(arguments[name])}; budget "
                "and the camera's faults alone may be a list, one for each"
            )
    given = {name: arguments[name] for name in OF_EACH_WORLD if name in arguments}
    lists = {name: [*value] for name, value in given.items() if _is_list(value)}
    for name, values in lists.items():
        if len(values) != worlds:
            raise InvalidInput(
                f"{name} must be one value, or a list of one for each of {worlds} worlds, got "
                f"{shown(given[name])}"
            )
    return [
        partial(kind, **{**arguments, **{name: values[world] for name, values in lists.items()}})
        for world in range(worlds)
    ]


def models_of(makers: Sequence[Maker]) -> list[ClosedLoopEnv]:
    """The environments, which nobody resets, that show what is fixed about each world: one for all
    whose arguments are alike.
    """
    made: dict[tuple[str, ...], ClosedLoopEnv] = {}
    models = []
    for make in makers:
        # As they are written: True equals 1, and yet is refused where 1 is taken.
        own = tuple(repr(make.keywords.get(name)) for name in OF_EACH_WORLD)
        if own not in made:
            made[own] = make()
        models.append(made[own])
    return models


def autoreset_of(mode: AutoresetMode | str) -> AutoresetMode:
    """Return a mode that may be given by its name. Raises InvalidInput for another name."""
    if isinstance(mode, AutoresetMode):
        return mode
    allowed = [one.value for one in AutoresetMode]
    if mode not in allowed:
        raise InvalidInput(f"autoreset_mode must be one of {', '.join(allowed)}, got {shown(mode)}")
    return AutoresetMode(mode)


def _is_list(value: object) -> bool:
    return isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)


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
