"""The worlds of the benchmark: those that everybody plays, and those that a secret salt seals.

Only worlds count in which sensing decides something (`care_sim.study.benchmark.screening`). They
were found with a car that detects nothing and with the full scan, before any policy played them.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from care_sim.base.errors import InvalidInput
from care_sim.base.files import check_file_size, parsed_json, write_text
from care_sim.base.seeds import check_secret, secret_entropy

BENCHMARK_VERSION = 1
"""Of worlds, conditions and scorer together. Whatever changes a published row makes another one."""

DRIVES, TESTS, STREETS = PARTS = ("drives", "tests", "streets")
SIZES = {DRIVES: 80, TESTS: 120, STREETS: 40}
"""Worlds of every part. By chance alone the share of 80 drives is known to 6 points (its standard
error at most), that of 120 tests to 5, and that of 40 streets, with ten sightings each, to 3 or 4:
the mean of the three parts to 3."""
FIRST_SEED = 200
"""The test seeds below it were looked at while the worlds were built (0 to 137 of the drives), and
policies were first tried on some of them (streets 0 to 19, drives 100 to 139)."""
QUICK_SHARE = 10
"""One world in so many is played by `--quick`: the first of every part."""


class _HasPart(Protocol):
    @property
    def part(self) -> str: ...


OfPart = TypeVar("OfPart", bound=_HasPart)
_PUBLISHED = Path(__file__).with_name("worlds.json")
_SEALED_FROM = 2**32
"""Sealed seeds lie above every split: no policy was trained or chosen on them."""
_SEALED_SEEDS = 2**62
_SHORTEST_SALT = 32
_LONGEST_SALT = 4096


class World(NamedTuple):
    """A world by its part and number. `reachable` is what a full scan reaches in it: one collision
    avoided, or so many first sightings.
    """

    part: str
    number: int
    seed: int
    reachable: int


@dataclass(frozen=True)
class Salt:
    """A secret text that draws the seeds of a sealed set; `digest` is what is published of it."""

    text: str
    digest: str

    @classmethod
    def read(cls, path: Path) -> "Salt":
        """That of a file; its digest is what `sha256sum` prints of the file.

        Raises InvalidInput for a file that cannot be read or holds no salt.
        """
        make = 'python -c "import secrets; print(secrets.token_hex())"'
        try:
            check_file_size(path, _LONGEST_SALT)
            content = path.read_bytes()
            text = content.decode("ascii").strip()
        except (OSError, ValueError) as error:
            raise InvalidInput(f"{path} holds no salt ({error}); {make} prints one") from error
        if len(text) < _SHORTEST_SALT:
            raise InvalidInput(
                f"the salt in {path} must have {_SHORTEST_SALT} characters or more, got "
                f"{len(text)}; {make} prints one"
            )
        check_secret(text)
        return cls(text, hashlib.sha256(content).hexdigest())

    def seed(self, part: str, number: int) -> int:
        """The seed of a candidate."""
        drawn = secret_entropy(f"benchmark {part}", (number,), self.text)
        return _SEALED_FROM + drawn % _SEALED_SEEDS


def candidates(part: str, salt: Salt | None) -> Iterator[tuple[int, int]]:
    """Numbers and seeds of the worlds of a part that are looked at in turn, without end."""
    for n in count():
        number = n if salt else FIRST_SEED + n
        yield number, salt.seed(part, n) if salt else number


@cache
def published_worlds() -> tuple[World, ...]:
    """The worlds that everybody plays, part by part."""
    listed = parsed_json(_PUBLISHED.read_text(encoding="utf-8"))
    return tuple(World(part, seed, seed, most) for part in PARTS for seed, most in listed[part])


def publish_worlds(worlds: Sequence[World]) -> None:
    """For maintainers: make these the worlds that everybody plays."""
    parts = (
        f' "{part}": {json.dumps([[w.seed, w.reachable] for w in worlds if w.part == part])}'
        for part in PARTS
    )
    write_text(_PUBLISHED, "{\n" + ",\n".join(parts) + "\n}\n")


def quick_tenth(things: Sequence[OfPart]) -> list[OfPart]:
    """The first tenth of every part, of worlds or of what has been reached in them."""
    by_part = [[thing for thing in things if thing.part == part] for part in PARTS]
    return [thing for own in by_part for thing in own[: -(-len(own) // QUICK_SHARE)]]
