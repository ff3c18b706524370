"""Sensor set-ups: those that come with the package, files of one's own, and what is refused."""

import pickle
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Belief
from care_sim.core.frames import Frame
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
)

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


def test_the_rows_of_a_64_row_lidar_are_as_far_apart_as_its_halves_are():
    steps = -np.diff(np.rad2deg(sensor_setup("hdl-64e").grid.elevations))
    assert steps[:31] == pytest.approx(1 / 3, abs=0.011)
    assert steps[31:] == pytest.approx(0.5, abs=0.011)


def test_these_are_all_and_no_two_have_one_hash():
    assert len(setup_names()) == 8
    assert len({sensor_setup(name).digest for name in setup_names()}) == 8


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


def test_level_set_ups_keep_the_hashes_of_before_there_was_a_tilt():
    hashes = [sensor_setup(name).digest for name in ("hdl-32e", "paper-vehicle")]
    assert hashes == ["95162f4bf334eac9", "05db9f03aae1d6c1"]


@pytest.mark.parametrize("name", setup_names())
def test_a_set_up_is_read_back_from_its_text(name):
    setup = sensor_setup(name)
    again = SensorSetup.from_json(setup.to_json())
    assert again == setup
    assert again.digest == setup.digest


@pytest.mark.parametrize(
    "text", ["", "7", "{}", "[" * 3000, '{"name": "a", "grid": {"rows": 1}, "cameras": []}']
)
def test_another_text_is_refused_in_one_line(text):
    with pytest.raises(InvalidInput, match="no text of a sensor set-up") as refused:
        SensorSetup.from_json(text)
    assert "\n" not in str(refused.value)


def test_a_set_up_is_sent_to_workers_without_the_tables_of_its_grid():
    setup = SensorSetup("large", AngularGrid(2048, 128))
    before = pickle.dumps(setup)
    assert setup.grid.directions.shape == (2048 * 128, 3)
    assert pickle.dumps(setup) == before
    assert len(before) < 2000
    assert pickle.loads(before) == setup


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


def test_a_return_lies_where_the_mount_and_the_grid_say():
    """Every point of a full scan of the empty road is on the road, within the field of view."""
    setup = SensorSetup(
        "low",
        AngularGrid(90, 4, 0.0, -0.3, 30.0, field_of_view=np.pi / 2, heading=-1.0),
        (2.0, -0.9, 0.6),
    )
    with gymnasium.make("CARE-CutIn-v0", sensor=setup, budget=1.0) as env:
        env.reset(seed=0)
        loop = env.unwrapped.loop
        x, y, yaw = loop.world.ego.pose
        expected = Frame(x, y, 0.0, yaw).holding(np.array(setup.position))
        assert loop.sensor.origin == pytest.approx(expected.origin)
        scan = loop.full_scan()
        hit = np.isfinite(scan.ranges)
        points = setup.grid.directions[scan.cells[hit]] * scan.ranges[hit, None]
        road = points[points[:, 2] < -0.55]
        assert len(road) > 90
        assert road[:, 2] == pytest.approx(-0.6, abs=1e-3)
        azimuths = np.arctan2(points[:, 1], points[:, 0])
        assert azimuths.min() > -1.0 - np.pi / 4
        assert azimuths.max() < -1.0 + np.pi / 4


TILTED = SensorSetup(
    "tilted", AngularGrid(256, 24, 0.4, -0.7, pitch=np.deg2rad(-12), roll=np.deg2rad(7))
)
"""It looks down ahead and to the right."""


def test_the_road_is_level_seen_from_a_tilted_lidar():
    """Rows fall on it at other distances in every column, and each return lies on it."""
    with gymnasium.make("CARE-CutIn-v0", sensor=TILTED, budget=1.0) as env:
        env.reset(seed=0)
        scan = env.unwrapped.loop.full_scan()
        hit = np.isfinite(scan.ranges)
        points = TILTED.grid.directions[scan.cells[hit]] * scan.ranges[hit, None]
        assert points[:, 2].min() == pytest.approx(-1.84, abs=1e-9)
        assert np.mean(points[:, 2] < -1.84 + 1e-9) > 0.5
        # It looks down ahead: of a row that sees the road there, nothing comes back from behind.
        ranges = np.full(TILTED.grid.size, np.inf)
        ranges[scan.cells] = scan.ranges
        row = ranges.reshape(TILTED.grid.shape)[10]
        assert row[128] < 9
        assert np.isinf(row[0])


@pytest.mark.parametrize("environment", ["CARE-Dense-v0", "CARE-Street-v0"])
def test_a_tilt_moves_no_camera_and_no_box(environment, short_streets):
    """Level or tilted, a full scan finds the same bodies, at the same places."""
    seen = []
    level = replace(TILTED, grid=replace(TILTED.grid, pitch=0.0, roll=0.0))
    for sensor in (level, TILTED):
        with gymnasium.make(environment, sensor=sensor, budget=1.0) as env:
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


