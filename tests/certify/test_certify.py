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
from gymnasium.vector import AsyncVectorEnv

from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.certify import ALL_EPISODES, CERTIFIED_EPISODES, design, playing, published
from care_sim.certify.design import (
    ALONE,
    AS_LISTED,
    CERTIFIED_POLICIES,
    CLOSED,
    DRIVE,
    REPLAY,
    STREET,
    VECTOR,
    drawn,
)
from care_sim.certify.drive import write_drive
from care_sim.certify.playing import (
    FARTHEST,
    attempt,
    begun,
    certified_env,
    episode_batches,
    play_alone,
    play_in_vector,
    playable_here,
    trails_of,
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
from care_sim.commands.certify import Certify
from care_sim.core.firing import free_cells
from care_sim.core.types import Scan, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.loops.needless import NeedlessBraking
from care_sim.perception.tracker import TrackMemory
from care_sim.policies import make_policy, maker
from care_sim.policies.makers import is_privileged
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.recorded_lidar import RecordedLidar
from care_sim.world.world import World
from tests.helpers.places import ROOT

LIST = [drawn(number) for number in range(CERTIFIED_EPISODES)]


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drive"))


def of(episodes, count):
    return [episode for episode in episodes if episode.keyframes <= 8][:count]


def alone(episode, source=""):
    (trail,) = play_alone([episode], source)
    return trail


def in_processes(make_vector, episodes, source):
    """The trails of episodes in a vector whose environments are in processes of their own; the
    policies choose in this one, for the rigs of twins.
    """
    makers = [partial(certified_env, episode, source) for episode in episodes]
    twins = [make() for make in makers]
    policies = [begun(episode, twin) for episode, twin in zip(episodes, twins, strict=True)]
    with closing(make_vector(makers)) as vector:
        # One of Stable-Baselines3 gives no infos.
        begin = vector.reset()
        observations = begin[0] if isinstance(begin, tuple) else begin
        for _ in range(max(episode.keyframes for episode in episodes)):
            seen = [
                {name: rows[n] for name, rows in observations.items()} for n in range(len(twins))
            ]
            chosen = np.stack([policy(one) for policy, one in zip(policies, seen, strict=True)])
            observations = vector.step(chosen)[0]
        trails = list(vector.get_attr("played"))
    for twin in twins:
        twin.close()
    return trails


def of_gymnasium(makers):
    return AsyncVectorEnv(makers, context="fork")


def of_stable_baselines3(makers):
    vectors = pytest.importorskip("stable_baselines3.common.vec_env")
    return vectors.SubprocVecEnv(makers, start_method="fork")


def test_no_mode_changes_a_trail(source):
    together = [e for e in LIST if e.environment in {*CLOSED} - {DRIVE}]
    closed = of([e for e in together if not is_privileged(maker(e.policy))], 4)
    trails = [alone(episode) for episode in closed]
    assert trails == [published.read()[episode.number] for episode in closed]
    assert play_in_vector(closed, source) == trails
    assert in_processes(of_gymnasium, closed, source) == trails
    assert in_processes(of_stable_baselines3, closed, source) == trails


ASKED = """
import json, sys
from care_sim.certify.design import drawn
from care_sim.certify.playing import play_alone
numbers, source = json.load(sys.stdin)
print(json.dumps([trail.hex() for trail in play_alone([drawn(n) for n in numbers], source)]))
"""


@pytest.mark.parametrize("seed", ["1", "2"])
def test_no_hash_seed_changes_a_trail(seed, source):
    """An episode of every policy; each run of the certificate has seeds of its own."""
    able = [e for e in LIST if e.environment != STREET and e.keyframes <= 6]
    numbers = [*{episode.policy: episode.number for episode in able}.values()]
    done = subprocess.run(
        [sys.executable, "-c", ASKED],
        input=json.dumps([numbers, source]),
        env=os.environ | {"PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )
    known = published.read()
    assert json.loads(done.stdout) == [known[number].hex() for number in numbers]


def test_drives_play_in_vectors_of_their_own():
    drives = of([e for e in LIST if e.environment == DRIVE and e.policy not in AS_LISTED], 2)
    assert play_in_vector(drives, "") == [alone(episode) for episode in drives]
    batches = [{e.environment for e in batch} for batch in episode_batches(LIST)]
    assert {DRIVE} in batches
    assert not any(DRIVE in batch and len(batch) > 1 for batch in batches)


def test_recordings_and_privileged_policies_play_in_vectors_too(source):
    recorded = of([e for e in LIST if e.environment == REPLAY], 2)
    assert play_in_vector(recorded, source) == [alone(episode, source) for episode in recorded]
    beyond = replace(recorded[0], policy="history-oracle", keyframes=40)
    assert play_in_vector([beyond], source) == [alone(beyond, source)]
    privileged = of(
        # A drive has six cameras, and no vector holds it beside another world.
        [e for e in LIST if e.policy == "history-oracle" and e.environment in {*CLOSED} - {DRIVE}],
        3,
    )
    assert play_in_vector(privileged, source) == [alone(episode) for episode in privileged]


def test_batches_hold_every_episode_once_and_a_street_together():
    made = episode_batches(LIST)
    assert sorted(episode.number for batch in made for episode in batch) == list(range(len(LIST)))
    streets = [{e.seed for e in batch} for batch in made if batch[0].environment == STREET]
    assert all(len(seeds) == 1 for seeds in streets)
    assert len(streets) == len(design.STREETS)


@pytest.mark.parametrize("mode", [ALONE, VECTOR])
def test_an_episode_that_fails_is_told_and_leaves_the_others(mode, source):
    good, bad = of([e for e in LIST if e.environment in {*CLOSED} - {DRIVE}], 2)
    broken = replace(bad, policy="nobody")
    found = attempt([replace(good, mode=mode), replace(broken, mode=mode)], source)
    assert found[good.number] == alone(good)
    assert "nobody" in found[bad.number]
    verdict = verdict_of(found | {0: found[bad.number]}, [found[good.number]] * 1000)
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
    assert Certify(workers=1)() == 0
    told = capsys.readouterr()
    assert f"care-sim: {line}" in told.err.splitlines()
    left = published.combined([trails[episode.number] for episode in able])
    assert told.out == f"{len(able):,} of {CERTIFIED_EPISODES:,} episodes: {left}, as published\n"
    lacking = next(one.number for one in LIST if one not in able)
    for command in (Certify(episode=lacking), Certify(every=True, write=True)):
        with pytest.raises(MissingExtra, match="extra 'open3d'"):
            command()


def test_what_is_said_to_need_no_extra_plays_without(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    closed = [episode for episode in playable_here(LIST)[0] if episode.environment in CLOSED]
    policies = {episode.policy: replace(episode, keyframes=2) for episode in closed}
    assert set(CERTIFIED_POLICIES) - set(policies) == {FARTHEST}
    for episode in policies.values():
        alone(episode)


def test_a_list_is_published_whole_or_not_at_all(monkeypatch, capsys):
    written = []
    monkeypatch.setattr(published, "write", written.append)
    trails = {n: bytes([n % 256]) * (DIGEST_BYTES + 2) for n in range(ALL_EPISODES)}
    monkeypatch.setattr(playing, "trails_of", lambda *_: trails | {7: "it broke"})
    assert Certify(every=True, write=True)() == 1
    assert capsys.readouterr().out == "nothing is written: episode 7 was not played: it broke\n"
    assert written == []
    monkeypatch.setattr(playing, "trails_of", lambda *_: trails)
    assert Certify(every=True, write=True)() == 0
    assert written == [[*trails.values()]]
    for wrong in ({"write": True}, {"episode": 3, "every": True}, {"episode": ALL_EPISODES}):
        with pytest.raises(InvalidInput):
            Certify(**wrong)


MADE = replace(
    drawn(0),
    environment="CARE-Dense-v0",
    arguments=(("budget", 0.05),),
    policy="care",
    seed=3,
    keyframes=5,
    mode=ALONE,
)


def moved_by_a_millimetre(monkeypatch):
    step = World.step

    def moved(self, acceleration):
        passage = step(self, acceleration)
        if self._steps == 4:
            self.ego._vehicle.position[0] += 0.001
        return passage

    monkeypatch.setattr(World, "step", moved)


def one_box_a_pixel_wider(monkeypatch):
    newest, calls = CameraDetector.newest, []

    def widened(self, heading):
        calls.append(heading)
        arrived = newest(self, heading)
        boxes = arrived.detections.boxes.copy()
        boxes[:1, 2] += len(calls) > 2
        return replace(arrived, detections=replace(arrived.detections, boxes=boxes))

    monkeypatch.setattr(CameraDetector, "newest", widened)


def a_track_that_has_moved(monkeypatch):
    predict, calls = TrackMemory.predict, []

    def moved(self):
        predict(self)
        calls.append(0)
        self._table[:1, Tracks.CENTRE.start] += 0.001 * (len(calls) == 2)

    monkeypatch.setattr(TrackMemory, "predict", moved)


def another_cell(monkeypatch):
    choose, calls = free_cells.fired_cells, []

    def other(scores, budget, floor):
        cells = choose(scores, budget, floor)
        calls.append(0)
        free = np.setdiff1d(np.arange(scores.size), cells)[:1]
        return np.sort(np.concatenate([cells[:-1], free])) if len(calls) == 3 else cells

    monkeypatch.setattr(free_cells, "fired_cells", other)


def one_range_a_centimetre_longer(monkeypatch):
    fire, calls = Lidar.fire, []

    def longer(self, cells, sensor):
        scan, bodies = fire(self, cells, sensor)
        calls.append(0)
        ranges = scan.ranges.copy()
        ranges[np.flatnonzero(np.isfinite(ranges))[:1]] += 0.01 * (len(calls) == 3)
        return Scan(scan.cells, ranges), bodies

    monkeypatch.setattr(Lidar, "fire", longer)


def a_brake_that_is_said_to_be_on(monkeypatch):
    command, calls = BrakingController.command, []

    def braking(self, tracks, ego):
        calls.append(0)
        given = command(self, tracks, ego)
        return replace(given, braking=not given.braking) if len(calls) == 3 else given

    monkeypatch.setattr(BrakingController, "command", braking)


def another_outcome(monkeypatch):
    from care_sim.certify import trail

    judge = trail.outcome
    monkeypatch.setattr(
        trail, "outcome", lambda keyframes: replace(judge(keyframes), clearance_m=12.3)
    )


@pytest.mark.parametrize(
    ("broken", "where"),
    [
        (moved_by_a_millimetre, (TRAIL_STAGES[0], 2)),
        (one_box_a_pixel_wider, (TRAIL_STAGES[1], 2)),
        (a_track_that_has_moved, (TRAIL_STAGES[2], 2)),
        (another_cell, (TRAIL_STAGES[3], 2)),
        (one_range_a_centimetre_longer, (TRAIL_STAGES[4], 2)),
        (a_brake_that_is_said_to_be_on, (TRAIL_STAGES[5], 2)),
        (another_outcome, (OUTCOME, None)),
    ],
)
def test_what_is_broken_is_named(broken, where, monkeypatch):
    sound = alone(MADE)
    broken(monkeypatch)
    assert first_difference(sound, alone(MADE)) == where


def test_what_is_broken_in_a_recording_is_named(source, monkeypatch):
    recorded = replace(MADE, environment=REPLAY)
    sound = alone(recorded, source)
    fire, calls = RecordedLidar.fire, []

    def longer(self, cells, cloud):
        returned = fire(self, cells, cloud)
        calls.append(0)
        return replace(returned, points=returned.points * (1 + 0.001 * (len(calls) == 3)))

    monkeypatch.setattr(RecordedLidar, "fire", longer)
    assert first_difference(sound, alone(recorded, source)) == (TRAIL_STAGES[4], 2)


def test_a_needless_brake_of_a_drive_is_named(monkeypatch):
    drive = replace(MADE, environment=DRIVE)
    sound = alone(drive)
    calls = []
    monkeypatch.setattr(
        NeedlessBraking, "judge", lambda *given: calls.append(given) or len(calls) == 3
    )
    assert first_difference(sound, alone(drive)) == (TRAIL_STAGES[5], 2)


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


def test_the_first_that_differs_is_told_with_a_command(capsys):
    trails = [bytes([n]) * (DIGEST_BYTES + 20) for n in range(6)]
    other = trails[4][:-3] + b"abc"
    verdict = verdict_of(dict(enumerate(trails)) | {4: other, 5: trails[0]}, trails)
    text = "\n".join(verdict.lines())
    assert not verdict.as_published
    assert "episode 4" in text
    assert "care-sim certify --episode 4" in text
    assert drawn(4).environment in text
    assert verdict_of(dict(enumerate(trails)), trails).as_published


def test_one_alone_is_told_with_what_it_is_made_of_and_without_its_own_command():
    trails = [bytes([n]) * (DIGEST_BYTES + 20) for n in range(6)]
    made = f"  {drawn(4).text}, played in mode {drawn(4).mode}"
    same = [*verdict_of({4: trails[4]}, trails, 1).lines()]
    assert same == [f"1 episode: {published.combined(trails[4:5])}, as published", made]
    other = [*verdict_of({4: trails[4][:-3] + b"abc"}, trails, 1).lines()]
    assert other[1].startswith("the first is episode 4, which differs first in")
    assert other[2:] == [made]
    assert len([*verdict_of(dict(enumerate(trails)), trails).lines()]) == 1


def test_the_combined_hash_is_over_the_order_of_the_numbers():
    one, two = b"a" * 20, b"b" * 20
    assert verdict_of({1: two, 0: one}, [one, two]).hash == published.combined([one, two])
    assert published.combined([one, two]) != published.combined([two, one])


def test_a_missing_or_damaged_list_is_one_line(tmp_path):
    file = tmp_path / "list.parquet"
    with pytest.raises(
        InvalidInput, match=r"^the list of certify is missing: install the package again$"
    ):
        published.read(file)
    published.write([b"12345678" + b"x"], file)
    assert published.read(file) == [b"12345678x"]
    file.write_bytes(b"no")
    with pytest.raises(ValueError, match="not a readable Parquet"):
        published.read(file)


@pytest.mark.smoke
def test_some_of_the_list_goes_as_published():
    """A short form of the certificate; `care-sim certify` is the whole."""
    short = [one for one in LIST if one.environment != STREET and one.keyframes <= 12]
    here, _ = playable_here(short)
    chosen = [
        one.number for mode in (ALONE, VECTOR) for one in [e for e in here if e.mode == mode][:14]
    ]
    verdict = verdict_of(trails_of(chosen, 1), published.read())
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
    verdict = verdict_of(trails_of([number], 1), published.read())
    assert verdict.as_published, "\n".join(verdict.lines())


def test_the_concepts_tell_the_hash_of_the_list():
    concepts = (ROOT / "docs" / "concepts.md").read_text()
    told = published.combined(published.read()[:CERTIFIED_EPISODES])
    assert f"{CERTIFIED_EPISODES:,} episodes: {told}" in concepts
