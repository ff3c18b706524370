"""A recording of an episode of either loop, held against the episode's own row and keyframes."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.firing.actions import CHOSEN, EXPLOITATION, FLOOR, RESERVE, SHARES
from care_sim.core.grid import AngularGrid
from care_sim.envs.wrappers.record_rerun import RecordRerun, recording
from care_sim.loops.watcher import Watcher
from care_sim.sources.named import source_of
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode, trace
from care_sim.study.play_config import play_grid
from care_sim.study.scene_play import trace_scene
from care_sim.viewer.recording import entities
from care_sim.viewer.recording.recording import Recording
from tests.helpers.lidars import CORNERS

CONFIG = EpisodeConfig("dense", "care", 0.05, 1, false_negative_rate=0.2, false_positive_rate=0.3)


@pytest.fixture(scope="module")
def episode(tmp_path_factory, read):
    """Row, keyframes, how the loop stood after each, and what was recorded."""
    path = tmp_path_factory.mktemp("recordings") / "out.rrd"
    after = []
    row, keyframes = trace(
        CONFIG,
        lambda loop, _frame: after.append((loop.sensor, loop.belief)),
        wrap=lambda env, policy: RecordRerun(env, path, policy),
    )
    return row, keyframes, after, read(path)


@pytest.fixture(scope="module")
def play(drive, tmp_path_factory, read):
    """The same of a play of the open loop: as it goes without a recording, with one, and what was
    recorded.
    """
    path = tmp_path_factory.mktemp("recordings") / "out.rrd"
    source = source_of(f"argoverse2:{drive}")
    faults = {"false_negative_rate": 0.3, "false_positive_rate": 0.5}
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05], **faults)
    film = config.film()
    plain = trace_scene(config, film)
    played = trace_scene(config, film, wrap=lambda env, policy: RecordRerun(env, path, policy))
    return plain, played, read(path)


def test_settings_of_rerun_switch_no_recording_off(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("RERUN", "off")
    with Recording(tmp_path / "out.rrd", ["care"]):
        pass
    assert (tmp_path / "out.rrd").stat().st_size > 1000
    assert capfd.readouterr().err == ""


def test_recording_changes_nothing(episode, play):
    row, *_ = episode
    assert row["episode_hash"] == run_episode(CONFIG)["episode_hash"]
    plain, played, _ = play
    assert played.row["episode_hash"] == plain.row["episode_hash"]


def test_the_returns_of_several_lidars_are_recorded_in_the_frame_of_the_first(tmp_path, read):
    short = (("duration_s", 0.2),)
    config = EpisodeConfig("dense", "care", 0.2, 2, sensor=CORNERS, scenario_parameters=short)
    path = tmp_path / "out.rrd"
    seen = []
    trace(
        config,
        lambda loop, _frame: seen.append(loop.belief.ranges.ravel()),
        wrap=lambda env, policy: RecordRerun(env, path, policy),
    )
    grid = CORNERS.grid
    found = read(path)
    clouds = found.column("care/world/lidar/returns", "Points3D:positions")
    for ranges, cloud in zip(seen, clouds, strict=True):
        cells = np.flatnonzero((ranges > 0) & (ranges < grid.range_m))
        np.testing.assert_allclose(cloud, grid.points(cells, ranges[cells]), rtol=1e-5, atol=1e-4)
    origin = np.array(found.column("care/world/lidar", "Transform3D:translation")[-1][0])
    centres, halves = (
        np.array(found.column("care/world/bodies", f"Boxes3D:{name}")[-1])
        for name in ("centers", "half_sizes")
    )
    # Points above the road lie in a body where it is drawn; all bodies stand along the road.
    points = np.add(clouds[-1], origin)
    high = points[:, 2] > 0.05
    inside = np.abs(points[high, None] - centres) < np.hypot(halves[:, :1], halves[:, 1:2]) + 0.02
    assert inside.all(axis=2).any(axis=1).all()
    assert {*grid.lidars_of(cells[high]).tolist()} == {0, 1, 2}


def test_every_entity_is_documented_and_every_documented_one_is_there(episode, play):
    for found, open_loop in ((episode[-1], False), (play[2], True)):
        there = {*found.rows, *found.fixed}
        names = {name.removeprefix("care/") for name in there if name.startswith("care/")}
        documented = entities.entities_of(open_loop)
        assert names == set(documented)
        (about,) = found.fixed["about"]["TextDocument:text"]
        assert all(f"`{name}` | {content}" in about for name, content in documented.items())
    both = {**entities.entities_of(False), **entities.entities_of(True)}
    assert both == entities.ENTITIES


def test_measures_are_those_of_the_keyframes(episode):
    row, keyframes, _, found = episode
    assert found.seconds == pytest.approx({frame.index: frame.time_s for frame in keyframes})
    assert {*found.rows["care/grid/cells"]} == {*range(60)}
    for name, unit in (("speed", "mps"), ("distance", "m"), ("clearance", "m")):
        own = [getattr(frame, f"{name}_{unit}") for frame in keyframes]
        assert found.numbers(f"care/measures/{name}") == own
    assert found.numbers("care/measures/braking") == [float(frame.braking) for frame in keyframes]
    for name, state, flags in (
        ("actor", "detected", [frame.detected for frame in keyframes]),
        ("brake", "on", [frame.braking for frame in keyframes]),
    ):
        changes = found.rows[f"care/states/{name}"].items()
        assert flags.index(True) in [n for n, told in changes if state in told["StateChange:state"]]
    (text,) = found.fixed["care/outcome"]["TextDocument:text"]
    assert f"| detection_distance_m | {row['detection_distance_m']} |" in text


def test_measures_of_a_play_are_those_of_its_keyframes(play):
    _, played, found = play
    assert found.numbers("care/measures/found") == [f.objects_found for f in played.keyframes]
    assert found.numbers("care/measures/objects") == [f.objects for f in played.keyframes]
    paid = [found.numbers(f"care/budget/{SHARES[n]}") for n in (EXPLOITATION, RESERVE, FLOOR)]
    assert np.sum(paid, axis=0) == pytest.approx([100.0] * len(played.keyframes))
    (event,) = [text for row in found.rows["care/events"].values() for text in row["TextLog:text"]]
    assert event.startswith("pedestrian ")
    (text,) = found.fixed["care/outcome"]["TextDocument:text"]
    assert f"| overall_recall | {played.row['overall_recall']} |" in text


def test_cells_and_budget_are_those_that_fired(episode):
    row, keyframes, _, found = episode
    pictures = found.column("care/grid/cells", "SegmentationImage:buffer")
    fired = {
        share: found.numbers(f"care/budget/{SHARES[share]}")
        for share in (EXPLOITATION, RESERVE, FLOOR)
    }
    total = 0
    for number, (picture, frame) in enumerate(zip(pictures, keyframes, strict=True)):
        cells = np.array(picture, np.uint8).reshape(-1, entities.ROW_PIXELS, 512)
        assert (cells[:, 0] == cells[:, 1]).all()
        shares = cells[:, 0, ::-1].ravel()
        np.testing.assert_array_equal(np.flatnonzero(shares), frame.fired)
        total += len(frame.fired)
        for share, percents in fired.items():
            assert percents[number] == pytest.approx(
                100 * np.count_nonzero(shares == share) / round(0.05 * 16384)
            )
    assert total == row["rays_fired"]
    assert max(fired[RESERVE]) > 0
    assert max(fired[EXPLOITATION]) == pytest.approx(70, abs=0.1)


def test_camera_boxes_are_those_of_the_belief(episode):
    _, _, after, found = episode
    kinds = ("explained", "residual")
    columns = [found.column(f"care/world/lidar/camera/{kind}", "Boxes2D:centers") for kind in kinds]
    labels = found.column("care/world/lidar/camera/residual", "Points2D:labels")
    for number, (_, belief) in enumerate(after[:-1], 1):
        boxes = belief.detections.boxes
        drawn = np.array([centre for column in columns for centre in column[number] or []]).reshape(
            -1, 2
        )
        expected = np.column_stack([boxes[:, [0, 2]].mean(axis=1), boxes[:, [1, 3]].mean(axis=1)])
        np.testing.assert_allclose(sorted(drawn.tolist()), sorted(expected.tolist()), atol=1e-3)
    assert any("false" in label for names in labels for label in names or [])
    missed = found.column("care/world/lidar/camera/missed", "Points2D:labels")
    assert any(names for names in missed)


def test_a_recorded_full_scan_is_small_too(tmp_path, read):
    """More returns than are drawn: what is drawn lies among them."""
    path = tmp_path / "full.rrd"
    after = []
    config = EpisodeConfig("dartout", "full", 1.0)
    trace(
        config,
        lambda loop, _frame: after.append(loop.belief),
        wrap=lambda env, policy: RecordRerun(env, path, policy),
    )
    assert path.stat().st_size < 5e6
    found = read(path)
    grid = AngularGrid()
    drawn = np.array(found.column("full/world/lidar/returns", "Points3D:positions")[7])
    ranges = after[7].ranges.ravel()
    returned = np.flatnonzero((ranges > 0) & (ranges < grid.range_m))
    assert len(returned) > entities.MOST_POINTS >= len(drawn) > entities.MOST_POINTS / 2
    cells = grid.cells_of(drawn)
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), ranges[cells], rtol=1e-5)
    assert len(set(cells)) == len(drawn)


def test_who_is_in_view_from_the_start_has_an_event(tmp_path, read):
    """Told by a first keyframe that is said to have it in view."""
    path = tmp_path / "out.rrd"
    with recording(path, ["agent"]) as file, gymnasium.make("CARE-Dartout-v0") as env:
        env.reset(seed=0)
        rig = env.unwrapped.rig
        episode = file.episode("agent", env.unwrapped.loop)
        watcher = Watcher(env.unwrapped.loop, 0.5)
        situation = watcher.situation()
        episode.look(env.unwrapped.loop)
        env.step(np.zeros(rig.grid.shape, np.float32))
        frame = replace(env.unwrapped.keyframes[-1], in_view=True)
        episode.keep(watcher.watched(situation, env.unwrapped.acted, None, frame))
        episode.end(None)
    assert "actor in view" in str(read(path).rows["agent/events"][0]["TextLog:text"])


def test_a_name_may_hold_anything_but_has_its_place(tmp_path, read):
    path, env = tmp_path / "out.rrd", gymnasium.make("CARE-Dartout-v0")
    with recording(path, ["a/b: c *"]) as file, RecordRerun(env, file, name="a/b: c *") as env:
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape, np.float32))
    assert r"a\/b\:\ c\ \*/world/bodies" in read(path).rows
    with pytest.raises(InvalidInput, match="'about' is a page"):
        Recording(path, ["about"])
    with pytest.raises(InvalidInput, match=r"'x'.*care"), Recording(path, ["care"]) as file:
        file.episode("x", None)


@pytest.mark.parametrize(("firing", "shots"), [("cells", 100), ("energy", 400)])
def test_raw_actions_are_chosen_or_floor_and_counted_in_shots(firing, shots, tmp_path, read):
    """With `energy` a cell that is asked for alone has four shots; the floor spends the rest."""
    path = tmp_path / "raw.rrd"
    with RecordRerun(gymnasium.make("CARE-Dartout-v0", firing=firing), path) as env:
        env.reset(seed=0)
        scores = np.zeros(env.action_space.shape, np.float32)
        scores[10, :100] = 1.0
        env.step(scores)
    found = read(path)
    assert found.numbers("agent/budget/chosen") == pytest.approx([100 * shots / 1638])
    assert found.numbers("agent/budget/floor") == pytest.approx([100 * (1638 - shots) / 1638])
    assert not found.rows["agent/budget/exploitation"]
    (cells,) = found.column("agent/grid/cells", "SegmentationImage:buffer")
    row = np.array(cells).reshape(-1, 512)[10 * entities.ROW_PIXELS]
    assert {*row[512 - 100 :].tolist()} == {CHOSEN}
    assert found.fixed["agent/outcome"]["TextDocument:text"] == ["The episode was not finished."]
