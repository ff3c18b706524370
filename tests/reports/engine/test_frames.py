"""Plays by setting: what is compared with what, and what floor seeds become; marks of policies."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.protocol.comparisons import means
from care_sim.reports.protocol.rows import plays_by_setting
from care_sim.study.rows.reading import setting_of
from care_sim.study.rows.settings import Setting
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


def test_a_name_for_files_tells_settings_apart():
    assert Setting("streets", detector="returns").slug == "streets"
    slug = Setting(
        "nuscenes", (("camera_latency", 1), ("lidar_dead_rows", (3, 4))), "cluster eps=0.5"
    ).slug
    assert slug == "nuscenes-cluster-eps-0.5-camera-latency-1-lidar-dead-rows--3--4-"


def test_settings_stay_apart_and_policies_carry_their_parameters():
    rows = [
        play("a", "care", [0], [1]),
        play("a", "care", [0], [1], **{"policy.margin": 2.0}),
        play("a", "care", [0], [1], detector="cluster"),
    ]
    plain, cluster = plays_by_setting(rows)
    assert plain.policies == ("care", "care margin=2")
    assert plain.other_than("care") == ("care margin=2",)
    assert plain.other_than("history") == ()
    assert cluster.policies == ("care",)


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


def test_a_scene_that_one_seed_lacks_is_left_out():
    rows = [
        row
        for row in study({"care": (4, 5)}, scenes=3)
        if (row["scene"], row["floor_seed"]) != ("scene 001", 2)
    ]
    (plays,) = plays_by_setting(rows)
    assert sorted(plays.tallies("care", 0.1)) == ["scene 000", "scene 002"]


def test_a_stratum_is_read_by_its_name():
    (plays,) = plays_by_setting([play("a", "care", [0, 6, 6, 0], [5, 0, 0, 5])])
    assert list(plays.strata) == ["range", "azimuth", "class", "entry"]
    assert plays.strata["range"] == ["below 20 m", "20 to 35 m", "from 35 m"]
    assert plays.tallies("care", 0.1, "range/below 20 m")["a"] == Tally(2, 2, 0, 2 * FRAMES, 10)
    assert plays.level(FIRST_SIGHTING, "care", 0.1, "range/20 to 35 m").by_event == 0.0


def test_a_scene_without_an_event_has_no_delays():
    rows = [play("a", "care", [], [], floor_seed=seed) for seed in range(3)]
    (plays,) = plays_by_setting(rows)
    assert plays.delays("care", 0.1, "a").shape == (3, 0)
    assert plays.level(FIRST_SIGHTING, "care", 0.1).by_event is None


def test_counts_are_averaged_over_floor_seeds():
    rows = [play("a", "care", [0], [1], floor_seed=n, tracks=float(n)) for n in range(3)]
    (plays,) = plays_by_setting(rows)
    assert means(plays, "tracks", 0.1) == {"a": 1.0}


def test_policies_that_no_car_can_have_are_marked():
    both = study({"care": (4, 5), "history-oracle": (4, 5), "random-points": (4, 5)})
    (plays,) = plays_by_setting(both)
    marks = ["care", "history-oracle †", "random-points ‡"]
    assert [plays.marked(policy) for policy in plays.policies] == marks
    assert plays.notes == (
        "† knows the truth: no policy of a car. ‡ saw the full scan first: saves no sensing.",
    )
    (plain,) = plays_by_setting(study({"care": (4, 5)}))
    assert plain.notes == ()


def test_seeds_that_count_other_events_are_refused():
    rows = [play("a", "care", found(n, 1), [1] * n, floor_seed=n) for n in (3, 4)]
    (plays,) = plays_by_setting(rows)
    with pytest.raises(InvalidInput, match=r"scene a: .* must be of one film"):
        plays.tallies("care", 0.1)


def test_plays_of_two_films_of_a_scene_are_refused_and_two_camera_detectors_are_two_settings():
    rows = study({"care": (5, 5), "history": (4, 5)}, scenes=2)
    with pytest.raises(InvalidInput, match="scene scene 001 are of two films"):
        plays_by_setting([*rows[:-1], rows[-1] | {"film_hash": "another"}])
    seen = [row | {"camera_detections": "1f", "film_hash": "another"} for row in rows]
    plain, detected = plays_by_setting([*rows, *seen])
    assert detected.setting.label == "generated streets, detector returns, camera detections 1f"
    assert len(plain.scenes) == len(detected.scenes) == 2


def test_a_share_needs_a_full_scan_that_finds_something():
    (plays,) = plays_by_setting(study({"care": (6, 5), "full": (8, 8)}))
    share = plays.share_of_full(FIRST_SIGHTING, "care", 0.1)
    assert (share.interval, share.scenes) == (pytest.approx((75.0, 75.0, 75.0)), 6)
    (alone,) = plays_by_setting(study({"care": (6, 5)}))
    assert alone.share_of_full(FIRST_SIGHTING, "care", 0.1) is None
    (blind,) = plays_by_setting(study({"care": (6, 5), "full": (0, 0)}))
    assert blind.share_of_full(FIRST_SIGHTING, "care", 0.1) is None


def test_a_setting_is_titled_by_the_number_of_its_scenes():
    assert [
        plays_by_setting(study({"care": (6, 5)}, scenes=scenes))[0].title.rpartition(": ")[2]
        for scenes in (1, 2)
    ] == ["1 scene", "2 scenes"]


def test_events_and_object_frames_are_counted_once_a_scene():
    (plays,) = plays_by_setting(study({"care": (6, 5), "full": (8, 8)}, scenes=2))
    assert (plays.counted(FIRST_SIGHTING), plays.counted(OVERALL)) == (40, 400)
    assert plays.counted(FIRST_SIGHTING, "entry/beyond") == 12
