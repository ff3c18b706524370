"""The study of the order of cells inside a set: the same tasks under every order that a set can be
listed in, in the closed and in the open loop.
"""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from care_sim.core.defaults import AS_DEMANDED, CELL_ORDERS
from care_sim.policies import is_pattern
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.rows.reading import policy_of
from care_sim.study.run_config import FULL, Row

_Config = TypeVar("_Config", EpisodeConfig, PlayConfig)

ORDERS = CELL_ORDERS[1:]
BASE_ORDER = "rows-down"
"""The order of the paper's policies here, with which the others are compared."""
MIRRORED_ORDER = "rows-up"
"""Its mirror image: as ascending as the other, where rows are numbered from the bottom."""


def order_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """The paper's closed-loop study under every order, 279 configurations a seed; `also` are
    further policies.
    """
    return _felt(
        config for order in ORDERS for config in paper_study(seeds, also, cell_order=order)
    )


def order_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
) -> list[PlayConfig]:
    """The first-sighting protocol under every order."""
    return _felt(
        config
        for order in ORDERS
        for config in play_grid(source, scenes, policies, budgets, floor_seeds, cell_order=order)
    )


def _felt(configs: Iterable[_Config]) -> list[_Config]:
    """The configurations without the order where it is not felt, each once: patterns and the full
    scan are played once for all orders.
    """
    return list(
        dict.fromkeys(
            config.changed(cell_order=AS_DEMANDED) if is_pattern(config.policy) else config
            for config in configs
        )
    )


def rows_by_order(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of every order that was played, with those that feel none, as if no order had been
    asked for: the rows of the paper's study once for each.
    """
    played = {row["cell_order"] for row in rows}
    by_order = {
        order: [
            row | {"cell_order": AS_DEMANDED}
            for row in rows
            if row["cell_order"] in (order, AS_DEMANDED)
        ]
        for order in ORDERS
        if order in played
    }
    # Rows of no order, as of the full scan alone, stand under the usual one.
    return by_order or {BASE_ORDER: [*rows]}


def without_order(rows: Iterable[Row]) -> list[str]:
    """The policies that feel no order and were played once for all, the full scan first."""
    found = dict.fromkeys(policy_of(row) for row in rows if row["cell_order"] == AS_DEMANDED)
    return sorted(found, key=lambda policy: policy != FULL)
