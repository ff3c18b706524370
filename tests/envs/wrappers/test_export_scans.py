"""Exported scans, read back with Open3D."""

import json

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.wrappers import ExportScans


@pytest.fixture(scope="module")
def played(tmp_path_factory, open3d):
    """The folder of a whole dart-out, and its keyframes."""
    folder = tmp_path_factory.mktemp("scans") / "dartout"
    env = gymnasium.make("CARE-Dartout-v0", disable_env_checker=True)
    policy = care_sim.make_policy("care", env)
    with ExportScans(env, folder, policy) as env:
        observation, _ = env.reset(seed=3)
        ended = False
        while not ended:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            ended = terminated or truncated
        keyframes = list(env.unwrapped.keyframes)
    return folder, keyframes, info["outcome"]


def beside(folder, name):
    return json.loads((folder / f"{name}.json").read_text())


def test_there_is_a_cloud_and_a_description_for_every_keyframe(played):
    folder, keyframes, outcome = played
    clouds = sorted(path.stem for path in folder.glob("*.pcd"))
    assert clouds == [f"{frame.index:03d}" for frame in keyframes]
    for frame in keyframes:
        text = beside(folder, f"{frame.index:03d}")
        assert (text["keyframe"], text["time_s"], text["speed_mps"]) == (
            frame.index,
            frame.time_s,
            frame.speed_mps,
        )
        assert (text["detected"], text["braking"]) == (frame.detected, frame.braking)
        assert text["fired"] == frame.fired.tolist()
    episode = beside(folder, "episode")
    assert episode["outcome"] == outcome
    assert AngularGrid(**episode["grid"]) == AngularGrid()
    assert (folder / "000.pcd").read_bytes().count(b"DATA binary\n") == 1


def test_points_are_returns_of_the_fired_cells(played, open3d):
    folder, keyframes, _ = played
    shares = beside(folder, "episode")["shares"]
    seen = set()
    for frame in keyframes[::7]:
        cloud = open3d.t.io.read_point_cloud(str(folder / f"{frame.index:03d}.pcd")).point
        cells = cloud["cell"].numpy().ravel()
        points = cloud["positions"].numpy()
        assert set(cells) <= set(frame.fired)
        assert len(points) > 500
        directions = points / np.linalg.norm(points, axis=1, keepdims=True)
        np.testing.assert_allclose(directions, AngularGrid().directions[cells], atol=1e-5)
        seen |= {shares[share] for share in cloud["share"].numpy().ravel()}
    assert seen == {"exploitation", "reserve", "floor"}


def test_poses_and_boxes_place_the_points_on_the_person(played, open3d):
    """At the keyframe of detection at least three points lie in the person's box, in the world."""
    folder, keyframes, outcome = played
    name = f"{next(frame.index for frame in keyframes if frame.detected):03d}"
    text = beside(folder, name)
    points = np.asarray(open3d.io.read_point_cloud(str(folder / f"{name}.pcd")).points)
    x, y, z, yaw, pitch, roll = text["sensor_in_world"]
    sensor = Frame(x, y, z, yaw, roll, pitch)
    (person,) = (body for body in text["bodies"] if body["name"] == "person")
    assert person["class"] == "pedestrian"
    box = np.array(person["box"])
    here = Frame(*box[:3], box[6]).vectors_to_local(
        sensor.origin + sensor.vectors_to_world(points) - box[:3]
    )
    assert np.count_nonzero((np.abs(here) < box[3:6] / 2 + 0.01).all(axis=1)) >= 3
    assert np.hypot(box[0] - x, box[1] - y) == pytest.approx(outcome["detection_distance_m"])


def test_a_folder_that_holds_scans_is_refused_before_play(open3d, tmp_path):
    (tmp_path / "000.pcd").touch()
    with ExportScans(gymnasium.make("CARE-Dartout-v0", disable_env_checker=True), tmp_path) as env:
        env.reset(seed=0)
        with pytest.raises(care_sim.InvalidInput, match="holds scans already"):
            env.step(np.zeros(env.action_space.shape, np.float32))
        assert env.unwrapped.loop.index == 0
    assert [path.name for path in tmp_path.iterdir()] == ["000.pcd"]


def test_scans_of_the_open_loop_hold_who_was_found(open3d, drive, tmp_path):
    env = gymnasium.make(
        "CARE-Replay-v0", source=f"argoverse2:{drive}", budget=0.05, disable_env_checker=True
    )
    policy = care_sim.make_policy("care", env)
    with ExportScans(env, tmp_path / "scans", policy) as env:
        observation, _ = env.reset(seed=0)
        ended = False
        records, ranges = [], []
        while not ended:
            observation, _, _, ended, info = env.step(policy(observation))
            records.append(env.unwrapped.last)
            ranges.append(env.unwrapped.loop.last_ranges.ravel())
        shots = env.unwrapped.loop.film.shots
    assert beside(tmp_path / "scans", "episode")["outcome"] == info["outcome"]
    grid = AngularGrid()
    for record, shown, shot in zip(records, ranges, shots, strict=True):
        text = beside(tmp_path / "scans", f"{record.index:03d}")
        assert "braking" not in text
        assert (text["time_s"], text["fired"]) == (shot.time_s, record.fired.tolist())
        for state in ("found", "scored", "appearing"):
            told = [body[state] for body in text["bodies"]]
            assert told == getattr(record, state).tolist()
        # The points are those of the cells that returned.
        cloud = open3d.t.io.read_point_cloud(str(tmp_path / "scans" / f"{record.index:03d}.pcd"))
        cells = cloud.point["cell"].numpy().ravel()
        assert cells.tolist() == np.flatnonzero((shown > 0) & (shown < grid.range_m)).tolist()
        np.testing.assert_allclose(
            cloud.point["positions"].numpy(),
            grid.points(cells, shown[cells].astype(float)),
            rtol=1e-5,
            atol=1e-4,
        )
        # Bodies stand where they are annotated.
        x, y, z, yaw, pitch, roll = text["sensor_in_world"]
        sensor = Frame(x, y, z, yaw, roll, pitch)
        boxes = np.array([body["box"] for body in text["bodies"]])
        local = sensor.boxes_to_local(boxes)
        np.testing.assert_allclose(local, shot.annotations.boxes, atol=1e-6)
    appearing = [
        (body["name"].split()[0], body["found"])
        for record in records
        for body in beside(tmp_path / "scans", f"{record.index:03d}")["bodies"]
        if body["appearing"]
    ]
    assert appearing == [("pedestrian", True)]
