"""A detector that asks for sweeps gets them of a recording, unless the user names a number."""

import numpy as np
import pytest

from care_sim.commands.options.results import ExportNuScenes, Judge
from care_sim.commands.options.studies import Protocol
from care_sim.commands.options.watching import Run
from care_sim.commands.shared.one_scene import maker_of
from care_sim.commands.shared.selection import source_named
from care_sim.core.types import CLASSES, Detections
from care_sim.envs.scenes import ReplayEnv
from care_sim.reports.page.played_rows import play_config_of
from care_sim.sources.film_checks import report_once
from care_sim.sources.named import source_of
from care_sim.study.judging import judge_scene
from care_sim.study.play_config import play_grid
from tests.sources.nuscenes.test_moments import swept

NAME = f"{__name__}:Clock"


class Clock:
    """A car whose score is a tenth for every time at which points were measured."""

    fields = ("x", "y", "z", "time_lag")
    sweeps = 10

    def detect(self, points, sensor_height_m):
        times = len(np.unique(points[:, 3].round(6)))
        return Detections([CLASSES.index("car")], [[9, 0, 0, 4, 2, 2, 0]], [0], [times / 10])


@pytest.fixture
def recording(tmp_path):
    """One keyframe of three has four sweeps before it."""
    return f"nuscenes:{swept(tmp_path, 0.1, 0.2, 0.3, 0.4)}"


@pytest.mark.parametrize(
    ("given", "counts"),
    [
        ({}, [0, 0, 0]),
        ({"detector": NAME}, [0, 4, 0]),
        ({"detector": NAME, "sweeps": 2}, [0, 1, 0]),
        ({"detector": NAME, "sweeps": 1}, [0, 0, 0]),
        ({"detector": NAME, "detector_parameters": {"sweeps": 3}}, [0, 2, 0]),
        ({"detector": "cluster", "detector_parameters": {"sweeps": 3}}, [0, 2, 0]),
    ],
)
def test_an_environment_has_the_sweeps_that_its_detector_asks_for(recording, given, counts):
    with ReplayEnv(source=recording, split="all", **given) as env:
        assert [len(shot.sweeps) for shot in env.film.shots] == counts


def test_commands_feed_the_detector_and_their_rows_tell_it(recording, tmp_path):
    told = {"source": recording, "split": "all", "detector": NAME}
    for options in (Protocol(**told), ExportNuScenes(**told, out=tmp_path / "boxes.json")):
        assert source_named(options, recording).recordings.sweeps == 10
    asked = Protocol(**told, sweeps=2)
    assert source_named(asked, recording).recordings.sweeps == 2
    made = Run(what=recording, split="all", detector=NAME)
    (play,) = maker_of(made, recording, ["care"], 0.1)(["care"])
    assert play.row()["sweeps"] == 10
    # A page plays them again, though nobody tells it how many there were.
    assert play_config_of(play.row(), source_of(recording, split="all")) == play


def test_each_of_several_detectors_is_judged_on_its_own_sweeps(recording):
    from care_sim.commands.judge import _plays

    names = ("cluster", NAME)
    options = Judge(source=recording, split="all", detectors=names)
    source = source_named(options, recording)
    (plays,) = _plays(options, names, source, source.scenes())
    assert [play.source.recordings.sweeps for play in plays] == [1, 10]
    _, judged = judge_scene(plays)
    scores = [row["detection_score"] for rows in judged.reported.values() for row in rows]
    # Three keyframes; before the second there were four sweeps.
    assert scores == pytest.approx([0.1, 0.5, 0.1])


def test_a_source_without_sweeps_says_so_once(capsys, tmp_path):
    report_once.cache_clear()
    line = f"holds no sweeps between its keyframes: detector {NAME} gets 1 per keyframe, and wants"
    for kind in ("streets", f"nuscenes:{swept(tmp_path)}"):
        options = Protocol(source=kind, detector=NAME, split=None if kind == "streets" else "all")
        for _ in range(2):
            source = source_named(options, kind)
        assert capsys.readouterr().err == f"care-sim: {kind.partition(':')[0]} {line} 10\n"
        assert (
            play_grid(source, source.scenes()[:1], ["care"], [0.1])[0].row().get("sweeps") is None
        )
