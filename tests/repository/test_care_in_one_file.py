"""The paper's method in one file, held to the package: it is given what a policy is given, keeps
its own tracks, and must choose the same cells in the same order.
"""

import runpy
import sys
from collections import Counter

import numpy as np
import pytest

from care_sim.core.firing.base import demanded
from care_sim.core.firing.floor import Floor, floor_key
from care_sim.core.types import ImageDetections
from care_sim.loops.episode import EpisodeSeeds
from care_sim.loops.stages.tracking import Tracking
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers.floors import floor_order
from tests.helpers.places import EXAMPLES, loaded

FILE = EXAMPLES / "care_in_one_file.py"


@pytest.fixture
def one_file():
    return loaded(FILE)


@pytest.fixture
def detector_output(monkeypatch):
    """Note the detections of the LiDAR, scan by scan."""
    found = []
    update = Tracking.update

    def noted(tracking, state, detected):
        own = slice(detected.counts[0])
        classes, boxes = detected.classes[0, own], detected.boxes[0, own].copy()
        found.append([*zip(classes.tolist(), boxes, strict=True)])
        return update(tracking, state, detected)

    monkeypatch.setattr(Tracking, "update", noted)
    return found


@pytest.mark.parametrize("seed", range(5))
def test_it_fires_the_cells_of_the_published_episodes(seed, one_file, detector_output):
    """All 49 of a seed, keyframe by keyframe."""
    for config in paper_study([seed]):
        assert play(config, one_file, detector_output) == 60, config.label


def test_on_bends_with_late_pictures_of_six_cameras_too(one_file, detector_output, monkeypatch):
    """The paper's scenes are straight roads, with exact positions."""
    monkeypatch.setattr(one_file, "POSITION_SIGMA_M", 0.4)
    sigma = (("position_sigma_m", 0.4),)
    quick = EpisodeConfig("drive", "care-sbf", 0.05, camera_latency=2, policy_parameters=sigma)
    assert play(quick, one_file, detector_output) > 200
    # At the paper's 2 Hz, cars move farther than a gate between two keyframes.
    slow = EpisodeConfig("drive", "care-priority", 0.05, camera_latency=1, keyframe_s=0.5)
    assert play(slow, one_file, detector_output) > 30


def play(config, one_file, detector_output):
    """How many keyframes an episode has. Fails where the file chooses other cells."""
    with config.make_env().unwrapped as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=config.seed)
        policy.reset()
        cameras = [camera_of(camera, one_file) for camera in env.rig.cameras]
        key = floor_key(EpisodeSeeds.of(config.seed).floor, 0)
        # With a budget of all cells, CARE is the full scan.
        name = "care" if config.policy == "full" else config.policy
        scanner = one_file.Scanner(name, config.budget, config.reserve_fraction, config.keyframe_s)
        keyframes, is_over = 0, False
        while not is_over:
            sensor = env.loop.sensor
            ego = one_file.Ego(
                sensor.x, sensor.y, sensor.z, sensor.yaw, float(observation["ego"][0])
            )
            seen = [
                one_file.CameraDetection(
                    int(row[ImageDetections.CLASS]),
                    tuple(row[ImageDetections.BOX].tolist()),
                    cameras[int(row[ImageDetections.CAMERA])],
                    float(row[ImageDetections.YAW_CHANGE]),
                )
                for row in observation["detections"]
                if row[ImageDetections.CLASS] >= 0
            ]
            floor = floor_order(Floor(*key, keyframes), env.rig.grid.size)
            shares = scanner.choose(seen, ego, floor)
            chosen = np.array([*shares])
            action = policy(observation)
            observation, _, terminated, truncated, info = env.step(action)
            where = f"{config.label}, keyframe {keyframes}"
            assert np.array_equal(np.sort(chosen), info["fired"]), where
            if config.policy != "full":
                # Scores fall in the order of selection. The environment adds the floor.
                order = demanded(action)
                assert np.array_equal(chosen[: len(order)], order), where
                rest = len(chosen) - len(order)
                assert np.array_equal(chosen[len(order) :], free(floor, order)[:rest]), where
                assert Counter(shares.values())["floor"] == rest, where
            scanner.remember(detector_output[-1], ego)
            is_over = terminated or truncated
            keyframes += 1
    return keyframes


def free(floor, cells):
    taken = np.zeros(len(floor), bool)
    taken[cells] = True
    return floor[~taken[floor]]


def camera_of(camera, one_file):
    centre = camera.width / 2, camera.height / 2
    return one_file.Camera(camera.focal, centre, np.array(camera.position), camera.axes)


def test_it_is_short_and_takes_nothing_but_numpy(capsys, monkeypatch):
    lines = FILE.read_text().splitlines()
    assert len(lines) <= 400
    imported = {
        line.split()[1].split(".")[0] for line in lines if line.startswith(("import", "from"))
    }
    assert imported - sys.stdlib_module_names == {"numpy"}
    runpy.run_path(str(FILE), run_name="__main__")
    printed = dict(line.split(" ", 1) for line in capsys.readouterr().out.splitlines())
    assert list(printed) == ["history", "care", "care-sbf"]
