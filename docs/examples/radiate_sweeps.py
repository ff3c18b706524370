"""A sequence of RADIATE as a folder that `sweeps:FOLDER` reads.

    python docs/examples/radiate_sweeps.py RADIATE/tiny_foggy tiny_foggy
    care-sim protocol --source sweeps:tiny_foggy

Sweeps are HDL-32, with x to the right and y ahead; they are turned, so that x is ahead.
GPS gives the poses. Its clock is another one: both logs begin together.
"""

import re
import sys
from pathlib import Path

import numpy as np

DEGREE_M = 111_320.0  # along a meridian
HEIGHT_M = 2.03  # of the LiDAR above the road, measured in its sweeps
YAW_DEG = -91  # of its x axis; this fits best
SETUP = f"""name = "radiate"

[lidar]
columns = 512
rows = 32
top_deg = 10.67
bottom_deg = -30.67
range_m = 50.0
position_m = [0.0, 0.0, {HEIGHT_M}]
"""


def stamps(path: Path) -> dict[int, float]:
    """Frame numbers and their times, seconds."""
    found = re.findall(r"Frame: (\d+) Time: ([\d.]+)", path.read_text())
    return {int(frame): float(time) for frame, time in found}


def poses(folder: Path) -> np.ndarray:
    """(n, 5) seconds from the first, x to the east, y to the north, 0, yaw along the way."""
    times = stamps(folder / "GPS_IMU_Twist.txt")
    fixes = [
        np.genfromtxt(folder / "GPS_IMU_Twist" / f"{frame:06d}.txt", delimiter=",", max_rows=1)
        for frame in [*times][::2]  # Each fix is there twice.
    ]
    latitudes, longitudes, _ = np.array(fixes).T
    # Fixes come evenly. Some of their stamps are 0.4 s early.
    seconds = np.linspace(0, max(times.values()) - min(times.values()), len(fixes))
    east = (longitudes - longitudes[0]) * DEGREE_M * np.cos(np.radians(latitudes[0]))
    north = (latitudes - latitudes[0]) * DEGREE_M
    # A second of the way, so that centimetres of noise do not turn the car.
    way = 10
    after, before = (np.clip(np.arange(len(east)) + step, 0, len(east) - 1) for step in (way, -way))
    yaw = np.arctan2(north[after] - north[before], east[after] - east[before])
    return np.column_stack([seconds, east, north, np.zeros(len(east)), yaw])


def convert(folder: Path, out: Path) -> None:
    """Write the folder."""
    (out / "sweeps").mkdir(parents=True)
    # Some frames have no line. The LiDAR turns evenly, so a straight line gives them all.
    told = stamps(folder / "velo_lidar.txt")
    period, start = np.polyfit([*told], [*told.values()], 1)
    sweeps = sorted((folder / "velo_lidar").glob("*.csv"))
    first = start + period * int(sweeps[0].stem)
    cos, sin = np.cos(np.radians(YAW_DEG)), np.sin(np.radians(YAW_DEG))
    for path in sweeps:
        time = start + period * int(path.stem)
        x, y, z, *_ = np.loadtxt(path, delimiter=",").T
        turned = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        np.save(out / "sweeps" / f"{time:.6f}.npy", turned)
    table = poses(folder)
    table[:, 0] += first
    np.savetxt(
        out / "poses.csv", table, "%.6f", delimiter=",", header="time,x,y,z,yaw", comments=""
    )
    (out / "sensor.toml").write_text(SETUP)


if __name__ == "__main__":
    convert(*map(Path, sys.argv[1:]))
