"""Clips read back: how many pictures, how long each, what they show; and that filming changes
nothing.
"""

import re
import sys
from itertools import count

import gymnasium
import numpy as np
import pytest
from PIL import Image, ImageSequence

import care_sim
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.cli import main
from care_sim.commands.compare import play_side_by_side
from care_sim.loops.records import Keyframe
from care_sim.policies.paper.reserves import Care
from care_sim.reports.episodes.clips import Clip, outcome_words
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode, trace
from care_sim.viewer.palette import DETECTED, HIT
from care_sim.viewer.pictures.clip_files import ENDINGS, write_clip
from care_sim.viewer.pictures.episode_view import verdict
from care_sim.viewer.pictures.keyframe import PANEL_WIDTH, PICTURE_WIDTH

SIZE = (64, 48)
COLOURS = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
PICTURES = [Image.new("RGB", SIZE, colour) for colour in COLOURS]


def episode(policy, duration_s):
    return EpisodeConfig("dartout", policy, scenario_parameters=(("duration_s", duration_s),))


def frames_of(path):
    """Arrays of a clip's pictures, each as often as it is shown for a tenth of a second."""
    if path.suffix == ".mp4":
        ffmpeg = pytest.importorskip("imageio_ffmpeg")
        reader = ffmpeg.read_frames(str(path))
        about = next(reader)
        assert about["fps"] == 10
        width, height = about["size"]
        return [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in reader]
    with Image.open(path) as clip:
        assert clip.info["loop"] == 0
        shown = [
            (np.asarray(frame.convert("RGB")), frame.info["duration"])
            for frame in ImageSequence.Iterator(clip)
        ]
    return [frame for frame, duration in shown for _ in range(round(duration / 100))]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_clip_shows_every_picture_in_turn_and_holds_the_last(ending, tmp_path):
    path = tmp_path / "deeper" / f"clip{ending}"
    if ending == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    write_clip(path, PICTURES, 0.1, 0.3)
    frames = frames_of(path)
    assert len(frames) == 5
    for frame, colour in zip(frames, [COLOURS[0], COLOURS[1], *[COLOURS[2]] * 3], strict=True):
        assert frame.shape == (*SIZE[::-1], 3)
        assert np.abs(frame.reshape(-1, 3).mean(axis=0) - colour).max() < 12


def test_a_clip_that_cannot_be_written_is_refused_before_an_episode_is_played(
    tmp_path, monkeypatch
):
    with pytest.raises(InvalidInput, match=r"ending of a clip '\.avi'; known: \.gif, \.mp4, \.png"):
        Clip(tmp_path / "clip.avi")
    with pytest.raises(InvalidInput, match="is a folder"):
        Clip(tmp_path.rename(tmp_path.with_suffix(".gif")))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtra, match=r"extra 'video': pip install -c .* '\.\[video\]'"):
        Clip(tmp_path / "clip.mp4")


def test_filming_leaves_the_episode_as_it_was(tmp_path):
    film = Clip(tmp_path / "clip.png")
    filmed, _ = trace(episode("care", 0.3), film.episode("care"))
    film.write()
    assert filmed["episode_hash"] == trace(episode("care", 0.3))[0]["episode_hash"]
    with Image.open(tmp_path / "clip.png") as clip:
        assert (clip.n_frames, clip.size) == (3, (PICTURE_WIDTH, 720))


@pytest.mark.parametrize(
    ("error", "code", "printed"),
    [
        (RuntimeError("no idea"), 1, ["history", "full", "Filmed"]),
        (KeyboardInterrupt, 130, ["history"]),
    ],
)
def test_what_was_played_is_printed_when_a_policy_fails_or_the_rest_is_interrupted(
    error, code, printed, tmp_path, monkeypatch, capsys
):
    demand, keyframes = Care.demand, count()

    def failing(policy, belief):
        if next(keyframes) == 2:
            raise error
        return demand(policy, belief)

    monkeypatch.setattr(Care, "demand", failing)
    options = ["--scenario-parameters", "duration_s=0.4", "--video", str(tmp_path / "clip.png")]
    with pytest.raises(SystemExit) as end:
        main(["compare", "dartout", "--policies", "history", "care", "full", *options])
    out, err = capsys.readouterr()
    assert end.value.code == code
    assert re.findall("^ ?(history|care|full|Filmed) ", out, re.M) == printed
    if code == 1:
        assert err.count("failed: ") == 1
        assert "RuntimeError: no idea" in err
        with Image.open(tmp_path / "clip.png") as clip:
            assert clip.n_frames == 4
            assert clip.width > 3 * PANEL_WIDTH


