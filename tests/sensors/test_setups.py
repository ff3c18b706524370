"""Sensor set-ups: those that come with the package, files of one's own, and what is refused."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import LIDAR_POSITION, SensorSetup
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.sensors.setups import (
    DEFAULT_SETUP,
    sensor_columns,
    sensor_setup,
    setup_lines,
    setup_names,
    setup_of_columns,
)
from tests.helpers.lidars import CORNERS, LEFT, RIGHT, ROOF, STACK

LISTED = """
name = "mine"

[lidar]
columns = 180
elevations_deg = [5.0, 1.0, -1.0, -9.0]
field_of_view_deg = 90.0
yaw_deg = 30.0
range_m = 80.0
pitch_deg = -2.0
roll_deg = 1.0
position_m = [1.0, 0.5, 0.75]

[[cameras]]
width = 400
height = 300
horizontal_fov_deg = 60.0
position_m = [1.5, 0.0, 1.25]
yaw_deg = 20.0
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write


def test_the_default_is_what_was_mounted_before_there_was_a_choice():
    setup = sensor_setup(DEFAULT_SETUP)
    assert setup_names()[0] == DEFAULT_SETUP
    assert setup == SensorSetup(DEFAULT_SETUP, AngularGrid(), (-0.445, 0.0, 1.84))
    assert setup.equipped((FRONT_CAMERA,)) == (FRONT_CAMERA,)
    assert sensor_columns(DEFAULT_SETUP) == {}
    with gymnasium.make("CARE-Dense-v0") as env:
        assert env.unwrapped.rig == care_sim.Rig(cameras=(FRONT_CAMERA,))


@pytest.mark.parametrize(
    ("name", "shape", "view_deg", "rows_deg", "range_m", "position"),
    [
        ("hdl-32e", (32, 512), 360, (10.67, -30.67), 50, LIDAR_POSITION),
        ("os1-64", (64, 1024), 360, (16.6, -16.6), 120, LIDAR_POSITION),
        ("os1-128", (128, 1024), 360, (22.5, -22.5), 120, LIDAR_POSITION),
        ("m1-forward", (126, 600), 120, (12.5, -12.5), 150, (0.6, 0.0, 1.5)),
        ("paper-vehicle", (32, 512), 360, (10.67, -30.67), 50, LIDAR_POSITION),
        ("hdl-64e", (64, 2083), 360, (2.0, -24.33), 120, (-0.445, 0.0, 1.73)),
        ("nuscenes", (32, 1084), 360, (10.67, -30.67), 100, LIDAR_POSITION),
        ("kitti", (32, 512), 360, (10.67, -30.67), 50, (-0.445, 0.0, 1.73)),
    ],
)
def test_what_comes_with_the_package_is_as_its_data_sheet_says(
    name, shape, view_deg, rows_deg, range_m, position
):
    setup = sensor_setup(name)
    assert setup.name == name
    assert setup.grid.shape == shape
    assert np.rad2deg(setup.grid.field_of_view) == pytest.approx(view_deg)
    assert np.rad2deg([setup.grid.top, setup.grid.bottom]) == pytest.approx(rows_deg)
    assert setup.grid.range_m == range_m
    assert setup.position == position
    assert any(line.startswith(name) for line in setup_lines())


def test_the_lower_lidar_of_argoverse_2_hangs_upside_down():
    setup = sensor_setup("argoverse-2")
    upper, lower = (head.grid for head in setup.grid.heads)
    assert setup.grid.shape == (64, 1800)
    assert np.rad2deg(upper.elevations[[0, -1]]) == pytest.approx([15.0, -25.0])
    assert lower.elevations == pytest.approx(-upper.elevations[::-1], abs=1e-9)


def test_a_file_is_read_in_metres_and_degrees_of_the_car(written):
    setup = sensor_setup(written(LISTED))
    grid = setup.grid
    assert (setup.name, setup.position) == ("mine", (1.0, 0.5, 0.75))
    assert (grid.columns, grid.range_m) == (180, 80.0)
    assert np.rad2deg(grid.elevations) == pytest.approx([5.0, 1.0, -1.0, -9.0])
    assert np.rad2deg(grid.azimuths[[0, -1]]) == pytest.approx([-14.75, 74.75])
    assert np.rad2deg([grid.pitch, grid.roll]) == pytest.approx([-2.0, 1.0])
    (camera,) = setup.cameras
    assert camera.position == (0.5, -0.5, 0.5)
    angles = np.rad2deg([camera.horizontal_fov, camera.yaw, camera.pitch])
    assert angles == pytest.approx([60.0, 20.0, 0.0])


