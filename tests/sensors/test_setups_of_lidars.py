"""Sensor set-ups of several LiDARs: as objects, as files, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION, SensorSetup
from care_sim.policies.learned.weights import Card, load_weights, save_weights
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.sensors.setups import (
    DEFAULT_SETUP,
    sensor_columns,
    sensor_setup,
    setup_lines,
    setup_of_columns,
)
from tests.helpers.lidars import CORNERS, LEFT, RIGHT, ROOF, STACK

TWO = """
name = "two"

[[lidars]]
columns = 64
rows = 8
top_deg = 6.0
bottom_deg = -22.0
position_m = [-0.4, 0.0, 1.8]

[[lidars]]
columns = 64
elevations_deg = [4.0, 1.0, 0.0, -2.0]
field_of_view_deg = 120.0
yaw_deg = 50.0
range_m = 80.0
position_m = [1.9, 0.65, 0.5]

[[cameras]]
position_m = [0.3, 0.0, 1.5]
"""


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "two.toml"
        path.write_text(text)
        return sensor_setup(path)

    return read


def test_a_file_holds_several_lidars_in_the_frame_of_the_car(read):
    setup = read(TWO)
    assert setup.position == (-0.4, 0.0, 1.8)
    assert setup.positions[1] == pytest.approx((1.9, 0.65, 0.5))
    first, second = setup.grid.heads
    assert first.grid == replace(ROOF, top=first.grid.top, bottom=first.grid.bottom)
    assert np.rad2deg(second.grid.elevations) == pytest.approx([4.0, 1.0, 0.0, -2.0])
    assert second.place == pytest.approx((2.3, 0.65, -1.3))
    # The cameras are told in the frame of the first.
    assert setup.cameras[0].position == pytest.approx((0.7, 0.0, -0.3))


def test_one_lidar_in_a_list_is_the_set_up_of_one(read):
    one = TWO[: TWO.index("[[lidars]]\ncolumns = 64\nelevations")]
    alone = read(one)
    assert isinstance(alone.grid, AngularGrid)
    plain = read(one.replace("[[lidars]]", "[lidar]"))
    assert plain == alone
    assert plain.digest == alone.digest


def test_it_is_told_by_name_hash_and_text_and_read_back():
    told = sensor_columns(CORNERS)
    assert told["sensor_hash"] == CORNERS.digest
    assert setup_of_columns(told) == CORNERS
    again = SensorSetup.from_json(CORNERS.to_json())
    assert again == CORNERS
    assert again.digest == CORNERS.digest
    (head, *others), places = CORNERS.grid.grids, CORNERS.grid.places
    moved = replace(CORNERS.grid, places=(places[0], (2.3, 0.7, -1.3), places[2]))
    swapped = replace(CORNERS.grid, grids=(head, *reversed(others)))
    digests = {replace(CORNERS, grid=grid).digest for grid in (CORNERS.grid, moved, swapped, head)}
    assert len(digests) == 4


def test_cameras_of_the_scenario_stay_where_they_are_on_the_car():
    (camera,) = CORNERS.equipped((FRONT_CAMERA,))
    assert np.add(CORNERS.position, camera.position) == pytest.approx(
        np.add(LIDAR_POSITION, FRONT_CAMERA.position)
    )


def test_roof_and_corners_is_as_its_sources_say():
    setup = sensor_setup("roof-and-corners")
    roof, left, right = setup.grid.heads
    assert roof.grid == sensor_setup(DEFAULT_SETUP).grid
    assert setup.position == LIDAR_POSITION
    for head, side in ((left, 1), (right, -1)):
        # The rear axle of the car is 0.94 m behind its LiDAR on the roof.
        x, y, z = np.add(setup.position, head.place)
        assert (x + 0.445 + 0.94, y, z) == pytest.approx((3.29, side * 0.655, 0.32))
        assert np.rad2deg(head.grid.heading) == pytest.approx(side * 50)
        assert np.rad2deg(head.grid.field_of_view) == pytest.approx(120)
        assert np.rad2deg(head.grid.top - head.grid.bottom) == pytest.approx(25)
        assert head.grid.range_m == 150
        assert head.grid.size == pytest.approx(452_000 / 10, rel=0.01)
    (line,) = (line for line in setup_lines() if line.startswith(setup.name))
    assert line.count("512 columns") == 3


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "two"', 'name = "two"\nlidar = {}', "either [lidar] or [[lidars]], got both"),
        (
            "position_m = [1.9, 0.65, 0.5]",
            "",
            "position_m of lidars is missing: [x, y, z] in metres",
        ),
        ("0.65, 0.5]", "0.65, -0.5]", "z of a position of the sensor set-up two must"),
        ("columns = 64\nelev", "columns = 32\nelev", "as many columns each, got 32 and 64"),
        ("range_m = 80.0", "range = 80.0", "range"),
        ("yaw_deg", "roll_deg = 50.0\nyaw_deg", "roll_deg must lie in [-45, 45]"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(read, old, new, words):
    assert TWO.count(old) == 1
    with pytest.raises(InvalidInput) as refused:
        read(TWO.replace(old, new))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_no_list_of_lidars_is_refused_in_one_line(read):
    origin = (0.0, 0.0, 1.0)
    for lidars in ((), [ROOF], [(ROOF, origin), (LEFT,)], "ab"):
        with pytest.raises(InvalidInput, match="must be pairs of a grid and a position"):
            SensorSetup.of_lidars("odd", lidars)
    with pytest.raises(InvalidInput, match="a position of the sensor set-up odd must be x, y and"):
        SensorSetup.of_lidars("odd", [(ROOF, origin), (LEFT, (1.0, 2.0))])
    with pytest.raises(InvalidInput, match="the position of LiDAR 2 of the sensor set-up odd"):
        SensorSetup("odd", STACK, (0.0, 0.0, 0.9))
    with pytest.raises(InvalidInput, match="lidars must be one table or more"):
        read('name = "none"\nlidars = []')
    with pytest.raises(InvalidInput, match="no text of a sensor set-up"):
        SensorSetup.from_json(CORNERS.to_json().replace('"places"', '"sites"'))
    behind = PinholeCamera(yaw=np.pi)
    ahead = [(LEFT, origin), (RIGHT, origin)]
    with pytest.raises(InvalidInput, match="camera 0 of the sensor set-up odd sees nothing"):
        SensorSetup.of_lidars("odd", ahead, (behind,))
    # Any of the LiDARs is enough.
    assert SensorSetup.of_lidars("odd", [*ahead, (ROOF, origin)], (behind,))


def test_weights_tell_the_lidars_that_they_were_made_with(tmp_path):
    path = tmp_path / "weights.npz"
    save_weights(path, {}, Card("ppo", STACK, setup=CORNERS.label))
    assert load_weights(path).card.grid == STACK
