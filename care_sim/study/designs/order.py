"""The study of the order of cells inside a set: the same tasks under every order that a set can be
listed in, in the closed and in the open loop.
"""

from collections.abc import Sequence

from care_sim.core.cell_order import AS_DEMANDED, CELL_ORDERS
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.run_config import FULL, Row

ORDERS = CELL_ORDERS[1:]
BASE_ORDER = "rows-down"
"""The order of the paper's policies here, with which the others are compared."""
MIRRORED_ORDER = "rows-up"
"""Its mirror image: as ascending as the other, where rows are numbered from the bottom."""


def order_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """The paper's closed-loop study under every order, 279 configurations a seed; `also` are
    further policies.
    """
    made = [config for order in ORDERS for config in paper_study(seeds, also, cell_order=order)]
    # The full scan feels no order and is played once.
    return list(dict.fromkeys(made))


def order_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
) -> list[PlayConfig]:
    """The first-sighting protocol under every order."""
    made = [
        config
        for order in ORDERS
        for config in play_grid(source, scenes, policies, budgets, floor_seeds, cell_order=order)
    ]
    return list(dict.fromkeys(made))


def rows_by_order(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of every order that was played, with the full scans, as if no order had been asked
    for: the rows of the paper's study once for each.
    """
    played = {row["cell_order"] for row in rows if row["policy"] != FULL}
    by_order = {
        order: [
            row | {"cell_order": AS_DEMANDED}
            for row in rows
            if row["cell_order"] == order or row["policy"] == FULL
        ]
        for order in ORDERS
        if order in played
    }
    # Rows of no order, as of the full scan alone, stand under the usual one.
    return by_order or {BASE_ORDER: [*rows]}
