"""Studies of firing: under every hardware, and in every order of the cells inside a set."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

from care_sim.core.defaults import AS_DEMANDED, CELL_ORDERS, CELLS
from care_sim.core.firing.listing import HARDWARE, settled
from care_sim.core.sensor_setup import SensorSetup
from care_sim.policies import is_pattern
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sources.scenes import Scene, Source
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.paper import paper_study
from care_sim.study.designs.variants import keep_playable
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.rows.reading import policy_of
from care_sim.study.run_config import FULL, Row

FIRINGS = tuple(map(settled, HARDWARE))
"""Every kind of hardware with its default numbers."""
AWARE = "care-units"
"""The policy that knows its hardware, with which the others are compared."""
FIRING_BUDGETS = (0.03, 0.05, 0.1)
"""A row of 32 is 3.1% of the cells: less than half of that buys none."""


class Fitting(NamedTuple):
    """The hardware and the policies of the study that fit a sensor set-up, and a line for each
    other one.
    """

    firings: list[str]
    policies: list[str]
    left_out: list[str]


def fitting(sensor: str | SensorSetup, policies: Sequence[str] = FIRING_POLICIES) -> Fitting:
    """Return the part of the study that fits a set-up. Units must divide its grid and fit the
    smallest budget; `policies` must have no weights of another grid.
    """

    def tasks(policy: str, budget: float, firing: str = CELLS) -> list[EpisodeConfig]:
        return grid(["dense"], [policy], [budget], [0], firing=firing, sensor=sensor)

    where = f"with {sensor_setup(sensor).name}"
    least, *_, most = FIRING_BUDGETS
    firings = keep_playable(FIRINGS, lambda firing: tasks("random", least, firing), where)
    played = keep_playable(policies, lambda policy: tasks(policy, most), where)
    return Fitting(firings.sound, played.sound, [*firings.left_out, *played.left_out])


def firing_study(
    seeds: Sequence[int],
    also: Sequence[str] = (),
    sensors: Sequence[str | SensorSetup] = (DEFAULT_SETUP,),
) -> list[EpisodeConfig]:
    """Return the dense street with every set-up under every hardware that fits it; `also` are
    further policies.
    """
    configs = []
    for sensor in sensors:
        fits = fitting(sensor)
        policies = [*dict.fromkeys([*fits.policies, *also])]
        for firing in fits.firings:
            configs += grid(
                ["dense"], policies, FIRING_BUDGETS, seeds, firing=firing, sensor=sensor
            )
    # The full scan does not depend on hardware, and is played once for all.
    return [*dict.fromkeys(configs)]


def firing_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
) -> list[PlayConfig]:
    """The first-sighting protocol under every hardware that fits the set-up of the source."""
    configs = [
        config
        for firing in fitting(source.sensor).firings
        for config in play_grid(source, scenes, policies, budgets, floor_seeds, firing=firing)
    ]
    return [*dict.fromkeys(configs)]


def rows_by_firing(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of every played hardware, without its condition, each with the full scan."""
    full = [row for row in rows if row["policy"] == FULL]
    by_firing: dict[str, list[Row]] = {}
    for row in rows:
        if row["policy"] != FULL:
            own = by_firing.setdefault(row.get("firing") or CELLS, [*full])
            own.append(row | {"firing": None})
    # The full scan alone stands under free cells.
    return by_firing or {CELLS: full}


_Config = TypeVar("_Config", EpisodeConfig, PlayConfig)

ORDERS = CELL_ORDERS[1:]
BASE_ORDER = "rows-down"
"""The order of the paper's policies here, with which the others are compared."""
MIRRORED_ORDER = "rows-up"
"""The mirrored order: ascending if rows are numbered from the bottom."""


def order_study(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Return the paper's closed-loop study under every order, 279 configurations per seed; `also`
    are further policies.
    """
    return _drop_unused_orders(
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
    return _drop_unused_orders(
        config
        for order in ORDERS
        for config in play_grid(source, scenes, policies, budgets, floor_seeds, cell_order=order)
    )


def _drop_unused_orders(configs: Iterable[_Config]) -> list[_Config]:
    """Return the configurations, each once, without the order for policies that do not depend on
    it: patterns and the full scan are played once for all orders.
    """
    return list(
        dict.fromkeys(
            config.changed(cell_order=AS_DEMANDED) if is_pattern(config.policy) else config
            for config in configs
        )
    )


def rows_by_order(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of every played order, without its condition: the rows of the paper's study
    per order. Policies that do not depend on the order are in each.
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
    """Return the policies that do not depend on the order and were played once for all, the full
    scan first.
    """
    found = dict.fromkeys(policy_of(row) for row in rows if row["cell_order"] == AS_DEMANDED)
    return sorted(found, key=lambda policy: policy != FULL)
