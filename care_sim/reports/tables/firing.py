"""What the hardware does to first detections, or to recall."""

from collections.abc import Sequence

from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import Measure, Recall, loop_of
from care_sim.reports.engine.tables import condition_table, setting_blocks
from care_sim.reports.formatting import interval
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row


def firing_tables(rows: Sequence[Row]) -> list[Table]:
    """The levels of all cells by hardware, and the lead of the policy that knows its hardware over
    the other policies at the same budget.
    """
    frames = {firing: Frame(own) for firing, own in rows_by_firing(rows).items()}
    found = dict.fromkeys(key for frame in frames.values() for key in frame.groups)
    keys = sorted(found, key=lambda key: (key[0], key[2]))
    tags = {
        policy: frame.tags[policy] for frame in frames.values() for _, policy, _ in frame.groups
    }

    def told(firing: str, measure: Measure | Recall, key: Key) -> str:
        return level(measure, frames[firing].units(measure, key))

    def lead(firing: str, measure: Measure | Recall, key: Key) -> str:
        setting, _, budget = key
        return interval(frames[firing].contrast(measure, (setting, AWARE, budget), key))

    loop = loop_of(rows)
    title = f"{loop.shown} by hardware"
    tables = [
        condition_table(
            f"{title}, {loop.level_unit}", [*frames], setting_blocks(keys, loop), tags, told
        )
    ]
    others = [key for key in keys if key[1] not in (AWARE, FULL)]
    if AWARE in tags and others:
        title = f"{title}, {AWARE} minus each, {loop.difference_unit}"
        tables.append(condition_table(title, [*frames], setting_blocks(others, loop), tags, lead))
    return tables
