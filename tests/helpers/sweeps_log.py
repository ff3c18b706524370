"""A log without labels: a car drives past what stands, and past one who walks into view."""

import numpy as np

HEIGHT_M = 1.84
"""Height of the default set-up's LiDAR above the road; it is mounted 0.445 m behind the middle."""
SPEED_MPS = 6.0
START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000
STANDING = {"car": (18.0, 5.0, 4.6, 1.9, 1.6), "van": (9.0, -6.0, 5.3, 2.0, 2.2)}
"""Middle on the road, length, width and height."""
WALKER = (14.0, -3.0, 0.7, 0.7, 1.8)
APPEARS_S = 1.5
SECONDS = 4.0


def stamps(seconds=SECONDS):
    return START_NS + STEP_NS * np.arange(round(seconds * 10) + 1)


def sweep(time_s):
    """(n, 3) points in the LiDAR's frame: x ahead, y left, z up."""
    boxes = [*STANDING.values(), *([WALKER] if time_s >= APPEARS_S else [])]
    at = np.array([SPEED_MPS * time_s - 0.445, 0.0, HEIGHT_M])
    parts = [_road()] + [_sides(*box) - at for box in boxes]
    return np.concatenate(parts)


def _road():
    ranges, angles = np.meshgrid(np.geomspace(3, 45, 25), np.linspace(-np.pi, np.pi, 180))
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    return np.stack([x, y, np.full_like(x, -HEIGHT_M)], axis=-1).reshape(-1, 3)


def _sides(x, y, length, width, height):
    """Points every 0.15 m on the sides of a box."""
    around = np.concatenate(
        [
            [
                (a, side * width / 2)
                for side in (-1, 1)
                for a in np.arange(-length / 2, length / 2, 0.15)
            ],
            [
                (end * length / 2, b)
                for end in (-1, 1)
                for b in np.arange(-width / 2, width / 2, 0.15)
            ],
        ]
    )
    heights = np.arange(0.1, height, 0.15)
    plan = np.repeat(around + np.array([x, y]), len(heights), axis=0)
    return np.column_stack([plan, np.tile(heights, len(around))])


def write_log(folder, form="npy", points_of=sweep, seconds=SECONDS):
    """Write the log as `sweeps:FOLDER` reads it; returns the folder."""
    (folder / "sweeps").mkdir(parents=True)
    for stamp in stamps(seconds):
        points = points_of((stamp - START_NS) * 1e-9)
        FORMS[form](folder / "sweeps" / str(stamp), points)
    times = stamps(seconds) / 1e9
    write_poses(folder, np.stack([times, (times - times[0]) * SPEED_MPS]))
    return folder


def write_poses(folder, rows):
    lines = [f"{time:.6f},{x:.6f},0,0,0" for time, x in rows.T]
    (folder / "poses.csv").write_text("\n".join(["time,x,y,z,yaw", *lines]) + "\n")


def _npy(path, points):
    np.save(f"{path}.npy", points)


def _csv(path, points):
    np.savetxt(f"{path}.csv", points, "%.6f", ",", header="x,y,z", comments="")


def _headless(path, points):
    table = np.column_stack([points, np.ones((len(points), 2))])
    np.savetxt(f"{path}.csv", table, "%.6f", ",")


def _kitti(path, points):
    table = np.column_stack([points, np.full(len(points), 0.3)])
    path.with_name(f"{path.name}.bin").write_bytes(table.astype("<f4").tobytes())


def _nuscenes(path, points):
    table = np.column_stack([points, np.full(len(points), 0.3), np.arange(len(points)) % 32])
    path.with_name(f"{path.name}.bin").write_bytes(table.astype("<f4").tobytes())


def pcd_header(count, data, fields="x y z", sizes="4 4 4", types="F F F", counts="1 1 1"):
    return (
        f"# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS {fields}\nSIZE {sizes}\n"
        f"TYPE {types}\nCOUNT {counts}\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {count}\nDATA {data}\n"
    )


def _ascii(path, points):
    lines = "\n".join(" ".join(f"{value:.6f}" for value in point) for point in points)
    header = pcd_header(len(points), "ascii")
    path.with_name(f"{path.name}.pcd").write_text(header + lines + "\n")


def _binary(path, points):
    # Padding and an unused field before x, and rays without a return, as PCL writes them.
    table = np.zeros(
        len(points) + 2, [("_", "u1", 4), ("ring", "<u2"), ("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    )
    missing = np.full((2, 3), np.nan)
    table["x"], table["y"], table["z"] = np.concatenate([missing, points]).T
    header = pcd_header(len(table), "binary", "_ ring x y z", "1 2 4 4 4", "U U F F F", "4 1 1 1 1")
    path.with_name(f"{path.name}.pcd").write_bytes(header.encode() + table.tobytes())


FORMS = {
    "npy": _npy,
    "csv": _csv,
    "headless": _headless,
    "kitti": _kitti,
    "nuscenes": _nuscenes,
    "ascii": _ascii,
    "binary": _binary,
}
