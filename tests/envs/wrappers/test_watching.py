"""Wrappers that watch: where they go, what they keep of several episodes, and that they change
nothing.
"""

import contextlib
import sys
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

import care_sim
from care_sim.core.firing.actions import CHOSEN
from care_sim.envs.wrappers.record_rerun import Watching, numbered
from care_sim.wrappers import ExportScans, RecordRerun, SectorReserve

LIBRARIES = {RecordRerun: "rerun", ExportScans: "open3d"}


@pytest.fixture(params=LIBRARIES, ids=lambda wrapper: wrapper.__name__)
def watcher(request):
    """The wrapper, where its library is installed; it makes out.rrd, a file or a folder."""
    if request.param is ExportScans:
        request.getfixturevalue("open3d")
    else:
        pytest.importorskip("rerun")
    return request.param


def make(name="CARE-Dartout-v0", **arguments):
    return gymnasium.make(name, disable_env_checker=True, **arguments)


@pytest.mark.parametrize(("wrapper", "extra"), [(RecordRerun, "viewer"), (ExportScans, "open3d")])
def test_a_missing_extra_is_named(wrapper, extra, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, LIBRARIES[wrapper], None)
    with pytest.raises(care_sim.MissingExtra, match=f"extra '{extra}'"):
        wrapper(make(), tmp_path / "out.rrd")


def test_what_is_not_watched_is_refused(watcher, tmp_path):
    with pytest.raises(care_sim.InvalidInput, match=r"watches a loop of CARE-Sim"):
        watcher(make("CartPole-v1"), tmp_path / "out.rrd")


def test_it_goes_around_and_under_wrappers_that_change_the_action(watcher, tmp_path):
    for name, env in (
        ("around.rrd", watcher(SectorReserve(make()), tmp_path / "around.rrd")),
        ("under.rrd", SectorReserve(watcher(make(), tmp_path / "under.rrd"))),
    ):
        with env:
            env.reset(seed=0)
            env.step(env.action_space.sample())
        assert (tmp_path / name).exists()


class Halves(gymnasium.ActionWrapper):
    """Leaves of any action the upper half of the grid."""

    def action(self, action):
        return np.where(np.arange(len(action))[:, None] < len(action) // 2, action, 0)


class Kept(Watching):
    """Keeps what it is told."""

    def __init__(self, env):
        super().__init__(env)
        self.moments = []
        self.ended = []

    def begin(self, loop, episode):
        pass

    def keep(self, moment):
        self.moments.append(moment)

    def end(self, outcome):
        self.ended.append(outcome)


@pytest.mark.parametrize("order", [lambda env: Kept(Halves(env)), lambda env: Halves(Kept(env))])
def test_shares_are_those_of_the_action_that_the_environment_got(order):
    with order(make()) as env:
        env.reset(seed=0)
        scores = np.zeros(env.action_space.shape, np.float32)
        scores[[10, -10], :100] = 1.0
        env.step(scores)
        kept = env if isinstance(env, Kept) else env.env
    (moment,) = kept.moments
    assert (moment.shares[10, :100] == CHOSEN).all()
    assert np.count_nonzero(moment.shares == CHOSEN) == 100


def test_an_episode_cut_short_has_no_outcome():
    with Kept(make(max_episode_steps=2)) as env:
        env.reset(seed=0)
        for _ in range(2):
            *_, truncated, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        assert truncated
        assert env.ended == [None]


def test_a_refused_first_action_does_not_begin_the_episode_twice(watcher, tmp_path):
    with watcher(make(), tmp_path / "out.rrd") as env:
        env.reset(seed=0)
        nothing = np.zeros(env.action_space.shape, np.float32)
        with pytest.raises(care_sim.InvalidInput, match="NaN"):
            env.step(nothing + np.nan)
        env.step(nothing)
    assert [path.name for path in tmp_path.iterdir()] == ["out.rrd"]


def test_an_episode_without_a_keyframe_is_closed(watcher, tmp_path):
    with watcher(make(), tmp_path / "out.rrd") as env:
        env.reset(seed=0)
        with pytest.raises(care_sim.InvalidInput, match="NaN"):
            env.step(np.full(env.action_space.shape, np.nan, np.float32))
    assert (tmp_path / "out.rrd").exists()


def test_the_environment_may_be_closed_before_its_watcher():
    env = Kept(make())
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape, np.float32))
    env.unwrapped.close()
    env.close()
    assert env.ended == [None]


