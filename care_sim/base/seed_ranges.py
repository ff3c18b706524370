"""Which seeds are for what, disjoint by construction.

| seeds | for |
|---|---|
| 0 to 1,999 | the benchmark; of streets 0 to 149 for evaluation, 1,000 to 1,019 for calibration |
| 2,000 to 9,999 | validation: the learning curve, and which weights are kept |
| 10,000 and up | training |

No training episode can have a seed below 10,000, whatever `--seed` is, and nothing is chosen by a
seed below 2,000. Where episodes differ by the recording and not by the seed (`CARE-Replay-v0`),
hold out recordings.
"""

from collections.abc import Sequence

from care_sim.base.errors import InvalidInput

VALIDATION = 2_000
TRAINING = 10_000
LAST = 2**31 - 1
"""Training seeds lie below it."""


def check_benchmark_seeds(seeds: Sequence[int]) -> None:
    """Raise InvalidInput for a seed that is not the benchmark's: what is learned or chosen by it
    would be tested on it.
    """
    if seeds and max(seeds) >= VALIDATION:
        raise InvalidInput(
            f"seeds of a test must lie below {VALIDATION:,}, got {max(seeds)}: policies are chosen "
            f"and trained on those from {VALIDATION:,} on"
        )


def training_seeds(count: int) -> range:
    """The first `count` seeds of the training."""
    return range(TRAINING, TRAINING + count)
