import io
from types import SimpleNamespace

from rich.console import Console

from care_sim.reports.episodes.timeline import encounter_text, eventful, print_timeline
from care_sim.study.episode_config import EpisodeConfig
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
THREE = [SimpleNamespace(time_s=n / 10) for n in range(3)]


def printed(config, **outcome):
    """The outcome that is printed of an episode without keyframes, by its labels."""
    told = {"episode_hash": "0", "wall_s": 1.0, **outcome}
    terminal = io.StringIO()
    print_timeline(config, row(config, 9.0, **told), [], Console(file=terminal, width=200))
    return terminal.getvalue()


def frame(number, braking):
    return SimpleNamespace(
        index=number, in_view=False, detected=False, braking=braking, impact_speed_mps=None
    )


def test_only_the_keyframes_about_a_change_are_shown():
    frames = [frame(n, braking=n >= 5) for n in range(10)]
    assert [f and f.index for f in eventful(frames)] == [0, None, 4, 5, None, 9]
    assert eventful(frames[:1]) == frames[:1]


def test_what_the_seed_drew_is_printed_with_the_outcome():
    text = printed(EpisodeConfig("ncap", "care"), **{"drawn.test": "CPTA-50"})
    assert "drawn.test" + 35 * " " + "CPTA-50" in text
    assert "hit_kind" not in text


def test_the_whole_outcome_of_a_drive_is_printed():
    drive = {
        "hit_kind": "child",
        "hit_at_front": True,
        "hit_standing": False,
        "needless_braking": 7,
        "progress": 0.5,
        "encounters": [ENCOUNTER | {"view_keyframe": None, "detection_keyframe": None}],
    }
    lines = dict(
        line.split(maxsplit=1)
        for line in printed(EpisodeConfig("drive", "care"), **drive).splitlines()
    )
    assert (lines["hit_kind"], lines["hit_at_front"], lines["hit_standing"]) == (
        "child",
        "yes",
        "no",
    )
    assert (lines["needless_braking"], lines["progress"]) == ("7", "0.50")
    assert lines["encounter"].startswith("1: child from the left")


def test_an_encounter_tells_who_came_and_what_came_of_it():
    who = "child from the left (conflict, turn), behind van (reported)"
    assert encounter_text(ENCOUNTER, THREE) == (
        f"{who}: in view at 0.1 s; detected at 0.2 s, 12.3 m; hit"
    )
    missed = {"view_keyframe": None, "detection_keyframe": None, "hit": False}
    assert encounter_text(ENCOUNTER | missed, THREE) == f"{who}: never in view; not detected"
    assert encounter_text(ENCOUNTER | {"set_off": False}, THREE) == f"{who}: never set off"
