"""All tables of the mechanism in their order, and how much was played."""

from collections.abc import Sequence

from care_sim.base.errors import counted
from care_sim.reports.mechanism.account_tables import credit_table, misses_table, order_table
from care_sim.reports.mechanism.belief_tables import allocation_table, belief_table
from care_sim.reports.mechanism.rows import MechanismRows
from care_sim.reports.table import Table
from care_sim.study.run_config import Row


def mechanism_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables: first those of the shared belief, then those of separate plays."""
    study = MechanismRows(rows)
    # Everything is compared with the driver or belongs to a policy: full scans alone show nothing.
    if study.driver not in study.policies:
        return []
    return [
        belief_table(study),
        allocation_table(study),
        order_table(study),
        credit_table(study),
        misses_table(study),
    ]


def mechanism_closing(rows: Sequence[Row]) -> list[str]:
    """How much was played."""
    study = MechanismRows(rows)
    return [
        f"Scenes: {len(study.scenes):,}, with {counted(study.events, 'first sighting')}; plays: "
        f"{len(rows):,}."
    ]