def test_episodes_side_by_side_end_together(tmp_path, capsys):
    """The shorter one keeps its last picture; the rows are those of the episodes on their own."""
    configs = [episode("history", 0.2), episode("care", 0.4)]
    assert play_side_by_side(configs, video=tmp_path / "clip.png") == []
    words = [line.split() for line in capsys.readouterr().out.splitlines()]
    fired = {row[0]: int(row[-1]) for row in words if row and row[0] in ("history", "care")}
    assert fired == {config.policy: run_episode(config)["rays_fired"] for config in configs}
    with Image.open(tmp_path / "clip.png") as clip:
        pictures = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(clip)]
    assert len(pictures) == 4
    left, right = ([each[:, part] for each in pictures] for part in (slice(500), slice(-500, None)))
    assert np.array_equal(left[1], left[3])
    assert not np.array_equal(left[0], left[1])
    assert not np.array_equal(right[1], right[3])


def test_a_film_starts_where_it_is_told_and_ends_with_the_outcome(tmp_path):
    whole, late = tmp_path / "whole.png", tmp_path / "late.png"
    play_side_by_side([episode("history", 0.4)], video=whole)
    play_side_by_side([episode("history", 0.4)], video=late, video_start=0.2)
    shown = frames_of(late)
    # Two keyframes are left, the last of which stays for 2.5 s.
    assert len(shown) == 1 + 25
    assert np.array_equal(shown, frames_of(whole)[2:])
    green = (np.asarray(shown) == DETECTED.colour).all(axis=-1).sum(axis=(1, 2))
    assert green[0] < 1000 < green[-1]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--video-start", "1"], "--video-start has no meaning without --video"),
        (["--video", "a.gif", "--video-start", "-1"], "video-start must be a finite number >= 0"),
    ],
)
def test_a_start_needs_a_film_and_is_not_negative(options, line, capsys):
    with pytest.raises(SystemExit) as end:
        main(["run", "dartout", *options])
    assert end.value.code == 2
    assert line in capsys.readouterr().err


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({"impact_speed_mps": 7.78, "hit_at_front": True}, "collision at 28 km/h"),
        ({"impact_speed_mps": 0.0, "hit_at_front": False, "hit_kind": "car"}, "hit by car"),
        ({"clearance_m": 3.44}, "clear by 3.4 m"),
        ({"clearance_m": None}, "no collision"),
    ],
)
def test_the_outcome_in_words(row, words):
    row["collision"] = "impact_speed_mps" in row
    assert outcome_words(row) == (words, HIT.colour if row["collision"] else DETECTED.colour)


@pytest.mark.parametrize(
    ("states", "words"),
    [
        ([0], "not in view yet"),
        ([0, 1, 1], "in view for 0.2 s, not detected"),
        ([0, 2], "detected at 19.0 m; clearance 17.0 m"),
        (
            [0, 1, 1, 2, 2],
            "detected at 17.0 m, 0.2 s after coming into view; clearance 14.0 m",
        ),
    ],
)
def test_the_verdict_of_a_panel(states, words):
    """A record per 0.1 s: out of view, in view, detected; the person is 1 m nearer each time."""
    frames = [
        Keyframe(n, 0.1 * n, (), state > 0, state > 1, False, 8.0, 20.0 - n, 20.0, 18.0 - n, None)
        for n, state in enumerate(states)
    ]
    assert verdict(frames, 0.1).words == words


def test_gymnasiums_wrapper_records_a_video(tmp_path):
    pytest.importorskip("moviepy")
    env = gymnasium.make("CARE-Dartout-v0", render_mode="rgb_array", duration_s=0.3)
    env = gymnasium.wrappers.RecordVideo(env, str(tmp_path))
    policy = care_sim.make_policy("care", env)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        observation, *_ = env.step(policy(observation))
    env.close()
    frames = frames_of(tmp_path / "rl-video-episode-0.mp4")
    assert len(frames) == 4
    assert frames[0].shape == (720, PICTURE_WIDTH, 3)
