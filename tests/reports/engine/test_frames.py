"""Plays by setting: what is compared with what, and what floor seeds become; marks of policies."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.recall import Tally
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.study.rows.reading import Setting, setting_of
from tests.helpers.made_plays import FRAMES, found, play, study


def test_source_detector_and_conditions_make_a_setting_and_floor_seeds_do_not():
    def setting(**more):
        return setting_of(play("a", "care", [0], [1], **more))

    assert setting() == setting(floor_seed=2, budget=0.35) == Setting("streets", detector="returns")
    unknown = {"camera_rotation_sigma_deg": None}
    assert setting_of(play("a", "care", [0], [1]) | unknown) == Setting(
        "streets", detector="returns"
    )
    assert setting(source="nuscenes").label == "nuScenes, detector returns"
    near = {"detector": "cluster", "detector.eps": 0.5}
    assert setting(**near) == Setting("streets", detector="cluster eps=0.5")
    assert (
        setting(reserve_fraction=0.5).label
        == "generated streets, detector returns, reserve fraction 0.5"
    )
    assert setting(camera_latency=1).strict_causal
    assert not setting(camera_latency=1, reserve_fraction=0.5).strict_causal
    assert "strict-causal (camera one keyframe old)" in setting(camera_latency=1).label


def test_a_full_scan_serves_every_setting_that_it_does_not_feel():
    full = play("a", "full", [0], [1])
    late, broken = (
        play("a", "care", [0], [1], **more)
        for more in ({"camera_latency": 1}, {"lidar_dropout": 0.5})
    )
    delayed, dropped = plays_by_setting([full, late, broken])
    assert delayed.full == [full]
    assert dropped.full == []
    (alone,) = plays_by_setting([full])
    assert (alone.policies, alone.full) == ((), [full])


def test_only_full_scans_of_the_scenes_that_were_played_are_borrowed():
    rows = [play(scene, "full", [0], [1]) for scene in "ab"] + [
        play("a", "care", [0], [1], camera_latency=1)
    ]
    (plays,) = plays_by_setting(rows)
    assert list(plays.scenes) == list(plays.tallies("full", 1.0)) == ["a"]


def test_floor_seeds_are_averaged_per_scene():
    rows = [
        play("a", "care", found(4, sighted), [sighted] * 4, floor_seed=n)
        for n, sighted in enumerate((1, 2, 3))
    ]
    (plays,) = plays_by_setting(rows)
    assert plays.tallies("care", 0.1) == {"a": Tally(4, 2, 6 * 2, 4 * FRAMES, 8)}
    assert np.mean(plays.delays("care", 0.1, "a") == 0, axis=0) == pytest.approx(
        [1, 2 / 3, 1 / 3, 0]
    )


def test_policies_that_no_car_can_have_are_marked():
    both = study({"care": (4, 5), "history-oracle": (4, 5), "random-points": (4, 5)})
    (plays,) = plays_by_setting(both)
    marks = ["care", "history-oracle †", "random-points ‡"]
    assert [plays.marked(policy) for policy in plays.policies] == marks


def test_plays_of_two_films_of_a_scene_are_refused_and_two_camera_detectors_are_two_settings():
    rows = study({"care": (5, 5), "history": (4, 5)}, scenes=2)
    with pytest.raises(InvalidInput, match="scene scene 001 are of two films"):
        plays_by_setting([*rows[:-1], rows[-1] | {"film_hash": "another"}])
    seen = [row | {"camera_detections": "1f", "film_hash": "another"} for row in rows]
    plain, detected = plays_by_setting([*rows, *seen])
    assert detected.setting.label == "generated streets, detector returns, camera detections 1f"
    assert len(plain.scenes) == len(detected.scenes) == 2
