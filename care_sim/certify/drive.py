"""A recorded drive that needs no download: an Argoverse 2 log of five seconds, written when it is
needed.
"""

from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import feather

_LOG = "certified-drive"
_SWEEPS = 50
_SWEEP_S = 0.1
_START_NS = 315_000_000_000_000_000
_AHEAD = {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
_ACROSS = {"qw": 0.8, "qx": 0.0, "qy": 0.0, "qz": -0.6}
"""A turn to the right by 74 degrees: cos and sin of half of it are 0.8 and 0.6 exactly."""


def write_drive(folder: Path) -> str:
    """Write the log below `folder`; returns the source of recordings that names it.

    The car drives 5 m/s past a van, parked cars and an oncoming bus; halfway a person steps out
    from behind the van, and a bicycle comes after.
    """
    log = folder / _LOG
    log.mkdir(parents=True)
    boxes = [box for sweep in range(_SWEEPS) for box in _boxes(sweep)]
    poses = [
        {"timestamp_ns": _stamp(n), "tx_m": 1000.0 + 0.5 * n, "ty_m": -500.0, "tz_m": 60.0} | _AHEAD
        for n in range(_SWEEPS)
    ]
    feather.write_feather(pa.Table.from_pylist(boxes), log / "annotations.feather")
    feather.write_feather(pa.Table.from_pylist(poses), log / "city_SE3_egovehicle.feather")
    return f"argoverse2:{folder}"


def _boxes(sweep: int) -> list[dict[str, Any]]:
    """What stands and moves at a sweep, in the frame of the car."""
    # The car drives 0.5 m per sweep, so that what stands still comes nearer by as much.
    ahead = 30.0 - 0.5 * sweep
    bus_ahead = ahead + 25.0 - 0.6 * sweep
    person_y, bicycle_y = -4.0 + 0.13 * (sweep - 20), 6.0 - 0.3 * (sweep - 30)
    bodies: list[tuple[str, str, tuple[float, ...], tuple[float, ...], dict[str, float]]] = [
        ("BOX_TRUCK", "van", (ahead, -4.0, 0.9), (6.0, 2.2, 2.6), _AHEAD),
        ("REGULAR_VEHICLE", "parked", (ahead + 9.0, -4.2, 0.42), (4.4, 1.9, 1.5), _AHEAD),
        ("REGULAR_VEHICLE", "parked behind", (ahead + 15.5, -4.1, 0.42), (4.2, 1.8, 1.5), _AHEAD),
        ("BUS", "oncoming", (bus_ahead, 3.7, 1.2), (11.0, 2.6, 3.2), _AHEAD),
        ("PEDESTRIAN", "person", (ahead + 5.0, person_y, 0.6), (0.6, 0.7, 1.8), _ACROSS),
        ("BICYCLE", "bicycle", (ahead + 12.0, bicycle_y, 0.4), (1.8, 0.6, 1.4), _ACROSS),
    ]
    begins = {"person": 20, "bicycle": 30}
    return [
        {
            "timestamp_ns": _stamp(sweep),
            "track_uuid": track,
            "category": category,
            "num_interior_pts": 10,
            **dict(zip(("tx_m", "ty_m", "tz_m"), place, strict=True)),
            **dict(zip(("length_m", "width_m", "height_m"), size, strict=True)),
            **turn,
        }
        for category, track, place, size, turn in bodies
        if sweep >= begins.get(track, 0)
    ]


def _stamp(sweep: int) -> int:
    return _START_NS + round(sweep * _SWEEP_S * 1e9)
