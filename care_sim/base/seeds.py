"""Seeds: the split that each belongs to, and its independent streams of random numbers.

The splits are disjoint by construction; the table is in docs/seeds.md. No training episode has a
seed below 10,000, whatever `--seed` is. Nothing is chosen by a seed below 1,000, except
`care-sector` and `place-hulls`, which were first tried on the streets 0 to 19. A study of several
seeds takes them from one split. A single episode takes any seed. Where episodes differ by the
recording and not by the seed (`CARE-Replay-v0`), hold out recordings.

Anybody with this package can draw the episodes of a public seed, and find the seed from an
episode's beginning. A secret enters all draws. An observation then reveals no more about the seed
than a guess within the scenario's ranges. NumPy's generators are not cryptographic. Predicting a
stream from its first numbers takes years of computing (Bouillaguet, Martinez and Sauvage, ToSC
2020, on PCG64), which is not a proof. The random floor has a key of 64 bits
(`care_sim.core.firing.floor`); trying all keys also takes years.
"""

import hmac
from collections.abc import Iterable, Sequence

import numpy as np

from care_sim.base.checks import check_seed
from care_sim.base.errors import InvalidInput

CALIBRATION = 1_000
VALIDATION = 2_000
TRAINING = 10_000
LAST = 2**31 - 1
"""Training seeds lie below it."""
SPLITS = {
    "test": range(CALIBRATION),
    "calibration": range(CALIBRATION, VALIDATION),
    "validation": range(VALIDATION, TRAINING),
    "train": range(TRAINING, LAST),
}
FRESH = range(2**31, 2**32)
"""`care-sim benchmark --fresh N` draws from it. Nothing is learned, chosen or published with it."""
SEALED_FROM = 2**32
"""Seeds that a secret salt draws lie from here on."""


def split_of(seeds: Iterable[int]) -> str:
    """Return the split of all `seeds`. Raises InvalidInput for seeds of several splits or of none,
    and without seeds.
    """
    found: dict[str, int] = {}
    for seed in seeds:
        found.setdefault(_split_of_one(seed), seed)
    if len(found) != 1:
        mixed = " and ".join(f"{seed} of {name}" for name, seed in found.items()) or "no seed"
        raise InvalidInput(f"seeds must be of one split ({_ranges()}), got {mixed}")
    return next(iter(found))


def _split_of_one(seed: int) -> str:
    check_seed(seed)
    for name, seeds in SPLITS.items():
        if int(seed) in seeds:
            return name
    raise InvalidInput(f"seed {seed} is of no split; there are {_ranges()}")


def _ranges() -> str:
    return ", ".join(f"{name} {seeds[0]} to {seeds[-1]}" for name, seeds in SPLITS.items())


def check_benchmark_seeds(seeds: Sequence[int]) -> None:
    """Raise InvalidInput unless all are the benchmark's: what is learned or chosen by another would
    be tested on it.
    """
    if split_of(seeds) != "test":
        raise InvalidInput(
            f"seeds of a test must lie below {CALIBRATION:,}, got {max(seeds)}: policies are "
            f"chosen and trained on those from {CALIBRATION:,} on"
        )


def training_seeds(count: int) -> range:
    """The first `count` seeds of the training."""
    return range(TRAINING, TRAINING + count)


def streams(entropy: tuple[int, ...], count: int, secret: str = "") -> list[np.random.SeedSequence]:
    """`count` streams of an episode; `entropy` is its seed, and in the open loop a number of its
    scene's.
    """
    return np.random.SeedSequence(
        secret_entropy("episode", entropy, secret) if secret else entropy
    ).spawn(count)


def secret_entropy(what: str, entropy: tuple[int, ...], secret: str) -> int:
    """Return 256 bits of a name, a seed and a secret (HMAC-SHA-256), which reveal neither. An
    episode and a street of one seed have nothing in common.
    """
    # As plain decimal numbers, so that an integer of NumPy gives what one of Python does.
    message = " ".join([what, *(str(int(number)) for number in entropy)])
    return int.from_bytes(hmac.digest(secret.encode(), message.encode(), "sha256"))


def check_secret(secret: object) -> None:
    """Raise InvalidInput unless it is False, for none, or a text that can be encoded. An empty text
    and None are what an environment variable gives that is not set; they would leave everything
    open.
    """
    if secret is False:
        return
    if not isinstance(secret, str):
        raise InvalidInput(f"secret must be a text, got one of type {type(secret).__name__}")
    if not secret:
        raise InvalidInput(
            "secret must not be empty: leave it out, or give False, where there is none"
        )
    if not secret.isascii():
        raise InvalidInput("secret must be of ASCII characters alone")