ROWS = "elevations_deg = [5.0, 1.0, -1.0, -9.0]"
FLAT = "rows = 4\ntop_deg = 2.0\nbottom_deg = 5.0"
STEEP = "rows = 4\ntop_deg = 95.0\nbottom_deg = 5.0"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("columns", "colums", "unknown argument of lidar 'colums', the nearest is columns"),
        ('name = "mine"', "", "name is missing, a text"),
        ("[lidar]", "[radar]", "unknown argument of a set-up 'radar'"),
        ("elevations_deg", "rows = 4\nelevations_deg", "so leave out rows"),
        ("[5.0, 1.0, -1.0, -9.0]", "[5.0, 1.0, 2.0, -9.0]", "must descend"),
        ("[5.0, 1.0, -1.0, -9.0]", "5.0", "elevations_deg must be a list"),
        (
            ROWS,
            "rows = 4",
            "top_deg of lidar is missing, or elevations_deg",
        ),
        ("field_of_view_deg = 90.0", "field_of_view_deg = 91.0", "divides a whole turn"),
        ("[1.0, 0.5, 0.75]", "[1.0, 0.5]", r"position_m of lidar must be \[x, y, z\]"),
        ("[1.0, 0.5, 0.75]", "[1.0, 0.5, 0.0]", "z of the position of the sensor set-up mine"),
        ("[1.5, 0.0, 1.25]", "1.5", "position_m of cameras must be"),
        ("position_m = [1.5, 0.0, 1.25]", "", "position_m of cameras is missing: "),
        ('"mine"', '""', "name of a sensor set-up must be 1 to 60 printable"),
        ("5.0, 1.0, -1.0", "5.0, -1.0, 1.0", "elevations_deg must descend, got 1 after -1"),
        (ROWS, FLAT, "below top_deg, 2, got 5"),
        (
            ROWS,
            STEEP,
            r"top_deg must lie in \[-90, 90\], got 95",
        ),
        ("= 90.0", "= 0.1", r"field_of_view_deg must lie in \[0.5, 360\], got 0.1"),
        ("= 60.0", "= 180.0", r"horizontal_fov_deg must lie in \[0.06, 179.9\], got 180.0"),
        ("yaw_deg = 30.0", "yaw_deg = 190.0", r"yaw_deg must lie in \[-180, 180\], got 190.0"),
        ("width = 400", "width = 0", "width of the camera must be"),
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
        (b"hdl-32e", "sensor must be a path"),
        (None, "sensor must be a path"),
        (3, "sensor must be a path"),
        ("", "sensor must be a path, none that is empty"),
    ],
)
def test_what_names_no_set_up_is_refused_in_one_line(sensor, said):
    with pytest.raises(InvalidInput, match=said):
        gymnasium.make("CARE-Dense-v0", sensor=sensor)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"grid": None}, "must be an AngularGrid"),
        ({"position": 3.0}, "must be x, y and z"),
        ({"position": (0.0, 0.0, float("nan"))}, "z of the position"),
        ({"cameras": FRONT_CAMERA}, "must be PinholeCameras"),
        ({"cameras": (PinholeCamera(pitch=1.5),)}, "camera 0 .* sees nothing of the grid"),
    ],
)
def test_an_object_that_does_not_fit_together_is_refused(wrong, said):
    with pytest.raises(InvalidInput, match=said):
        SensorSetup("mine", **wrong)


def test_a_budget_below_a_cell_and_weights_of_another_grid_are_refused():
    with pytest.raises(InvalidInput, match="leaves no cell of 16384"):
        gymnasium.make("CARE-Dense-v0", budget=1e-6)
    with gymnasium.make("CARE-Dense-v0", sensor="os1-64") as env:
        for policy in ("place", "learned-scorer", "learned-sets", "ppo"):
            with pytest.raises(InvalidInput, match=r"grid is columns 512 .*needed is columns 1024"):
                care_sim.make_policy(policy, env)


def test_the_clustering_detector_is_told_the_grid():
    with gymnasium.make("CARE-Dense-v0", sensor="os1-64", detector="cluster") as env:
        assert env.unwrapped._detector._detector._grid == sensor_setup("os1-64").grid


@pytest.mark.parametrize("text", ["rows = " + "9" * 5000, "x = " + "[" * 5000, 'name = "a\\nb"'])
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "odd.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=r"odd\.toml") as refused:
        sensor_setup(path)
    assert "\n" not in str(refused.value)


def test_a_zero_has_no_sign_in_the_hash():
    plain, signed = (SensorSetup("a", position=(0.0, y, 1.0)) for y in (0.0, -0.0))
    assert plain == signed
    assert plain.digest == signed.digest