def test_the_same_set_up_is_an_object_a_file_and_a_path_in_text(written):
    path = written(LISTED)
    setup = sensor_setup(path)
    assert sensor_setup(str(path)) == sensor_setup(setup) == setup
    told = {"sensor": "mine", "sensor_hash": setup.digest, "sensor_setup": setup.to_json()}
    assert sensor_columns(str(path)) == told
    path.write_text(LISTED.replace("80.0", "70.0"))
    assert sensor_setup(path).grid.range_m == 70.0
    assert sensor_setup(path).digest != setup.digest


def test_the_hash_is_of_what_is_mounted_not_of_the_name():
    setup = SensorSetup("one", cameras=(FRONT_CAMERA,))
    assert replace(setup, name="other").digest == setup.digest
    moved = replace(setup, position=(0.0, 0.0, 1.84))
    turned = replace(setup, cameras=(replace(FRONT_CAMERA, pitch=0.01),))
    tilted = replace(setup, grid=AngularGrid(roll=0.01))
    assert len({one.digest for one in (setup, moved, turned, tilted)}) == 4
    plain, signed = (SensorSetup("a", position=(0.0, y, 1.0)) for y in (0.0, -0.0))
    assert plain.digest == signed.digest, "a zero has no sign"


def test_level_set_ups_keep_the_hashes_of_before_there_was_a_tilt():
    hashes = [sensor_setup(name).digest for name in ("hdl-32e", "paper-vehicle")]
    assert hashes == ["95162f4bf334eac9", "05db9f03aae1d6c1"]


@pytest.mark.parametrize("name", setup_names())
def test_a_set_up_is_read_back_from_its_text(name):
    setup = sensor_setup(name)
    again = SensorSetup.from_json(setup.to_json())
    assert again == setup
    assert again.digest == setup.digest


def test_cameras_of_the_scenario_stay_where_they_are_on_the_car():
    """A LiDAR in the bumper, 1.5 m before and 1.3 m below the usual place."""
    setup = SensorSetup("bumper", position=(1.055, 0.2, 0.54))
    (camera,) = setup.equipped((FRONT_CAMERA,))
    usual = np.add(LIDAR_POSITION, FRONT_CAMERA.position)
    assert np.add(setup.position, camera.position) == pytest.approx(usual)


@pytest.mark.parametrize("environment", ["CARE-Dense-v0", "CARE-Street-v0"])
def test_a_set_up_is_mounted_in_both_loops(environment, written):
    with gymnasium.make(environment, sensor=written(LISTED), budget=0.1) as env:
        observation, _ = env.reset(seed=0)
        inner = env.unwrapped
        assert observation["ranges"].shape == inner.action_space.shape == (4, 180)
        assert inner.rig.budget == 72
        assert inner.rig.sensor_position == (1.0, 0.5, 0.75)
        assert len(inner.rig.cameras) == 1
        env.step(np.ones(env.action_space.shape, np.float32))
        loop = inner.loop
        sensor = loop.sensor if environment == "CARE-Dense-v0" else loop.shot.sensor
        assert sensor.z == 0.75


TILTED = SensorSetup(
    "tilted", AngularGrid(256, 24, 0.4, -0.7, pitch=np.deg2rad(-12), roll=np.deg2rad(7))
)
"""It looks down ahead and to the right."""


def test_a_tilt_moves_no_camera_and_no_box():
    """Level or tilted, a full scan finds the same bodies, at the same places."""
    seen = []
    level = replace(TILTED, grid=replace(TILTED.grid, pitch=0.0, roll=0.0))
    for sensor in (level, TILTED):
        with gymnasium.make("CARE-Dense-v0", sensor=sensor, budget=1.0) as env:
            observation, _ = env.reset(seed=1)
            pictures = observation["detections"].copy()
            for _ in range(3):
                observation, *_ = env.step(np.ones(env.action_space.shape, np.float32))
            tracks = Belief.from_observation(observation).tracks
            seen.append((pictures, tracks.boxes[tracks.ranges < 30], env.unwrapped.rig))
    (level_pictures, level_boxes, _), (pictures, boxes, rig) = seen
    assert np.array_equal(pictures, level_pictures)
    near = [np.abs(boxes[:, :3] - box[:3]).max(axis=1).min() for box in level_boxes]
    assert len(near) >= 4
    assert np.mean(np.array(near) < 0.01) > 0.8
    assert all(len(hull) for hull in rig.hulls(boxes))


