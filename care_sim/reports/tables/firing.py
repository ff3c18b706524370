"""What the hardware does to first detections on the dense street."""

from collections.abc import Sequence

from care_sim.reports.cells import StudyCells
from care_sim.reports.firing_tables import tables_by_firing
from care_sim.reports.formatting import interval, median
from care_sim.reports.order_tables import Shown
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import Key, key_of
from care_sim.study.run_config import Row


def firing_tables(rows: Sequence[Row]) -> list[Table]:
    """First detections by hardware in every setting, and the lead of the policy that knows it."""
    studies = {firing: StudyCells(own) for firing, own in rows_by_firing(rows).items()}
    played = [row for study in studies.values() for row in study.rows]
    tags = {policy: own for study in studies.values() for policy, own in study.tags.items()}
    keys = sorted(dict.fromkeys(map(key_of, played)), key=lambda key: (key[0], key[2]))

    def level(firing: str, key: Key) -> str:
        cell = studies[firing].cell(key)
        return median(cell.detection) if cell else ""

    def lead(firing: str, key: Key) -> str:
        setting, _, budget = key
        return interval(studies[firing].difference((setting, AWARE, budget), key))

    return [
        table
        for setting in dict.fromkeys(key[0] for key in keys)
        for table in tables_by_firing(
            Shown(f"{setting.label}: first detection", "median, m", "m"),
            studies,
            [key for key in keys if key[0] == setting],
            tags,
            level,
            lead,
        )
    ]
