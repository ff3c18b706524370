"""What an episode is made of where episodes differ: environment, budget, camera faults and side.

| camera | share of episodes | drawn evenly from |
|---|---|---|
| without a fault | 40% | |
| misses | 25% | 10 to 60% of the objects, for 1 to 5 keyframes at a time |
| late | 20% | 1 to 3 keyframes |
| blind | 15% | |

False boxes are not drawn: they are those of another drive, which would have to be played first.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from care_sim.base.seeds import SPLITS, split_of

STREETS = 24
"""Of every split so many are drawn. A street takes 2.5 s to film, as long as 2,500 keyframes take
to play, and 25 MB to keep."""
_STREAM = 22
"""Apart from the streams that an environment makes of the same seed."""
_CAMERAS = ("without", "misses", "late", "blind")
_SHARES = (0.40, 0.25, 0.20, 0.15)


@dataclass(frozen=True)
class Draw:
    """An episode: the place of its environment among those there are, its budget, the faults of its
    camera as arguments, whether left and right change places, and the seeds of its world and of its
    street.
    """

    place: int
    budget: float
    faults: dict[str, Any]
    mirrored: bool
    seed: int
    street: int


def drawn(seed: int, places: int, budgets: Sequence[float], faulty: bool = True) -> Draw:
    """What the episode of a seed is made of. The same seed draws the same, and seed and street are
    of one split.

    `places` is the number of environments. Without `faulty` the camera has no fault and all else
    stays as it is. Raises InvalidInput for a seed of no split.
    """
    rng = np.random.default_rng([seed, _STREAM])
    place, number, street = (int(rng.integers(most)) for most in (places, len(budgets), STREETS))
    mirrored = bool(rng.random() < 0.5)
    # Last, so that episodes without faults are otherwise the same.
    faults = _faults(rng) if faulty else {}
    streets = SPLITS[split_of([seed])]
    return Draw(place, budgets[number], faults, mirrored, seed, streets[street])


def _faults(rng: np.random.Generator) -> dict[str, Any]:
    camera = rng.choice(_CAMERAS, p=_SHARES)
    if camera == "misses":
        return {
            "false_negative_rate": float(rng.uniform(0.1, 0.6)),
            "false_negative_burst": int(rng.integers(1, 6)),
        }
    if camera == "late":
        return {"camera_latency": int(rng.integers(1, 4))}
    return {"false_negative_rate": 1.0} if camera == "blind" else {}
