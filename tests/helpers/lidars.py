"""A small set-up of three LiDARs, for tests that go through all cells of it."""

import numpy as np

from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import SensorSetup

DEGREE = np.pi / 180
ROOF = AngularGrid(64, 8, 6 * DEGREE, -22 * DEGREE)
LEFT = AngularGrid.of_elevations(
    [angle * DEGREE for angle in (4, 1, 0, -2)],
    64,
    80.0,
    field_of_view=120 * DEGREE,
    heading=50 * DEGREE,
)
RIGHT = AngularGrid(
    64,
    4,
    4 * DEGREE,
    -5 * DEGREE,
    80.0,
    120 * DEGREE,
    -50 * DEGREE,
    pitch=-3 * DEGREE,
    roll=2 * DEGREE,
)
CORNERS = SensorSetup.of_lidars(
    "corners",
    [(ROOF, (-0.4, 0.0, 1.8)), (LEFT, (1.9, 0.65, 0.5)), (RIGHT, (1.9, -0.65, 0.5))],
)
"""All round on the roof, and a shorter one at either corner of the bumper, the right one tilted."""
STACK = CORNERS.grid
