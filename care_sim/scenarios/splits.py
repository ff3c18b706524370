"""Which seeds of `CARE-Drive-v0` are for training, for choosing, and for the published figures."""

from collections.abc import Iterable

from care_sim.base.checks import check_seed
from care_sim.base.errors import InvalidInput

SPLITS = {
    "train": range(10_000),
    "validation": range(10_000, 11_000),
    "test": range(20_000, 21_000),
}
"""Declared before any policy ran. Seeds that people take first are for training: what they tune by
is no figure.
"""


def split_of(seeds: Iterable[int]) -> str:
    """The one split that all `seeds` are of.

    Raises InvalidInput for seeds of several splits, for a seed of none, and for none at all.
    """
    found = dict.fromkeys(_split_of_one(seed) for seed in seeds)
    if len(found) != 1:
        mixed = f"seeds of {' and '.join(found)}" if found else "no seed"
        raise InvalidInput(f"seeds must be of one split ({_ranges()}), got {mixed}")
    return next(iter(found))


def _split_of_one(seed: int) -> str:
    check_seed(seed)
    for name, seeds in SPLITS.items():
        if seed in seeds:
            return name
    raise InvalidInput(f"seed {seed} is of no split; there are {_ranges()}")


def _ranges() -> str:
    return ", ".join(f"{name} {seeds[0]} to {seeds[-1]}" for name, seeds in SPLITS.items())