def test_the_environment_is_closed_where_the_end_cannot_be_kept():
    class Full(Kept):
        def end(self, outcome):
            raise OSError("the disk is full")

    env = Full(make())
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape, np.float32))
    with pytest.raises(OSError, match="full"):
        env.close()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.loop  # noqa: B018


def test_two_environments_do_not_write_to_one_place(watcher, tmp_path):
    """Nor do the two of a vector environment; with a place each, both are kept."""
    nothing = np.zeros((2, *make().action_space.shape), np.float32)
    with contextlib.closing(
        SyncVectorEnv([lambda: watcher(make(), tmp_path / "out.rrd")] * 2)
    ) as envs:
        envs.reset(seed=0)
        with pytest.raises(care_sim.InvalidInput, match=r"out\.rrd"):
            envs.step(nothing)
    apart = [
        partial(lambda path: watcher(make(), path), tmp_path / f"out-{number}.rrd")
        for number in (5, 6)
    ]
    with contextlib.closing(SyncVectorEnv(apart)) as envs:
        envs.reset(seed=0)
        envs.step(nothing)
    assert {path.name for path in tmp_path.iterdir()} == {"out.rrd", "out-5.rrd", "out-6.rrd"}


def test_later_episodes_have_names_wherever_the_first_is_kept(tmp_path, monkeypatch):
    (tmp_path / "scans").mkdir()
    monkeypatch.chdir(tmp_path / "scans")
    assert numbered(Path("."), 0) == Path(".")
    assert numbered(Path(".."), 1) == tmp_path.with_name(f"{tmp_path.name}-1")
    assert numbered(Path("."), 1) == tmp_path / "scans-1"
    assert numbered(Path("out.rrd"), 2) == Path("out-2.rrd")


def test_every_episode_that_was_begun_is_kept_beside_the_first(watcher, tmp_path):
    with watcher(make(duration_s=0.3), tmp_path / "out.rrd") as env:
        nothing = np.zeros(env.action_space.shape, np.float32)
        for steps in (3, 1, 0, 3):
            env.reset(seed=0)
            for _ in range(steps):
                env.step(nothing)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out-1.rrd", "out-2.rrd", "out.rrd"]


def test_a_watched_episode_is_the_same_to_the_last_bit(watcher, tmp_path):
    bare = make(budget=0.05)
    watched = watcher(make(budget=0.05), tmp_path / "out.rrd")
    policy = care_sim.make_policy("care", bare)
    plain, seen = bare.reset(seed=5), watched.reset(seed=5)
    for _ in range(12):
        action = policy(plain[0])
        for name in plain[0]:
            np.testing.assert_array_equal(plain[0][name], seen[0][name])
        plain, seen = bare.step(action), watched.step(action)
        assert plain[1:4] == seen[1:4]
        np.testing.assert_array_equal(plain[4]["fired"], seen[4]["fired"])
    bare.close()
    watched.close()


def test_after_its_end_an_episode_is_over_for_the_watcher_too(watcher, tmp_path):
    with watcher(make(duration_s=0.1), tmp_path / "out.rrd") as env:
        nothing = np.zeros(env.action_space.shape, np.float32)
        env.reset(seed=0)
        env.step(nothing)
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(nothing)


def test_a_place_that_cannot_be_written_is_named(watcher, tmp_path):
    (tmp_path / "file").touch()
    with watcher(make(), tmp_path / "file" / "out.rrd") as env:
        env.reset(seed=0)
        with pytest.raises(OSError, match="file"):
            env.step(np.zeros(env.action_space.shape, np.float32))
