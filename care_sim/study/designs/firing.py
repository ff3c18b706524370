"""The study of what the hardware can fire: the same tasks under every hardware, in either loop."""

from collections.abc import Sequence

from care_sim.core.firing.listing import CELLS, HARDWARE, settled
from care_sim.sources.scenes import Scene, Source
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.run_config import FULL, Row

FIRINGS = tuple(map(settled, HARDWARE))
"""Every kind of hardware with its usual numbers."""
AWARE = "care-units"
"""The policy that knows its hardware, with which the others are compared."""
FIRING_POLICIES = ("care", "care-sightlines", AWARE, "rows", "place", FULL)
FIRING_BUDGETS = (0.03, 0.05, 0.1)
"""A row of 32 is 3.1% of the cells: less than half of that buys none."""


def firing_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """The dense street under every hardware; `also` are further policies."""
    policies = list(dict.fromkeys([*FIRING_POLICIES, *also]))
    # The full scan feels no hardware, and is played once for all.
    configs = [
        config
        for firing in FIRINGS
        for config in grid(["dense"], policies, FIRING_BUDGETS, seeds, firing=firing)
    ]
    return [*dict.fromkeys(configs)]


def firing_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
) -> list[PlayConfig]:
    """The first-sighting protocol under every hardware."""
    configs = [
        config
        for firing in FIRINGS
        for config in play_grid(source, scenes, policies, budgets, floor_seeds, firing=firing)
    ]
    return [*dict.fromkeys(configs)]


def rows_by_firing(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of every hardware that was played, as if none had been asked for, with the full scan
    among each.
    """
    full = [row for row in rows if row["policy"] == FULL]
    by_firing: dict[str, list[Row]] = {}
    for row in rows:
        if row["policy"] != FULL:
            own = by_firing.setdefault(row.get("firing") or CELLS, [*full])
            own.append(row | {"firing": None})
    # The full scan alone stands under free cells.
    return by_firing or {CELLS: full}
