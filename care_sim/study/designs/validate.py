"""The validation of a world: everything that shows whether it discriminates between policies, for
the world as it is and with one factor changed at a time.

Choices are made on training seeds, and results are of test seeds.
"""

from collections.abc import Sequence
from typing import Any

from care_sim.base.seeds import (
    TRAINING,
    VALIDATION,
    check_benchmark_seeds,
    training_seeds,
)
from care_sim.policies import controls
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import FULL, Row

CAMERA_POLICIES = ("all-camera", "care", "care-sightlines", "care-sector")
"""The causal policies with a camera; the best of them has to beat the best control."""
MEMORISER = "seed-finder"
"""It looks the test seed up, and so shows what memory of hidden actors can reach. Its figure is
published, but it is no reference to beat.
"""
_BLIND = ("history", "random")


def validation_study(
    scenario: str,
    levels: Sequence[Parameters],
    budgets: Sequence[float],
    test: Sequence[int],
    trained: int,
    **common: Any,
) -> list[EpisodeConfig]:
    """Return every level of a world: camera policies and controls on the first `trained` training
    seeds, and all policies on the `test` seeds. The learned maps come from the same training seeds,
    without the conditions. `common` are further fields of `EpisodeConfig`.

    Raises InvalidInput for a test seed outside the benchmark.
    """
    check_benchmark_seeds(test)
    # The memoriser may look up every seed below the validation's, and demands known actors first.
    known = (
        ("learned-place.seeds", trained),
        ("history-learned-place.seeds", trained),
        (f"{MEMORISER}.seeds", VALIDATION),
        (f"{MEMORISER}.hidden_first", True),
    )
    chosen = (*CAMERA_POLICIES, *controls())
    return [
        config
        for level in levels
        for policies, seeds in (
            (chosen, training_seeds(trained)),
            ((FULL, MEMORISER, *_BLIND, *chosen), test),
        )
        for config in grid(
            [scenario],
            policies,
            budgets,
            seeds,
            scenario_parameters=level,
            policy_parameters=known,
            **common,
        )
    ]


def levels_of(base: Parameters, factors: Sequence[Parameters]) -> list[Parameters]:
    """The parameters of every world: the base, then the base with each of `factors` changed."""
    changed = (tuple((dict(base) | dict(factor)).items()) for factor in factors)
    return list(dict.fromkeys([base, *changed]))


def is_training(row: Row) -> bool:
    """Return True if an episode has a training seed."""
    return int(row["seed"]) >= TRAINING
