"""What a detector gets where a film serves the sweeps between its keyframes: the mask of a keyframe
is held over them, up to the next one (paper, Sec. 3).
"""

from dataclasses import replace

import numpy as np

from care_sim.core.grid import Cells
from care_sim.loops.film import Shot
from care_sim.sensors.annotated import Cloud, joined
from care_sim.sensors.lidar import RecordedLidar


def with_sweeps(returned: Cloud, lidar: RecordedLidar, held: Cells, shot: Shot) -> Cloud:
    """The returns of a keyframe, and those of the sweeps before it, which fired the cells `held` by
    the mask of the keyframe before.

    All are in the sensor frame of the keyframe: the motion of the car is compensated, that of
    others is not. Each has its time, seconds from the keyframe, 0 or less. Without sweeps the
    returns of the keyframe are as they were.
    """
    if not shot.sweeps:
        return returned
    clouds = [replace(returned, times=np.zeros(len(returned)))]
    for sweep in shot.sweeps:
        # Cells are those of the sensor as it stood then; faults are drawn for every sweep.
        own = lidar.fire(held, sweep.cloud)
        points = shot.sensor.points_of(sweep.sensor, own.points)
        times = np.full(len(own), sweep.time_s - shot.time_s)
        clouds.append(replace(own, points=points, times=times))
    return joined(clouds)
