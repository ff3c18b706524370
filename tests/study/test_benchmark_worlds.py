"""The worlds of the benchmark: published, sealed, and the tenth that is played for a trial."""

import hashlib
import json
from itertools import islice

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import LAST, split_of
from care_sim.study.benchmark.play import player_in, reachable
from care_sim.study.benchmark.suite import (
    BENCHMARK_BUDGET,
    BENCHMARK_VERSION,
    DRIVES,
    FIRST_SEED,
    PARTS,
    SIZES,
    STREETS,
    TESTS,
    Entry,
    Salt,
    camera_conditions,
    candidates,
    published_worlds,
    quick_tenth,
    tasks_of,
)

DIGESTS = {1: "feb863cc393f139e"}
"""What a version of the benchmark stands for. Another digest is another version."""


@pytest.fixture
def salt(tmp_path):
    path = tmp_path / "salt.txt"
    path.write_text("0123456789abcdef" * 4 + "\n")
    return Salt.read(path)


def test_a_version_stands_for_its_worlds_and_conditions():
    rows = [task.config.row() for task in tasks_of(Entry("care"), published_worlds())]
    most = [world.reachable for world in published_worlds()]
    content = json.dumps([[sorted(row.items()) for row in rows], most])
    digest = hashlib.sha256(content.encode()).hexdigest()[:16]
    assert digest == DIGESTS[BENCHMARK_VERSION]


def test_all_published_worlds_are_test_seeds_that_nobody_had_looked_at():
    for part in PARTS:
        seeds = [world.seed for world in published_worlds() if world.part == part]
        assert len(seeds) == SIZES[part]
        assert seeds == sorted(set(seeds))
        assert split_of(seeds) == "test"
        assert min(seeds) >= FIRST_SEED


def test_a_trial_plays_a_tenth_of_every_part():
    tenth = quick_tenth(published_worlds())
    assert [sum(world.part == part for world in tenth) for part in PARTS] == [8, 12, 4]
    assert {*tenth} < {*published_worlds()}


def test_every_world_is_played_under_both_cameras_at_one_per_cent():
    tasks = tasks_of(Entry("care"), quick_tenth(published_worlds()))
    assert len(tasks) == len({task.config for task in tasks}) == 2 * 24
    assert {task.config.budget for task in tasks} == {BENCHMARK_BUDGET} == {0.01}
    for part in PARTS:
        own = [task for task in tasks if task.world.part == part]
        profiles = {task.camera: task.config.camera_profile for task in own}
        assert profiles == {"measured": "yolox", "ideal": "ideal"}


def test_films_know_no_late_camera():
    assert "camera_latency_s" not in camera_conditions(STREETS, "measured")
    assert camera_conditions(DRIVES, "measured")["camera_latency_s"] == 0.12


def test_the_screening_finds_what_is_published(tmp_path):
    """The first test that counts, with all that were passed over before it, and the first street.
    A drive is screened as a test is, and takes longer.
    """
    with player_in(tmp_path, 1) as player:
        first = next(world for world in published_worlds() if world.part == TESTS)
        seeds = list(range(FIRST_SEED, first.seed + 1))
        assert reachable(TESTS, seeds, player) == [0] * (len(seeds) - 1) + [1]
        street = next(world for world in published_worlds() if world.part == STREETS)
        assert reachable(STREETS, [street.seed], player) == [street.reachable]


def test_a_salt_draws_seeds_beyond_all_splits_that_nobody_can_tell_without_it(salt, tmp_path):
    other = tmp_path / "other.txt"
    other.write_text("0123456789abcdee" * 4)
    drawn = [
        seed
        for one in (salt, Salt.read(other))
        for part in PARTS
        for _, seed in islice(candidates(part, one), 50)
    ]
    assert len({*drawn}) == len(drawn)
    assert min(drawn) > LAST
    assert max(drawn) < 2**63
    assert [seed for _, seed in islice(candidates(DRIVES, salt), 50)] == drawn[:50]


def test_the_digest_of_a_salt_is_that_of_its_file(salt, tmp_path):
    content = (tmp_path / "salt.txt").read_bytes()
    assert salt.digest == hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize("content", [None, b"", b"short", b"\xff" * 64, b"a" * 5000])
def test_what_is_no_salt_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "salt.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"salt.*token_hex"):
        Salt.read(path)
