"""Writes small logs in the public layout of the Argoverse 2 Sensor Dataset."""

import pyarrow as pa
from pyarrow import feather
from scipy.spatial.transform import Rotation

START_NS, SWEEP_NS = 315_000_000_000_000_000, 100_000_000


def turn(yaw=0.0, pitch=0.0, roll=0.0):
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    return {"qw": w, "qx": x, "qy": y, "qz": z}


def box(category, place, size=(4.0, 2.0, 1.5), yaw=0.0, track=None, points=10, **angles):
    """An annotation of one sweep, in the car's frame."""
    keys = dict(
        zip(
            ("tx_m", "ty_m", "tz_m", "length_m", "width_m", "height_m"),
            (*place, *size),
            strict=True,
        )
    )
    keys |= {"track_uuid": track or category, "category": category, "num_interior_pts": points}
    return keys | turn(yaw, **angles)


def at(x=0.0, y=0.0, z=0.0, **angles):
    """A pose of the car in the city."""
    return {"tx_m": 1000.0 + x, "ty_m": -500.0 + y, "tz_m": 60.0 + z} | turn(**angles)


def stamp(sweep):
    return START_NS + sweep * SWEEP_NS


def write(folder, sweeps, poses, name="annotations.feather"):
    """`sweeps[n]` are the boxes of sweep n, `poses[n]` the car's pose at it."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [{"timestamp_ns": stamp(n), **row} for n, boxes in enumerate(sweeps) for row in boxes]
    feather.write_feather(pa.Table.from_pylist(rows), folder / name)
    cars = [{"timestamp_ns": stamp(n), **row} for n, row in enumerate(poses)]
    feather.write_feather(pa.Table.from_pylist(cars), folder / "city_SE3_egovehicle.feather")
    return folder


def rewrite(path, change):
    """Change the table of a Feather file."""
    feather.write_feather(change(feather.read_table(path, memory_map=False)), path)


def replaced(table, name, values):
    return table.set_column(table.column_names.index(name), name, pa.array(values))


CAR_AHEAD = box("REGULAR_VEHICLE", (15.0, 0.0, 0.42), track="a")
"""Stands on the road: its bottom 0.33 m under the rear axle."""
HERE = at()


def parked(folder, *boxes, pose=HERE, sweeps=1):
    return write(folder, [boxes] * sweeps, [pose] * sweeps)
