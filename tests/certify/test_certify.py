"""The certificate: no way of playing changes an episode, and a break is named where it is."""

import json
import os
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.certify import ALL_EPISODES, CERTIFIED_EPISODES, design, playing, published, trail
from care_sim.certify.design import (
    AS_LISTED,
    CERTIFIED_POLICIES,
    CLOSED,
    DRIVE,
    REPLAY,
    STREET,
    drawn,
)
from care_sim.certify.playing import (
    FARTHEST,
    attempt,
    begun,
    certified_env,
    episode_batches,
    play_alone,
    playable_here,
    trails_of,
    write_drive,
)
from care_sim.certify.trail import (
    CONFIGURATION,
    DIGEST_BYTES,
    OUTCOME,
    STAGE_BYTES,
    TRAIL_STAGES,
    first_difference,
)
from care_sim.certify.verdict import verdict_of
from care_sim.commands.certify import certify
from care_sim.commands.options.results import Certify
from care_sim.core.types import ImageDetections, Tracks
from care_sim.loops.needless import NeedlessBraking
from care_sim.loops.stages.choice import Choice
from care_sim.loops.stages.driving import Driving
from care_sim.loops.stages.motion import Motion
from care_sim.loops.stages.scanning import Scanning
from care_sim.loops.stages.sight import Seeing
from care_sim.loops.stages.tracking import Tracking
from care_sim.policies import make_policy, maker
from care_sim.policies.makers import is_privileged
from care_sim.sensors.lidar import RecordedLidar
from tests.helpers.places import ROOT

LIST = [drawn(number) for number in range(CERTIFIED_EPISODES)]


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drive"))


def of(episodes, count):
    return [episode for episode in episodes if episode.keyframes <= 8][:count]


def alone(episode, source=""):
    return play_alone(episode, source)


def in_vector(make_vector, episodes, source):
    """The trails of episodes in a vector; the policies choose for the rigs of twins."""
    makers = [partial(certified_env, episode, source) for episode in episodes]
    twins = [make() for make in makers]
    policies = [begun(episode, twin) for episode, twin in zip(episodes, twins, strict=True)]
    with closing(make_vector(makers)) as vector:
        observations, _ = vector.reset()
        for _ in range(max(episode.keyframes for episode in episodes)):
            seen = [{name: rows[n] for name, rows in observations.items()} for n in range(3)]
            chosen = np.stack([policy(one) for policy, one in zip(policies, seen, strict=True)])
            observations = vector.step(chosen)[0]
        trails = [*vector.get_attr("played")]
    for twin in twins:
        twin.close()
    return trails


@pytest.mark.parametrize("environments", [{*CLOSED} - {DRIVE}, {DRIVE}, {REPLAY}])
def test_no_vector_changes_a_trail(environments, source):
    able = [e for e in LIST if e.environment in environments and e.policy not in AS_LISTED]
    some = of([e for e in able if not is_privileged(maker(e.policy))], 3)
    trails = [alone(episode, source) for episode in some]
    assert trails == [published.read()[episode.number] for episode in some]
    for make_vector in (SyncVectorEnv, partial(AsyncVectorEnv, context="fork")):
        assert in_vector(make_vector, some, source) == trails


ASKED = """
import json, sys
from care_sim.certify.design import drawn
from care_sim.certify.playing import play_alone
numbers, source = json.load(sys.stdin)
print(json.dumps([play_alone(drawn(n), source).hex() for n in numbers]))
"""


