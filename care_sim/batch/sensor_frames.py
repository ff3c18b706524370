"""The frames of the LiDARs of all worlds, as `care_sim.core.frames` has that of one."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.batch.state import BatchState, Sensors
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import mounted_at, placed_at, seen_from


def place_sensors(state: BatchState, at: tuple[float, float, float]) -> None:
    """Write where the sensors are, which are mounted `at` (x, y, z) on the egos."""
    x, y, yaw = state.bodies.boxes[np.arange(state.worlds), state.egos.bodies][:, [0, 1, 6]].T
    sensors = state.sensors
    cos, sin = np.cos(yaw), np.sin(yaw)
    sensors.turns[:, 0], sensors.turns[:, 1] = cos, sin
    sensors.turns_back[:, 0], sensors.turns_back[:, 1] = np.cos(-yaw), np.sin(-yaw)
    sensors.poses[:, 0], sensors.poses[:, 1] = mounted_at((x, y), (cos, sin), at)
    sensors.poses[:, 2], sensors.poses[:, 3] = at[2], yaw


@compiled()
def seen_by(sensors: Sensors, world: int, boxes: Floats) -> Floats:
    """Boxes (n, 7) of a world in the frame of its sensor."""
    x, y, z, yaw, _, _ = sensors.poses[world]
    cos, sin = sensors.turns_back[world]
    return seen_from(boxes, (cos, sin), (x, y, z, yaw))


@compiled()
def placed_by(sensors: Sensors, world: int, boxes: Floats) -> Floats:
    """Boxes (n, 7) in the frame of a world's sensor, in the world."""
    x, y, z, yaw, _, _ = sensors.poses[world]
    cos, sin = sensors.turns[world]
    return placed_at(boxes, (cos, sin), (x, y, z, yaw))


@compiled()
def seen_by_each(sensors: Sensors, worlds: Integers, boxes: Floats) -> Floats:
    """Boxes (n, 7), one of each of some `worlds` (n,), each in the frame of the sensor there."""
    seen = np.empty_like(boxes)
    for n in range(len(worlds)):
        seen[n] = seen_by(sensors, worlds[n], boxes[n : n + 1])[0]
    return seen
