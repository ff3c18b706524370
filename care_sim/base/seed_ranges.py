"""Which seeds are for what, disjoint by construction: the table is in docs/environments/index.md.

No training episode can have a seed below 10,000, whatever `--seed` is, and nothing is chosen by a
seed below 1,000 but `care-sector` and `place-hulls`, which were first tried on the streets 0 to 19.
A study of several seeds takes them of one split; one episode, of a command or of an environment
that is reset by hand, takes any. Where episodes differ by the recording and not by the seed
(`CARE-Replay-v0`), hold out recordings.
"""

from collections.abc import Iterable, Sequence

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


def split_of(seeds: Iterable[int]) -> str:
    """The one split that all `seeds` are of.

    Raises InvalidInput for seeds of several splits, for a seed of none, and for none at all.
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
