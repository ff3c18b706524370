"""What a caller of `reset` asks of a vector environment: which worlds begin, with which seeds."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from care_sim.base.checks import as_array, check_seed
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Mask


def seeds_of(seed: int | Sequence[int | None] | None, worlds: int) -> list[int | None]:
    """The seeds of so many worlds, of which the i-th is `seed + i` for a whole number. Raises
    InvalidInput for a list of another length, and for what is no seed.
    """
    if seed is None:
        return [None] * worlds
    if isinstance(seed, Iterable):
        # An array without an axis calls itself Iterable, too.
        if not getattr(seed, "ndim", 1):
            check_seed(seed)
        seeds = [*seed]
    else:
        check_seed(seed)
        seeds = [int(seed) + world for world in range(worlds)]
    if len(seeds) != worlds:
        raise InvalidInput(f"seed must be one for each of {worlds}, got {len(seeds)}")
    for one in seeds:
        if one is not None:
            check_seed(one)
    return seeds


def worlds_to_reset(options: dict[str, Any] | None, worlds: int) -> Mask:
    """(worlds,) those of the `reset_mask`, all without one. Raises InvalidInput for other options,
    and for a mask that is none or empty.
    """
    everybody = np.ones(worlds, np.bool_)
    if not options:
        return everybody
    if [*options] != ["reset_mask"]:
        raise InvalidInput(f"reset takes no options but reset_mask, got {shown(options)}")
    mask = as_array("reset_mask", options["reset_mask"])
    if mask.dtype != np.bool_ or mask.shape != everybody.shape or not mask.any():
        raise InvalidInput(f"reset_mask must be {worlds} flags, at least one of them True")
    return mask
