"""Predictions for runs of synthetic episodes whose durations are known, and how they are shown."""

import heapq

import numpy as np
import pytest

from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.progress import ProgressLines, ProgressReporter, rounded_duration
from care_sim.study.runner import Failure


class Shown:
    """A reporter of a run, and what it has shown."""

    def __init__(self, configs, total=None):
        self.told = []
        total = len(configs) if total is None else total
        self.reporter = ProgressReporter(
            configs, lambda done, left: self.told.append((done, left)), total
        )


def seeds(count):
    return [EpisodeConfig("dartout", "care", seed=seed) for seed in range(count)]


def seconds(config, random):
    """A street takes half as long again, a full scan ten times as long; a fifth more or less by
    chance.
    """
    base = (10.0 if config.policy == "full" else 1.0) * (1.5 if config.scenario == "dense" else 1.0)
    return base * random.uniform(0.8, 1.2)


@pytest.mark.parametrize(("workers", "share"), [(1, 0.05), (2, 0.05), (8, 0.1)])
def test_soon_the_whole_is_known_to_a_tenth(workers, share):
    """Many workers still fly the first slow episodes when the quick ones of a twentieth have
    landed.
    """
    policies = ["history", "all-camera", "care", "care-sbf", "random", "full"]
    configs = grid(["dartout", "dense", "cutin"], policies, [0.05, 0.1], range(20))
    configs = sorted(configs, key=lambda config: config.seed)
    random, reporter = np.random.default_rng(0), Shown(configs).reporter
    reporter.playing(workers)
    flying, predictions, waiting, now = [], [], configs[::-1], 0.0
    while waiting or flying:
        while waiting and len(flying) < workers:
            took = seconds(waiting[-1], random)
            heapq.heappush(flying, (now + took, len(waiting), took, waiting.pop()))
        now, _, took, config = heapq.heappop(flying)
        reporter.finished(config, {"wall_s": took})
        predictions.append(now + reporter.remaining_s())
    for predicted in predictions[round(share * len(configs)) :]:
        assert predicted == pytest.approx(now, rel=0.1)
    assert predictions[-1] == now


def test_the_tasks_of_a_policy_count_before_those_of_others():
    configs = [EpisodeConfig("dense", policy) for policy in ("care", "history", "random")]
    reporter = Shown([*configs, *configs]).reporter
    reporter.playing(1)
    reporter.finished(configs[0], {"wall_s": 1.0})
    reporter.finished(configs[1], {"wall_s": 5.0})
    # One of each is known, and two of random take the mean of all.
    assert reporter.remaining_s() == 1.0 + 5.0 + 2 * 3.0


def test_the_longest_episode_bounds_what_many_workers_can_do():
    configs = seeds(5)
    reporter = Shown(configs).reporter
    reporter.finished(configs[0], {"wall_s": 10.0})
    for workers, expected in ((100, 10.0), (2, 20.0), (0, 40.0)):
        reporter.playing(workers)
        assert reporter.remaining_s() == expected


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_lines_come_after_ten_seconds_then_each_minute_or_twentieth(capsys):
    clock = Clock()
    lines = ProgressLines(1000, "episodes", clock)
    for now, done in [
        (1, 0),
        (9, 5),
        (10, 6),
        (15, 500),
        (21, 501),
        (40, 510),
        (80, 520),
        (81, 530),
        (100, 579),
    ]:
        clock.now = now
        lines(done, "6 min left" if now > 10 else "")
    assert capsys.readouterr().err.splitlines() == [
        "episodes 6/1000",
        "episodes 501/1000, 6 min left",
        "episodes 530/1000, 6 min left",
    ]
    ProgressLines(3, "episodes", clock)
    waiting = ProgressLines(3, "episodes", clock)
    clock.now += 10
    waiting(0, "")
    assert "episodes 0/3, the first take longer on a machine" in capsys.readouterr().err


def test_the_reporter_shows_what_is_done_and_left():
    configs = seeds(40)
    shown = Shown(configs, total=50)
    shown.reporter.playing(0)
    shown.reporter.playing(2)
    # One that fails takes no time: nothing is known yet.
    shown.reporter.finished(configs[0], None)
    for config in configs[1:]:
        shown.reporter.finished(config, {"wall_s": 2.0})
    assert shown.told[:4] == [
        (10, "no worker is connected"),
        (10, ""),
        (11, ""),
        (12, "38 s left"),
    ]
    assert shown.told[-1] == (50, "0 s left")


def test_what_was_begun_before_the_first_had_ended_tells_nothing_of_the_rest():
    """Here the first two compile for a minute."""
    configs = seeds(40)
    shown = Shown(configs)
    shown.reporter.playing(2)
    for config in configs[:2]:
        shown.reporter.begun([config])
    for number, config in enumerate(configs):
        shown.reporter.finished(config, {"wall_s": 60.0 if number < 2 else 2.0})
        shown.reporter.begun(configs[number + 2 : number + 3])
    assert shown.told[1:4] == [(1, ""), (2, ""), (3, "37 s left")]


def test_the_first_failure_is_told_at_once_and_no_other_before_the_end(capsys):
    configs = seeds(3)
    reporter = Shown(configs).reporter
    told = []
    for config in configs:
        reporter.finished(config, None)
        reporter.failed(Failure(config, "RuntimeError: no idea (mine.py, line 6)"))
        told.append(capsys.readouterr().err)
    assert told == [
        f"care-sim: failed: {configs[0].label}: RuntimeError: no idea (mine.py, line 6); the "
        "others go on, Ctrl-C stops\n",
        "",
        "",
    ]


@pytest.mark.parametrize(
    ("duration", "text"),
    [(0.4, "0 s"), (89.4, "89 s"), (90, "2 min"), (3600, "60 min"), (12000, "3 h 20 min")],
)
def test_durations_as_people_say_them(duration, text):
    assert rounded_duration(duration) == text
