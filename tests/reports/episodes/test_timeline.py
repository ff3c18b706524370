"""The timeline of an episode and of a play."""

import io
import re
from types import SimpleNamespace

from rich.console import Console

from care_sim.loops.records import Keyframe
from care_sim.reports.episodes.timeline import (
    encounter_text,
    episode_timeline,
    scene_timeline,
    with_gaps,
)
from care_sim.sources.named import source_of
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import play_grid
from care_sim.study.scene_play import trace_scene
from tests.helpers.made_rows import row

ENCOUNTER = {
    "who": "child",
    "side": "left",
    "along_m": 60.0,
    "way": "turn",
    "course": "conflict",
    "occluder": "van",
    "occluder_reported": True,
    "set_off": True,
    "view_keyframe": 1,
    "detection_keyframe": 2,
    "detection_distance_m": 12.34,
    "hit": True,
}


def frame(number, braking):
    return Keyframe(number, float(number), (), False, False, braking, 8.0, 30.0, 30.0, 28.0, None)


def test_only_the_keyframes_about_a_change_are_shown():
    frames = [frame(n, braking=n >= 5) for n in range(10)]
    lines = episode_timeline(EpisodeConfig("ncap", "care"), {}, frames).lines
    assert [line and line[0] for line in lines] == ["0.0", None, "4.0", "5.0", None, "9.0"]
    assert lines[2] == ("4.0", "8.0", "30.0", "28.0", "0", "", "", "")
    assert lines[3][-1] == "yes"


def test_of_a_play_only_the_keyframes_at_which_somebody_appears_are_shown(drive):
    source = source_of(f"argoverse2:{drive}")
    (config,) = play_grid(source, source.scenes(), ["full"], [1.0])
    timeline = scene_timeline(config, trace_scene(config, config.film()))
    # A person appears after 2.5 s.
    assert [line and line[0] for line in timeline.lines] == ["0.0", None, "2.5", None, "4.5"]
    assert timeline.lines[2][3:5] == ("1", "1")
    (event,) = timeline.events
    assert re.fullmatch(r"  2\.5 s  pedestrian .* m: found at once", event)
    assert timeline.outcome["found at once %"] == "100.0"


def test_a_run_that_is_left_out_is_one_gap_however_long_it_is():
    assert with_gaps("abcdef", [4]) == ["a", None, "e", "f"]
    assert with_gaps("a", [0, -1]) == ["a"]
    assert with_gaps("", []) == []


def test_what_the_seed_drew_and_the_whole_outcome_of_a_drive_are_printed():
    told = {
        "episode_hash": "0",
        "wall_s": 1.0,
        "drawn.test": "CPTA-50",
        "hit_kind": "child",
        "hit_standing": False,
        "progress": 0.5,
        "encounters": [ENCOUNTER],
    }
    config = EpisodeConfig("drive", "care")
    terminal = io.StringIO()
    frames = [frame(n, braking=False) for n in range(3)]
    episode_timeline(config, row(config, 9.0, **told), frames).print(Console(file=terminal))
    lines = dict(re.findall(r"^([\w.]+)[ \d:]* +(\S.*)$", terminal.getvalue(), re.M))
    shown = [lines[name] for name in ("drawn.test", "hit_kind", "hit_standing", "progress")]
    assert shown == ["CPTA-50", "child", "no", "0.50"]
    assert lines["encounter"].startswith("child from the left")


def test_an_encounter_tells_who_came_and_what_came_of_it():
    frames = [SimpleNamespace(time_s=n / 10) for n in range(3)]
    who = "child from the left (conflict, turn), behind van (reported)"
    assert encounter_text(ENCOUNTER, frames) == (
        f"{who}: in view at 0.1 s; detected at 0.2 s, 12.3 m; hit"
    )
    missed = {"view_keyframe": None, "detection_keyframe": None, "hit": False}
    assert encounter_text(ENCOUNTER | missed, frames) == f"{who}: never in view; not detected"
    assert encounter_text(ENCOUNTER | {"set_off": False}, frames) == f"{who}: never set off"
