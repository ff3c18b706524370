"""Wrappers that watch: where they go, what they keep of several episodes, and that they change nothing."""

import sys

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.wrappers import ExportScans, RecordRerun, SectorReserve

LIBRARIES = {RecordRerun: "rerun", ExportScans: "open3d"}


@pytest.fixture(params=LIBRARIES, ids=lambda wrapper: wrapper.__name__)
def watcher(request):
    """The wrapper, where its library is installed; what it makes is called out.rrd, file or folder."""
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


def test_the_open_loop_is_refused(watcher, tmp_path):
    with pytest.raises(care_sim.InvalidInput, match="closed loop"):
        watcher(make("CARE-Street-v0"), tmp_path / "out.rrd")


def test_it_goes_under_wrappers_that_change_the_action(watcher, tmp_path):
    with pytest.raises(care_sim.InvalidInput, match="under wrappers"):
        watcher(SectorReserve(make()), tmp_path / "out.rrd")
    with SectorReserve(watcher(make(), tmp_path / "out.rrd")) as env:
        env.reset(seed=0)
        env.step(env.action_space.sample())
    assert (tmp_path / "out.rrd").exists()


def test_every_episode_that_was_begun_is_kept_beside_the_first(watcher, tmp_path):
    with watcher(make(duration_s=0.3), tmp_path / "out.rrd") as env:
        nothing = np.zeros(env.action_space.shape, np.float32)
        for steps in (3, 1, 0, 3):
            env.reset(seed=0)
            for _ in range(steps):
                env.step(nothing)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out-1.rrd", "out-2.rrd", "out.rrd"]


def test_a_watched_episode_is_the_same_to_the_last_bit(watcher, tmp_path):
    bare, watched = make(budget=0.05), watcher(make(budget=0.05), tmp_path / "out.rrd")
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
