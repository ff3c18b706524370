"""Predictions for runs of synthetic episodes whose durations are known."""

import heapq
import math

import numpy as np
import pytest

from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.progress import ProgressLines, ProgressReporter, RemainingTime, rounded_duration
from care_sim.study.runner import Failure

POLICIES = ["history", "all-camera", "care", "care-sbf", "random", "full"]
SEEDS = 20


def sweep():
    configs = grid(["dartout", "dense", "cutin"], POLICIES, [0.05, 0.1], range(SEEDS))
    return sorted(configs, key=lambda config: config.seed)


def seconds(config, random):
    """A street takes half as long again, a full scan ten times as long; a fifth more or less by
    chance.
    """
    base = (10.0 if config.policy == "full" else 1.0) * (1.5 if config.scenario == "dense" else 1.0)
    return base * random.uniform(0.8, 1.2)


def play(configs, workers, remaining=None):
    """Play on a synthetic clock; the truth and, at every landing, when it was and what was
    predicted then.
    """
    random = np.random.default_rng(0)
    remaining = remaining or RemainingTime(configs)
    flying, predictions, waiting, now = [], [], list(reversed(configs)), 0.0
    while waiting or flying:
        while waiting and len(flying) < workers:
            took = seconds(waiting[-1], random)
            heapq.heappush(flying, (now + took, len(waiting), took, waiting.pop()))
        now, _, took, config = heapq.heappop(flying)
        remaining.finished(config, took)
        predictions.append((now, now + remaining.remaining_s(workers)))
    return now, predictions


@pytest.mark.parametrize(("workers", "share"), [(1, 0.05), (2, 0.05), (8, 0.1)])
def test_soon_the_whole_is_known_to_a_tenth(workers, share):
    """Many workers still fly the first slow episodes when the quick ones of a twentieth have
    landed.
    """
    configs = sweep()
    truth, predictions = play(configs, workers)
    for _, predicted in predictions[round(share * len(configs)) :]:
        assert predicted == pytest.approx(truth, rel=0.1)
    assert predictions[-1][1] == truth


def test_the_mean_of_all_would_be_far_off():
    """The same run with the slow policy last, predicted from the mean of all that have landed. That
    is why the prediction looks at the settings of an episode.
    """
    configs = sorted(sweep(), key=lambda config: config.policy == "full")
    truth, predictions = play(configs, 1)
    now, _ = predictions[len(configs) // 2]
    assert now / (len(configs) // 2) * len(configs) < 0.6 * truth


def test_an_earlier_run_tells_before_the_first_episode_and_then_gives_way():
    configs = sweep()
    earlier = [
        (config, 3 * seconds(config, np.random.default_rng(1)))
        for config in configs
        if config.seed < 2
    ]
    rest = [config for config in configs if config.seed >= 2]
    remaining = RemainingTime(rest, earlier)
    assert remaining.remaining_s(4) == pytest.approx(3 * play(rest, 4)[0], rel=0.25)
    truth, predictions = play(rest, 4, remaining)
    assert predictions[len(rest) // 10][1] == pytest.approx(truth, rel=0.1)


def test_the_closest_likeness_counts():
    few, many, half, slow = (
        EpisodeConfig("dense", "care", scenario_parameters=(("vehicles", 0),)),
        EpisodeConfig("dense", "care", scenario_parameters=(("vehicles", 7),)),
        EpisodeConfig("dartout", "care", budget=0.05),
        EpisodeConfig("cutin", "history"),
    )
    remaining = RemainingTime([few, many, half, slow, EpisodeConfig("dense", "care", seed=1)])
    assert math.isnan(remaining.remaining_s(1))
    remaining.finished(few, 1.0)
    remaining.finished(many, 5.0)
    assert remaining.remaining_s(1) == 3 * 3.0
    remaining.finished(slow, 9.0)
    assert remaining.remaining_s(1) == 2 * 3.0
    assert remaining.waiting == 2


def test_the_longest_episode_bounds_what_many_workers_can_do():
    remaining = RemainingTime(
        [EpisodeConfig("cutin", "full", budget=1.0, seed=seed) for seed in range(4)]
    )
    remaining.finished(EpisodeConfig("cutin", "full", budget=1.0), 10.0)
    assert (remaining.remaining_s(100), remaining.remaining_s(2)) == (10.0, 15.0)
    assert remaining.remaining_s(0) == 30.0


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


def test_the_reporter_counts_down_and_says_how_good_it_was():
    clock, shown = Clock(), []
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(40)]
    reporter = ProgressReporter(
        RemainingTime(configs), lambda done, left: shown.append((done, left)), 50, clock
    )
    reporter.playing(0)
    reporter.playing(2)
    for config in configs:
        clock.now += 1.0
        reporter.finished(config, {"wall_s": 2.0})
    clock.now += 0.5
    reporter.playing(2)
    assert shown[:3] == [(10, "no worker is connected"), (10, ""), (11, "39 s left")]
    assert shown[-1] == (50, "0 s left")
    assert reporter.summary("episode") == "40 episodes took 0:00:40; 0:00:40 predicted after 5%"


def test_an_episode_that_fails_is_counted_and_takes_no_time():
    shown = []
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(3)]
    reporter = ProgressReporter(
        RemainingTime(configs), lambda done, left: shown.append((done, left)), 3, Clock()
    )
    reporter.playing(1)
    reporter.finished(configs[0], None)
    # Nothing is known of the time of the two that are left.
    assert shown[-1] == (1, "")
    assert reporter.summary("episode") == "3 episodes took 0:00:00"


def test_what_was_begun_before_the_first_had_ended_tells_nothing_of_the_rest():
    """Here the first two compile for a minute."""
    clock, shown = Clock(), []
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(40)]
    reporter = ProgressReporter(
        RemainingTime(configs), lambda done, left: shown.append((done, left)), 40, clock
    )
    reporter.playing(2)
    for config in configs[:2]:
        reporter.begun([config])
    for number, config in enumerate(configs):
        clock.now += 30.0 if number < 2 else 1.0
        reporter.finished(config, {"wall_s": 60.0 if number < 2 else 2.0})
        if following := configs[number + 2 : number + 3]:
            reporter.begun(following)
    assert shown[1:4] == [(1, ""), (2, ""), (3, "37 s left")]
    assert shown[-1] == (40, "0 s left")
    assert reporter.summary("episode") == "40 episodes took 0:01:38; 0:01:38 predicted after 8%"