def test_no_hash_seed_changes_a_trail(source):
    """An episode of every policy; each run of the certificate has seeds of its own."""
    able = [e for e in LIST if e.environment != STREET and e.keyframes <= 6]
    numbers = [*{episode.policy: episode.number for episode in able}.values()]
    done = subprocess.run(
        [sys.executable, "-c", ASKED],
        input=json.dumps([numbers, source]),
        env=os.environ | {"PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    known = published.read()
    assert json.loads(done.stdout) == [known[number].hex() for number in numbers]


def test_batches_hold_every_episode_once_and_a_film_together():
    made = episode_batches(LIST)
    assert sorted(episode.number for batch in made for episode in batch) == list(range(len(LIST)))
    streets = [batch for batch in made if batch[0].environment == STREET]
    films = [{(e.seed, "clutter" in dict(e.arguments)) for e in batch} for batch in streets]
    assert all(len(film) == 1 for film in films)
    assert len(films) == 2 * len(design.STREETS)


def test_an_episode_that_fails_is_told_and_leaves_the_others(source):
    good, bad = of([e for e in LIST if e.environment in {*CLOSED} - {DRIVE}], 2)
    broken = replace(bad, policy="nobody")
    found = attempt([broken, good], source)
    assert found[good.number] == alone(good)
    assert "nobody" in found[bad.number]
    verdict = verdict_of(found | {0: found[bad.number]}, [found[good.number]] * 1000, {})
    assert verdict.differing[bad.number] == ("not played", None)
    assert verdict.hash is None


def test_what_needs_an_extra_that_is_missing_is_left_out_and_told(monkeypatch, capsys):
    assert playable_here(LIST) == (LIST, "")
    monkeypatch.setitem(sys.modules, "open3d", None)
    able, line = playable_here(LIST)
    missing = len(LIST) - len(able)
    assert line.startswith(f"{missing} of {CERTIFIED_EPISODES:,} not played: ")
    assert "extra 'open3d'" in line
    trails = [bytes([n % 256]) * (DIGEST_BYTES + 2) for n in range(len(LIST))]
    monkeypatch.setattr(playing, "trails_of", lambda numbers, *_: {n: trails[n] for n in numbers})
    monkeypatch.setattr(published, "read", lambda: trails)
    assert certify(Certify(workers=1)) == 0
    told = capsys.readouterr()
    assert f"care-sim: {line}" in told.err.splitlines()
    left = published.combined([trails[episode.number] for episode in able])
    assert told.out == f"{len(able):,} of {CERTIFIED_EPISODES:,} episodes: {left}, as published\n"
    lacking = next(one.number for one in LIST if one not in able)
    with pytest.raises(MissingExtra, match="extra 'open3d'"):
        certify(Certify(episode=lacking))


def test_what_is_said_to_need_no_extra_plays_without(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    closed = [episode for episode in playable_here(LIST)[0] if episode.environment in CLOSED]
    policies = {episode.policy: replace(episode, keyframes=2) for episode in closed}
    assert set(CERTIFIED_POLICIES) - set(policies) == {FARTHEST}
    for episode in policies.values():
        alone(episode)


MADE = replace(
    drawn(0),
    environment="CARE-Dense-v0",
    arguments=(("budget", 0.05),),
    policy="care",
    seed=3,
    keyframes=5,
)


def wider(looked):
    arrived, shown = looked
    arrived.rows[0, :1, ImageDetections.BOX.start + 2] += 1
    return arrived, shown


def longer(returns):
    returns.ranges[0, np.flatnonzero(np.isfinite(returns.ranges[0]))[:1]] += 0.01
    return returns


def other(fired):
    cells = fired.cells[0, : fired.counts[0]]
    free = np.setdiff1d(np.arange(16384), cells)[:1]
    cells[:] = np.sort(np.concatenate([cells[:-1], free]))
    return fired


def moved(_none, motion, _state, _accelerations):
    motion._lanes.rows[0, 0, 0] += 0.001


def drifted(_none, _tracking, state):
    state.tracks.rows[0, :1, Tracks.CENTRE.start] += 0.001


@pytest.mark.parametrize(
    ("owner", "name", "call", "change", "environment", "where"),
    [
        # A step of the world is half a keyframe; the first tracks come after a keyframe.
        (Motion, "_step", 4, moved, "CARE-Dense-v0", (TRAIL_STAGES[0], 2)),
        (Seeing, "look", 3, wider, "CARE-Dense-v0", (TRAIL_STAGES[1], 2)),
        (Tracking, "predict", 2, drifted, "CARE-Dense-v0", (TRAIL_STAGES[2], 2)),
        (Choice, "fired", 3, other, "CARE-Dense-v0", (TRAIL_STAGES[3], 2)),
        (Scanning, "scan", 3, longer, "CARE-Dense-v0", (TRAIL_STAGES[4], 2)),
        (
            RecordedLidar,
            "fire",
            3,
            lambda returned: replace(returned, points=returned.points * 1.001),
            REPLAY,
            (TRAIL_STAGES[4], 2),
        ),
        (
            Driving,
            "command",
            3,
            lambda given: (given[0], ~given[1]),
            "CARE-Dense-v0",
            (TRAIL_STAGES[5], 2),
        ),
        (NeedlessBraking, "judge", 3, lambda found: not found, DRIVE, (TRAIL_STAGES[5], 2)),
        (
            trail,
            "outcome",
            1,
            lambda judged: replace(judged, clearance_m=12.3),
            "CARE-Dense-v0",
            (OUTCOME, None),
        ),
    ],
)
def test_what_is_broken_is_named(
    owner, name, call, change, environment, where, source, monkeypatch
):
    made = replace(MADE, environment=environment)
    sound = alone(made, source)
    real, calls = getattr(owner, name), []

    def broken(*given):
        found = real(*given)
        calls.append(None)
        if len(calls) != call:
            return found
        return change(found, *given) if change in (moved, drifted) else change(found)

    monkeypatch.setattr(owner, name, broken)
    assert first_difference(sound, alone(made, source)) == where


def test_every_byte_of_a_stage_counts():
    """A configuration, two keyframes of six stages, an outcome."""
    sound = bytes(DIGEST_BYTES + 14 * STAGE_BYTES)
    for byte in range(STAGE_BYTES):
        for stage, where in (
            (0, (CONFIGURATION, None)),
            (1, (TRAIL_STAGES[0], 0)),
            (8, (TRAIL_STAGES[1], 1)),
            (13, (OUTCOME, None)),
        ):
            other = bytearray(sound)
            other[DIGEST_BYTES + stage * STAGE_BYTES + byte] = 1
            assert first_difference(sound, bytes(other)) == where


def test_another_configuration_is_named():
    assert first_difference(alone(MADE), alone(replace(MADE, seed=4))) == (CONFIGURATION, None)


def test_the_first_that_differs_is_told_with_what_it_is_made_of_and_a_command():
    trails = [bytes([n]) * (DIGEST_BYTES + 20) for n in range(6)]
    other = trails[4][:-3] + b"abc"
    verdict = verdict_of(dict(enumerate(trails)) | {4: other, 5: trails[0]}, trails, {})
    lines = [*verdict.lines()]
    assert not verdict.as_published
    assert lines[1].startswith("the first is episode 4, which differs first in")
    assert lines[2:] == [f"  {drawn(4).text}", "  care-sim certify --episode 4"]
    whole = verdict_of(dict(enumerate(trails)), trails, {})
    assert whole.as_published
    assert [*whole.lines()] == [f"6 episodes: {published.combined(trails)}, as published"]


def test_the_combined_hash_is_over_the_order_of_the_numbers():
    one, two = b"a" * 20, b"b" * 20
    assert verdict_of({1: two, 0: one}, [one, two], {}).hash == published.combined([one, two])
    assert published.combined([one, two]) != published.combined([two, one])


def test_episodes_of_a_processor_without_avx512_count_as_published(tmp_path):
    trails = [bytes([n]) * (DIGEST_BYTES + 20) for n in range(3)]
    other = b"n" * (DIGEST_BYTES + 20)
    published.write(trails, {1: other}, tmp_path / "list.parquet")
    narrow = published.read_narrow(tmp_path / "list.parquet")
    assert narrow == {1: other}
    verdict = verdict_of(dict(enumerate(trails)) | narrow, trails, narrow)
    assert verdict.as_published
    assert verdict.hash == published.combined(trails)
    assert not verdict_of({0: other}, trails, narrow).as_published


def test_a_missing_or_damaged_list_is_one_line(tmp_path):
    file = tmp_path / "list.parquet"
    with pytest.raises(InvalidInput, match="the list of certify is missing"):
        published.read(file)
    published.write([b"12345678" + b"x"], {}, file)
    assert published.read(file) == [b"12345678x"]
    file.write_bytes(b"no")
    with pytest.raises(ValueError, match="not a readable Parquet"):
        published.read(file)


@pytest.mark.smoke
def test_some_of_the_list_goes_as_published():
    """A short form of the certificate; `care-sim certify` is the whole."""
    short = [one for one in LIST if one.environment != STREET and one.keyframes <= 12]
    chosen = [one.number for one in playable_here(short)[0]][:28]
    verdict = verdict_of(trails_of(chosen, 1), published.read(), published.read_narrow())
    assert verdict.as_published, "\n".join(verdict.lines())


@pytest.mark.parametrize("name", [one for one in CLOSED if one != DRIVE])
def test_a_seed_finder_of_the_list_knows_its_episode(name):
    episode = next(e for e in LIST if (e.environment, e.policy) == (name, "seed-finder"))
    with gymnasium.make(name, budget=0.03) as env:
        policy = make_policy("seed-finder", env, **AS_LISTED["seed-finder"])
        policy(env.reset(seed=episode.seed)[0])
        assert policy.found == episode.seed


@pytest.mark.slow
def test_an_episode_of_a_street_goes_as_published():
    number = next(e.number for e in LIST if e.environment == STREET and e.keyframes <= 8)
    verdict = verdict_of(trails_of([number], 1), published.read(), published.read_narrow())
    assert verdict.as_published, "\n".join(verdict.lines())


def test_the_page_tells_the_hash_of_the_list_and_how_much_differs_without_avx512():
    page = (ROOT / "docs" / "reproducibility.md").read_text()
    told = published.combined(published.read()[:CERTIFIED_EPISODES])
    assert f"{CERTIFIED_EPISODES:,} episodes: {told}" in page
    assert f"{len(published.read_narrow())} of the {ALL_EPISODES:,} below" in page
