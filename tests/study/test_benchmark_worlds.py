"""The worlds of the benchmark: published, fresh and sealed; and the names of entries."""

import hashlib
import hmac
from dataclasses import replace

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import FRESH, LAST, SEALED_FROM, split_of
from care_sim.study.benchmark.suite import (
    DRIVES,
    FIRST_SEED,
    STREETS,
    TESTS,
    TIGHT_TESTS,
    Entry,
    Salt,
    episode_seeds,
    fresh_seeds,
)


@pytest.fixture
def salt(tmp_path):
    path = tmp_path / "salt.txt"
    path.write_text("0123456789abcdef" * 4 + "\n")
    return Salt.read(path)


@pytest.mark.parametrize("part", [DRIVES, TESTS, TIGHT_TESTS])
def test_published_drives_and_tests_are_test_seeds_that_nobody_had_looked_at(part):
    seeds = episode_seeds(part)
    assert list(seeds) == sorted(set(seeds))
    assert split_of(seeds) == "test"
    assert min(seeds) >= FIRST_SEED


def test_fresh_seeds_are_of_no_split_and_the_folder_keeps_them(tmp_path):
    assert FRESH[0] > LAST
    assert FRESH[-1] < SEALED_FROM
    three = fresh_seeds(tmp_path / "a", 3)
    assert len({*three}) == 3
    assert all(seed in FRESH for seed in three)
    assert fresh_seeds(tmp_path / "a", 5)[:3] == three
    assert fresh_seeds(tmp_path / "a", 2) == three[:2]
    # Another folder has another draw.
    assert not {*fresh_seeds(tmp_path / "b", 3)} & {*three}


@pytest.mark.parametrize("text", ["{", "{}", "[1]", '["a"]', f"[{2**32}]"])
def test_a_damaged_draw_is_refused_in_one_line(tmp_path, text):
    (tmp_path / "fresh.json").write_text(text)
    with pytest.raises(InvalidInput, match=r"fresh.json (is damaged|cannot be read)") as refused:
        fresh_seeds(tmp_path, 1)
    assert "\n" not in str(refused.value)


def test_a_salt_draws_seeds_beyond_all_others_that_nobody_can_tell_without_it(salt, tmp_path):
    other = tmp_path / "other.txt"
    other.write_text("0123456789abcdee" * 4)
    salts = salt, Salt.read(other)
    drawn = [
        one.seed(part, n) for one in salts for part in (DRIVES, TESTS, STREETS) for n in range(50)
    ]
    assert len({*drawn}) == len(drawn)
    assert min(drawn) >= SEALED_FROM
    assert max(drawn) < 2**63
    # The rule is published: HMAC-SHA-256 of part and number.
    digest = hmac.digest(salt.text.encode(), b"benchmark streets 7", "sha256")
    assert salt.seed(STREETS, 7) == 2**32 + int.from_bytes(digest) % 2**62


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


def test_an_entry_shows_the_name_of_a_file_and_not_where_it_lies():
    entry = Entry("mine:Mine", (("weights", "/home/me/w.npz"), ("maps", ("a/b.npz", "c"))))
    assert entry.name == "mine:Mine weights=w.npz maps=('b.npz', 'c')"
    assert "/home/me/w.npz" in entry.full_name
    assert replace(entry, parameters=(), label="Ours").name == "Ours (mine:Mine)"
