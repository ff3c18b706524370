"""The fixed settings of the sensing task: grid, cameras, budget, margins."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from care_sim.base.checks import bounded, check_fields, check_whole, one_of
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.allocation import budget_cells, stages_of
from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief, Observation
from care_sim.core.cells.order import SetMargins, reordered
from care_sim.core.cells.rays import MOST_COLUMNS, MOST_ROWS
from care_sim.core.cells.sets import CellSets
from care_sim.core.cells.stack import Grid, GridStack
from care_sim.core.conditions import RAYS, FilmedReturns
from care_sim.core.defaults import (
    AS_DEMANDED,
    AZIMUTH_MARGIN,
    CELL_ORDERS,
    CELLS,
    ELEVATION_MARGIN,
    RESERVE_FRACTION,
)
from care_sim.core.firing.base import Hardware
from care_sim.core.firing.listing import hardware_of, settled
from care_sim.core.grid import AT_LIDAR_M, AngularGrid, Cells
from care_sim.core.pinhole import MountedCameras, PinholeCamera, checked_cameras, mounted_cameras
from care_sim.core.types import Demand, ImageDetections

LIDAR_X_M = -0.445
"""Place of the LiDAR before the car's middle: LIDAR_TOP of nuScenes, 0.94 m before the rear axle of
a Renault Zoe."""
LIDAR_HEIGHT_M = 1.84
"""Height of the LiDAR above the road: LIDAR_TOP of nuScenes."""
MOST_SHIFT_M = 20.0
"""A LiDAR lies within this of the middle of its car."""


@dataclass(frozen=True)
class Rig:
    """The fixed settings of the sensing task, which a policy knows in advance.

    `budget` is B in cells and `reserve_fraction` rho of Algorithm 1; `keyframe_s` is the time
    between two decisions. Hulls and wedges are dilated by `azimuth_margin` columns and
    `elevation_margin` rows. The LiDAR, of several the first, stands `sensor_height_m` above the
    road, `sensor_x_m` before and `sensor_y_m` left of the car's middle. The sets that a policy
    demands are listed in a `cell_order` (`care_sim.core.cells.order.CELL_ORDERS`) before cells are
    chosen. `firing` names the hardware that fires them (`care_sim.core.firing`), and `returns` how
    their pulses return, without crosstalk. `setup` names the set-up and its hash
    (`care_sim.core.sensor_setup`); nothing of recordings, and of rigs that were made without one.
    Raises InvalidInput for a value out of its bounds.
    """

    grid: Grid = field(default_factory=AngularGrid)
    cameras: tuple[PinholeCamera, ...] = ()
    budget: int = bounded(budget_cells(0.1, AngularGrid().size), 0, MOST_COLUMNS * MOST_ROWS)
    reserve_fraction: float = bounded(RESERVE_FRACTION, 0, 1)
    keyframe_s: float = bounded(0.1, 0.001, 60)
    azimuth_margin: int = bounded(AZIMUTH_MARGIN, 0, MOST_COLUMNS)
    elevation_margin: int = bounded(ELEVATION_MARGIN, 0, MOST_ROWS)
    sensor_height_m: float = bounded(LIDAR_HEIGHT_M, 0, 100)
    cell_order: str = one_of(AS_DEMANDED, CELL_ORDERS)
    firing: str = CELLS
    sensor_x_m: float = bounded(LIDAR_X_M, -MOST_SHIFT_M, MOST_SHIFT_M)
    sensor_y_m: float = bounded(0.0, -MOST_SHIFT_M, MOST_SHIFT_M)
    returns: FilmedReturns = RAYS
    setup: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        check_fields(self)
        if not isinstance(self.grid, AngularGrid | GridStack):
            raise InvalidInput(
                f"grid must be an AngularGrid or a GridStack, got {shown(self.grid)}"
            )
        object.__setattr__(self, "firing", settled(self.firing))
        if not isinstance(self.returns, FilmedReturns):
            raise InvalidInput(f"returns must be FilmedReturns, got {shown(self.returns)}")
        # A list could change later, unlike what has been computed from it and kept.
        object.__setattr__(self, "cameras", checked_cameras(self.cameras))

    @cached_property
    def sensor_position(self) -> tuple[float, float, float]:
        """The LiDAR's x, y and z in the frame of the car, whose origin lies on the road below its
        middle; metres.
        """
        return self.sensor_x_m, self.sensor_y_m, self.sensor_height_m

    def read(self, observation: Observation) -> Belief:
        """The belief of an observation. Raises InvalidInput for one of another grid or other
        cameras.
        """
        belief = Belief.from_observation(observation)
        if belief.ranges.shape != self.grid.shape:
            raise InvalidInput(
                f"ranges of an observation must be {self.grid.shape}, got {belief.ranges.shape}"
            )
        self.check_cameras(belief.detections)
        return belief

    def check_cameras(self, detections: ImageDetections) -> None:
        """Raise InvalidInput for detections of other cameras."""
        count, numbers = len(self.cameras), detections.cameras
        if numbers.min(initial=0) < 0 or numbers.max(initial=-1) >= count:
            raise InvalidInput(f"detections of an observation must be of cameras 0 to {count - 1}")

    @cached_property
    def hardware(self) -> Hardware:
        """The hardware of the LiDAR, which limits its cells. Raises InvalidInput for units that do
        not divide the grid.
        """
        return hardware_of(self.firing, self.grid)

    @cached_property
    def camera_models(self) -> MountedCameras:
        """The cameras as the table of one car."""
        return mounted_cameras(1, self.cameras)

    @cached_property
    def wedge_starts(self) -> Floats | None:
        """(k, 3) the places of the cameras, as `AngularGrid.wedges` takes them; None where all
        count as standing at the one LiDAR.
        """
        places = self.camera_models.mounts[0, :, 0].copy()
        apart = np.linalg.norm(places, axis=1) > AT_LIDAR_M
        return places if len(self.grid.heads) > 1 or apart.any() else None

    def hulls(self, boxes: Floats, azimuth_margins: Integers | None = None) -> CellSets:
        """The cells of sensor-frame boxes (n, 7), one ascending array per box. They are dilated by
        the rig's margins, or by `azimuth_margins` (n,) columns and the rig's rows.
        """
        azimuth = self.azimuth_margin if azimuth_margins is None else azimuth_margins
        return self.grid.hulls(boxes, azimuth, self.elevation_margin)

    def in_cell_order(self, demand: Demand) -> Demand:
        """The demand with all its sets listed in the rig's `cell_order`.

        `core-spread` takes every set for one that was dilated by the rig's margins. Raises
        InvalidInput for another form of demand, and for a cell that the grid does not have.
        """
        if self.cell_order == AS_DEMANDED:
            return demand
        exploitation, *layers = map(self.listed, stages_of(demand))
        return Demand(exploitation, layers, demand.shots)

    def listed(
        self, sets: Sequence[Cells], usual: str = AS_DEMANDED, most: int | None = None
    ) -> CellSets:
        """The sets, the cells of each listed in the rig's `cell_order`; in the `usual` one where
        the rig's is `as-demanded`. Only the first `most` cells of each, if it is given.

        Raises InvalidInput for another order, and for a cell that the grid does not have.
        """
        if most is not None:
            check_whole("most", most, 0)
        order = usual if self.cell_order == AS_DEMANDED else self.cell_order
        if order == AS_DEMANDED:
            given = CellSets.of(sets)
            return given if most is None else given.part(0, most)
        margins = SetMargins(self.azimuth_margin, self.elevation_margin)
        return reordered(sets, order, self.grid, margins, most)