def test_a_run_of_one_round_is_never_predicted():
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(20)]
    reporter = ProgressReporter(RemainingTime(configs), lambda _done, _left: None, 20, Clock())
    reporter.playing(2)
    reporter.begun(configs)
    for config in configs:
        reporter.finished(config, {"wall_s": 2.0})
    assert reporter.summary("episode") == "20 episodes took 0:00:00"


def test_that_the_first_take_longer_is_said_once_and_nothing_done_is_told_each_minute(capsys):
    clock = Clock()
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(3)]
    reporter = ProgressReporter(
        RemainingTime(configs), ProgressLines(3, "episodes", clock), 3, clock
    )
    for now in range(0, 140, 2):
        clock.now = float(now)
        reporter.playing(2)
    first, *lines = capsys.readouterr().err.splitlines()
    assert first.startswith("the first take longer on a machine that has not played before")
    assert lines == ["episodes 0/3"] * 3


def test_who_sees_the_first_end_soon_is_not_asked_for_patience(capsys):
    clock = Clock()
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(3)]
    reporter = ProgressReporter(RemainingTime(configs), lambda _done, _left: None, 3, clock)
    clock.now = 5.0
    reporter.finished(configs[0], {"wall_s": 5.0})
    clock.now = 50.0
    reporter.playing(2)
    assert capsys.readouterr().err == ""


def test_the_first_failure_is_told_at_once_and_no_other_before_the_end(capsys):
    configs = [EpisodeConfig("dartout", "care", seed=seed) for seed in range(3)]
    reporter = ProgressReporter(RemainingTime(configs), lambda _done, _left: None, 3, Clock())
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


def test_of_a_single_task_there_are_no_others_that_go_on(capsys):
    config = EpisodeConfig("dartout", "care")
    reporter = ProgressReporter(RemainingTime([config]), lambda _done, _left: None, 1, Clock())
    reporter.finished(config, None)
    reporter.failed(Failure(config, "no idea"))
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("duration", "text"),
    [(0.4, "0 s"), (89.4, "89 s"), (90, "2 min"), (3600, "60 min"), (12000, "3 h 20 min")],
)
def test_durations_as_people_say_them(duration, text):
    assert rounded_duration(duration) == text
