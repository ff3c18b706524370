"""The sensors mounted on the car: the grids of its LiDARs, where these stand, and the cameras."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from care_sim.base.checks import checked_place
from care_sim.base.digests import combined_digest
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.files import parsed_json
from care_sim.core.cells.stack import Grid, GridStack
from care_sim.core.grid import AngularGrid, Place
from care_sim.core.pinhole import PinholeCamera, checked_cameras
from care_sim.core.rig import LIDAR_HEIGHT_M, LIDAR_X_M, MOST_SHIFT_M

LIDAR_POSITION: Place = (LIDAR_X_M, 0.0, LIDAR_HEIGHT_M)
"""Metres in the frame of the car: LIDAR_TOP of nuScenes, the default."""
_LONGEST_NAME = 60
_WITHIN = (-MOST_SHIFT_M, MOST_SHIFT_M), (-MOST_SHIFT_M, MOST_SHIFT_M), (0.1, 10.0)
"""Metres between which a LiDAR on a car stands along x, y and z, which is above the road."""


@dataclass(frozen=True)
class SensorSetup:
    """A LiDAR and its cameras, by name; several LiDARs are made one by `of_lidars`.

    `position` is the LiDAR's x, y and z in the frame of the car: metres before, left of and above
    the point on the road below the car's middle. With several LiDARs it is the place of the first,
    in whose frame the `grid` holds the others. The axes of the sensor frame are those of the car:
    the grid's `heading`, `pitch` and `roll` turn the rays in it. So boxes and cameras stay upright,
    however the LiDAR is mounted. `cameras` are placed in the sensor frame; without any, those of
    the scenario stay where they are on the car. Raises InvalidInput for a value out of its bounds,
    and for a camera that sees nothing of the grid.
    """

    name: str
    grid: Grid = field(default_factory=AngularGrid)
    position: Place = LIDAR_POSITION
    cameras: tuple[PinholeCamera, ...] = ()

    def __post_init__(self) -> None:
        named = isinstance(self.name, str) and self.name.isprintable()
        if not (named and 0 < len(self.name) <= _LONGEST_NAME):
            raise InvalidInput(
                f"name of a sensor set-up must be 1 to {_LONGEST_NAME} printable characters, got "
                f"{shown(self.name)}"
            )
        of = f" of the sensor set-up {self.name}"
        if not isinstance(self.grid, AngularGrid | GridStack):
            raise InvalidInput(
                f"grid{of} must be an AngularGrid or a GridStack, got {shown(self.grid)}"
            )
        position = checked_place(f"the position{of}", self.position, *_WITHIN)
        object.__setattr__(self, "position", position)
        for number, position in enumerate(self.positions[1:], 2):
            checked_place(f"the position of LiDAR {number}{of}", position, *_WITHIN)
        self._check_cameras(of)

    @classmethod
    def of_lidars(
        cls,
        name: str,
        lidars: Sequence[tuple[AngularGrid, Place]],
        cameras: Sequence[PinholeCamera] = (),
    ) -> "SensorSetup":
        """A set-up of one or several LiDARs, each a grid and its x, y and z in the frame of the
        car. `cameras` are placed in the sensor frame, which is that of the first. Raises
        InvalidInput as the set-up and `GridStack` do.
        """
        if not (
            isinstance(lidars, tuple | list)
            and lidars
            and all(isinstance(lidar, tuple | list) and len(lidar) == 2 for lidar in lidars)
        ):
            raise InvalidInput(
                f"lidars of the sensor set-up {name} must be pairs of a grid and a position, got "
                f"{shown(lidars)}"
            )
        (grid, first), *others = lidars
        if not others:
            return cls(name, grid, first, tuple(cameras))
        what = f"a position of the sensor set-up {name}"
        positions = [checked_place(what, position, *_WITHIN) for _, position in lidars]
        places = [between(positions[0], position) for position in positions]
        stack = GridStack(tuple(grid for grid, _ in lidars), tuple(places))
        return cls(name, stack, first, tuple(cameras))

    def to_json(self) -> str:
        """As one line of text, from which `from_json` makes an equal one."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "SensorSetup":
        """Read text back. Raises InvalidInput for anything but a set-up."""
        try:
            plain = parsed_json(text)
            cameras = tuple(PinholeCamera(**camera) for camera in plain.pop("cameras"))
            return cls(grid=grid_of(plain.pop("grid")), cameras=cameras, **plain)
        except (ValueError, TypeError, AttributeError, KeyError) as error:
            raise InvalidInput(f"no text of a sensor set-up ({error})") from error

    @property
    def positions(self) -> tuple[Place, ...]:
        """Where its LiDARs stand in the frame of the car, the first one first; metres."""
        return tuple(_sum(self.position, head.place) for head in self.grid.heads)

    @property
    def label(self) -> str:
        """Its name and its hash, for rigs and weights."""
        return f"{self.name} {self.digest}"

    @cached_property
    def digest(self) -> str:
        """Hash of all but the name."""
        plain = asdict(self)
        del plain["name"]
        # There was a time before grids could be tilted: a level one keeps the hash that it had.
        if isinstance(self.grid, AngularGrid) and not self.grid.is_tilted:
            del plain["grid"]["pitch"], plain["grid"]["roll"]
        return combined_digest([json.dumps(plain)])

    def equipped(self, cameras: Sequence[PinholeCamera]) -> tuple[PinholeCamera, ...]:
        """Its cameras; where it has none those given, which are placed for the default LiDAR and
        stay where they are on the car.
        """
        if self.cameras:
            return self.cameras
        if self.position == LIDAR_POSITION:
            return tuple(cameras)
        return tuple(
            replace(camera, position=between(self.position, on_car(LIDAR_POSITION, camera)))
            for camera in cameras
        )

    def _check_cameras(self, of: str) -> None:
        cameras = checked_cameras(self.cameras, of)
        for number, camera in enumerate(cameras):
            picture = camera.box_rays([[0.0, 0.0, camera.width, camera.height]])
            (seen,) = self.grid.wedges(picture, 0, 0, np.array([camera.position], float))
            if not len(seen):
                raise InvalidInput(f"camera {number}{of} sees nothing of the grid")
        object.__setattr__(self, "cameras", cameras)


def grid_of(plain: dict[str, Any]) -> Grid:
    """The grid of one or several LiDARs from plain data, as `dataclasses.asdict` writes it."""
    if "grids" not in plain:
        return AngularGrid(**plain)
    return GridStack(**plain | {"grids": tuple(AngularGrid(**grid) for grid in plain["grids"])})


def _sum(one: Place, other: Place) -> Place:
    x, y, z = (float(a + b) for a, b in zip(one, other, strict=True))
    return x, y, z


def on_car(lidar: Place, camera: PinholeCamera) -> Place:
    """Where a camera stands in the frame of the car, whose LiDAR is at `lidar`."""
    return _sum(lidar, camera.position)


def between(lidar: Place, other: Place) -> Place:
    """The way from the LiDAR to a camera or another LiDAR, both in the frame of the car."""
    x, y, z = (b - a for a, b in zip(lidar, other, strict=True))
    return x, y, z
