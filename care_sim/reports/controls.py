"""Names of the report engine under their former path, until every room imports them from there."""

from care_sim.reports.engine.controls import (
    BEST_CONTROL,
    IN_HINDSIGHT,
    best_control,
    is_control,
    named_by_budget,
)

__all__ = ["BEST_CONTROL", "IN_HINDSIGHT", "best_control", "is_control", "named_by_budget"]
