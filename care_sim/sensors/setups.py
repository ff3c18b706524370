"""Sensor set-ups by name or TOML file.

`docs/sensors.md` lists the tables and keys of a file. Lengths are metres and angles degrees. Places
are in the frame of the car (x forward, y left, z up; its origin is on the road below the car's
middle).
"""

import tomllib
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.checks import check_arguments, check_number, check_path
from care_sim.base.digests import content_digest
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.cells.rays import LEAST_VIEW, MOST_TILT
from care_sim.core.grid import AngularGrid, Place
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION, SensorSetup, between

DEFAULT_SETUP = "hdl-32e"
"""The set-up of the paper's data, and the default."""
Sensor = str | PathLike[str] | SensorSetup
"""A set-up, its name, or a TOML file of one."""

_SHIPPED = Path(__file__).parent / "shipped"
_LEAST_VIEW_DEG = round(float(np.rad2deg(LEAST_VIEW)), 6)
_MOST_TILT_DEG = round(float(np.rad2deg(MOST_TILT)), 6)
_FOV_DEG = (0.06, 179.9)
"""Angles that `care_sim.core.pinhole.PinholeCamera` allows, in whole hundredths of a degree."""
_TABLES = ("name", "lidar", "lidars", "cameras")
_EQUAL_ROWS = ("rows", "top_deg", "bottom_deg")
_LIDAR = (
    "columns",
    *_EQUAL_ROWS,
    "elevations_deg",
    "range_m",
    "field_of_view_deg",
    "position_m",
    "yaw_deg",
    "pitch_deg",
    "roll_deg",
)
_CAMERA = (
    "width",
    "height",
    "horizontal_fov_deg",
    "position_m",
    "yaw_deg",
    "pitch_deg",
    "roll_deg",
)


@cache
def setup_names() -> tuple[str, ...]:
    """The set-ups that come with the package, the default first."""
    names = sorted(path.stem for path in _SHIPPED.glob("*.toml"))
    return tuple(sorted(names, key=lambda name: name != DEFAULT_SETUP))


def sensor_setup(sensor: Sensor) -> SensorSetup:
    """Return the set-up of a name or of the path of a TOML file.

    Raises InvalidInput for a name that is unknown, a file that is missing or no set-up, and a
    set-up that does not fit together.
    """
    if isinstance(sensor, SensorSetup):
        return sensor
    check_path("sensor", sensor)
    if sensor in setup_names():
        return _read(_SHIPPED / f"{sensor}.toml")
    path = Path(sensor)
    if path.suffix != ".toml":
        raise InvalidInput(
            f"unknown sensor {shown(str(sensor))}; known: {', '.join(setup_names())}, or a .toml "
            "file of a set-up"
        )
    if not path.is_file():
        raise InvalidInput(f"sensor {path}: no such file")
    return _read(path)


def setup_of_columns(row: Mapping[str, Any]) -> str | SensorSetup:
    """Return the set-up that `sensor_columns` describe. Raises InvalidInput for one that does not
    come with this version where the columns do not hold it, and for one of another hash.
    """
    name, digest = row.get("sensor"), row.get("sensor_hash")
    if name is None:
        return DEFAULT_SETUP
    if text := row.get("sensor_setup"):
        setup = SensorSetup.from_json(text)
        if setup.digest != digest:
            raise InvalidInput(
                f"the sensor set-up {name} has the hash {setup.digest}, not {digest}"
            )
        return setup
    if name in setup_names() and sensor_setup(name).digest == digest:
        return sensor_setup(name)
    raise InvalidInput(f"the sensor set-up {name} {digest} does not come with this version")


def setup_lines() -> list[str]:
    """One line per set-up that comes with the package: its name, grid, reach and cameras."""
    lines = []
    for setup in map(sensor_setup, setup_names()):
        lidars = "; ".join(_rays_line(head.grid) for head in setup.grid.heads)
        cameras = f"{len(setup.cameras)} of its own" if setup.cameras else "the scenario's"
        lines.append(f"{setup.name:14} {lidars}; cameras: {cameras}")
    return lines


def sensor_columns(sensor: Sensor) -> dict[str, str]:
    """Return the columns of a row that identify its set-up by name and hash, and store one that
    does not come with the package. The default set-up has no columns, so that older rows keep their
    digests.
    """
    # The name alone is enough for nearly every row, and a set-up is compared number by number.
    if sensor == DEFAULT_SETUP:
        return {}
    setup = sensor_setup(sensor)
    if setup == sensor_setup(DEFAULT_SETUP):
        return {}
    told = {"sensor": setup.name, "sensor_hash": setup.digest}
    shipped = setup.name in setup_names() and sensor_setup(setup.name) == setup
    return told if shipped else told | {"sensor_setup": setup.to_json()}


def _rays_line(grid: AngularGrid) -> str:
    rows = f"{np.rad2deg(grid.top):+.4g} to {np.rad2deg(grid.bottom):+.4g} degrees"
    around = f"{np.rad2deg(grid.field_of_view):.4g} degrees"
    return f"{grid.columns} columns in {around}, {grid.rows} rows from {rows}, {grid.range_m:g} m"


def _read(path: Path) -> SensorSetup:
    return _read_once(path, content_digest(path))


# Every row of a study looks the set-up up. A rewritten file has another digest.
@lru_cache(maxsize=32)
def _read_once(path: Path, _digest: str) -> SensorSetup:
    try:
        plain = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidInput(f"sensor {path}: no TOML ({' '.join(str(error).split())})") from error
    try:
        return _setup_of(plain)
    except InvalidInput as error:
        raise InvalidInput(f"sensor {path}: {error}") from error