ROWS = "elevations_deg = [5.0, 1.0, -1.0, -9.0]"
FLAT = "rows = 4\ntop_deg = 2.0\nbottom_deg = 5.0"
STEEP = "rows = 4\ntop_deg = 95.0\nbottom_deg = 5.0"


def test_what_is_in_the_way_of_the_car_counts_wherever_the_lidar_stands_across_it():
    """Seen from a LiDAR 1.9 m to the right the parked cars are ahead, and nobody brakes."""
    braking = []
    for left in (0.0, -1.9):
        setup = SensorSetup("shifted", position=(-0.445, left, 1.84))
        with gymnasium.make("CARE-Dense-v0", sensor=setup, budget=1.0) as env:
            policy = care_sim.make_policy("full", env)
            observation, _ = env.reset(seed=1)
            for _ in range(20):
                observation, _, _, _, info = env.step(policy(observation))
                braking.append(info["braking"])
    assert not any(braking)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("columns", "colums", "unknown argument of lidar 'colums'"),
        ('name = "mine"', "", "name is missing, a text"),
        ("elevations_deg", "rows = 4\nelevations_deg", "so leave out rows"),
        ("[5.0, 1.0, -1.0, -9.0]", "5.0", "elevations_deg must be a list"),
        (ROWS, "rows = 4", "top_deg of lidar is missing, or elevations_deg"),
        ("field_of_view_deg = 90.0", "field_of_view_deg = 91.0", "divides a whole turn"),
        ("[1.0, 0.5, 0.75]", "[1.0, 0.5]", r"position_m of lidar must be \[x, y, z\]"),
        ("[1.0, 0.5, 0.75]", "[1.0, 0.5, 0.0]", "z of the position of the sensor set-up mine"),
        ("[1.5, 0.0, 1.25]", "1.5", "position_m of cameras must be"),
        ("position_m = [1.5, 0.0, 1.25]", "", "position_m of cameras is missing: "),
        ('"mine"', '""', "name of a sensor set-up must be 1 to 60 printable"),
        ("5.0, 1.0, -1.0", "5.0, -1.0, 1.0", "elevations_deg must descend, got 1 after -1"),
        (ROWS, FLAT, "below top_deg, 2, got 5"),
        (ROWS, STEEP, r"top_deg must lie in \[-90, 90\], got 95"),
        ("= 90.0", "= 0.1", r"field_of_view_deg must lie in \[0.5, 360\], got 0.1"),
        ("= 60.0", "= 180.0", r"horizontal_fov_deg must lie in \[0.06, 179.9\], got 180.0"),
        ("yaw_deg = 30.0", "yaw_deg = 190.0", r"yaw_deg must lie in \[-180, 180\], got 190.0"),
        ("yaw_deg = 20.0", "yaw_deg = 200.0", "camera 0 .* sees nothing of the grid"),
        ("[[cameras]]", "[cameras]", "cameras must be tables"),
        ("pitch_deg = -2.0", "pitch_deg = -50.0", r"pitch_deg must lie in \[-45, 45\], got -50.0"),
        ("= 80.0", "= nan", "range_m of the grid must"),
        ("= 80.0", "= eighty", "no TOML"),
    ],
)
def test_a_file_that_does_not_fit_together_is_refused_in_one_line(written, old, new, said):
    assert old in LISTED
    path = written(LISTED.replace(old, new))
    with pytest.raises(InvalidInput, match=said) as refused:
        sensor_setup(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("sensor", "said"),
    [
        ("hdl-32", "unknown sensor 'hdl-32'; known: hdl-32e, "),
        ("nowhere.toml", "sensor nowhere.toml: no such file"),
        (3, "sensor must be a path"),
    ],
)
def test_what_names_no_set_up_is_refused_in_one_line(sensor, said):
    with pytest.raises(InvalidInput, match=said):
        gymnasium.make("CARE-Dense-v0", sensor=sensor)


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
