"""What the hardware does to the first-sighting protocol."""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.firing_tables import tables_by_firing
from care_sim.reports.formatting import interval
from care_sim.reports.order_tables import Shown
from care_sim.reports.protocol.cells import PlayCells
from care_sim.reports.protocol.formatting import written
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import Key, key_of, policy_of, tags_of_row
from care_sim.study.run_config import Row


def firing_tables(rows: Sequence[Row]) -> list[Table]:
    """Recalls by hardware in every setting, and the lead of the policy that knows it."""
    played = rows_by_firing(rows)
    cells = {firing: PlayCells(own) for firing, own in played.items()}
    every = [row for own in played.values() for row in own]
    tags = {policy_of(row): tags_of_row(row) for row in every}
    keys = sorted(dict.fromkeys(map(key_of, every)), key=lambda key: (key[0], key[2]))
    return [
        table
        for setting in dict.fromkeys(key[0] for key in keys)
        for ratio in (FIRST_SIGHTING, OVERALL)
        for table in _tables_of(
            ratio,
            f"{setting.label}: {ratio.name}",
            cells,
            [key for key in keys if key[0] == setting],
            tags,
        )
    ]


def _tables_of(
    ratio: Ratio,
    title: str,
    cells: dict[str, PlayCells],
    keys: Sequence[Key],
    tags: dict[str, tuple[str, ...]],
) -> list[Table]:
    def level(firing: str, key: Key) -> str:
        return written(ratio, cells[firing].level(ratio, key))

    def lead(firing: str, key: Key) -> str:
        setting, _, budget = key
        return interval(cells[firing].difference(ratio, (setting, AWARE, budget), key))

    return tables_by_firing(Shown(title, "%", "points"), cells, keys, tags, level, lead)