def _setup_of(plain: Mapping[str, Any]) -> SensorSetup:
    check_arguments("a set-up", plain, _TABLES)
    lidars = _lidars(plain)
    (_, position), *_ = lidars
    cameras = [
        _camera(_table("cameras", camera, _CAMERA), position)
        for camera in _tables(plain, "cameras")
    ]
    if "name" not in plain:
        raise InvalidInput("name is missing, a text by which rows and tables tell the set-up")
    return SensorSetup.of_lidars(plain["name"], lidars, cameras)


def _lidars(plain: Mapping[str, Any]) -> list[tuple[AngularGrid, Place]]:
    """The grid of each LiDAR, and its place in the frame of the car."""
    if "lidars" not in plain:
        lidar = _table("lidar", plain.get("lidar", {}), _LIDAR)
        return [(_grid(lidar), _position("lidar", lidar))]
    if "lidar" in plain:
        raise InvalidInput("a set-up has either [lidar] or [[lidars]], got both")
    lidars = [_table("lidars", lidar, _LIDAR) for lidar in _tables(plain, "lidars")]
    if not lidars:
        raise InvalidInput("lidars must be one table or more, each [[lidars]], got none")
    return [(_grid(lidar), _position("lidars", lidar)) for lidar in lidars]


def _tables(plain: Mapping[str, Any], name: str) -> list[Any]:
    tables = plain.get(name, [])
    if not isinstance(tables, list):
        raise InvalidInput(f"{name} must be tables, each [[{name}]]")
    return tables


def _grid(lidar: Mapping[str, Any]) -> AngularGrid:
    usual = AngularGrid()
    given = {
        "columns": lidar.get("columns", usual.columns),
        "range_m": lidar.get("range_m", usual.range_m),
        "field_of_view": _radians(lidar, "field_of_view_deg", 360.0, _LEAST_VIEW_DEG, 360),
        "heading": _radians(lidar, "yaw_deg", 0.0, -180, 180),
        "pitch": _radians(lidar, "pitch_deg", 0.0, -_MOST_TILT_DEG, _MOST_TILT_DEG),
        "roll": _radians(lidar, "roll_deg", 0.0, -_MOST_TILT_DEG, _MOST_TILT_DEG),
    }
    if "elevations_deg" in lidar:
        if twice := [name for name in _EQUAL_ROWS if name in lidar]:
            raise InvalidInput(f"elevations_deg says all of the rows, so leave out {twice[0]}")
        elevations = _descending(lidar["elevations_deg"])
        return AngularGrid.of_elevations([float(np.deg2rad(one)) for one in elevations], **given)
    if missing := [name for name in _EQUAL_ROWS if name not in lidar]:
        raise InvalidInput(
            f"{missing[0]} of lidar is missing, or elevations_deg for rows of unequal steps"
        )
    top, bottom = (_radians(lidar, name, 0.0, -90, 90) for name in ("top_deg", "bottom_deg"))
    if bottom >= top:
        raise InvalidInput(
            f"bottom_deg must lie below top_deg, {lidar['top_deg']:g}, got {lidar['bottom_deg']:g}"
        )
    return AngularGrid(rows=lidar["rows"], top=top, bottom=bottom, **given)


def _descending(elevations: Any) -> list[float]:
    """The elevations of rows, degrees. Raises InvalidInput unless they go down from the top."""
    if not isinstance(elevations, list):
        raise InvalidInput(f"elevations_deg must be a list, got {shown(elevations)}")
    for elevation in elevations:
        check_number("elevations_deg", elevation, -90, 90)
    for above, below in pairwise(elevations):
        if above <= below:
            raise InvalidInput(f"elevations_deg must descend, got {below:g} after {above:g}")
    return elevations


def _camera(camera: Mapping[str, Any], lidar: Place) -> PinholeCamera:
    usual = PinholeCamera()
    turns = ("yaw", "pitch", "roll")
    angles = {name: _radians(camera, f"{name}_deg", 0.0, -360, 360) for name in turns}
    return PinholeCamera(
        camera.get("width", usual.width),
        camera.get("height", usual.height),
        _radians(camera, "horizontal_fov_deg", 90.0, *_FOV_DEG),
        between(lidar, _position("cameras", camera)),
        **angles,
    )


def _table(name: str, table: object, known: tuple[str, ...]) -> Mapping[str, Any]:
    if not isinstance(table, dict):
        raise InvalidInput(f"{name} must be a table, got {shown(table)}")
    check_arguments(name, table, known)
    return table


def _position(name: str, table: Mapping[str, Any]) -> Place:
    if "position_m" not in table and name == "lidar":
        return LIDAR_POSITION
    if "position_m" not in table:
        raise InvalidInput(f"position_m of {name} is missing: [x, y, z] in metres, from the car")
    position = table["position_m"]
    if not (isinstance(position, list) and len(position) == 3):
        raise InvalidInput(f"position_m of {name} must be [x, y, z], got {shown(position)}")
    for metres in position:
        check_number(f"position_m of {name}", metres, -100, 100)
    x, y, z = map(float, position)
    return x, y, z


def _radians(table: Mapping[str, Any], name: str, usual: float, least: float, most: float) -> float:
    """An angle of a table, which is checked in degrees: in these the file has it."""
    degrees = table.get(name, usual)
    check_number(name, degrees, least, most)
    return float(np.deg2rad(degrees))
