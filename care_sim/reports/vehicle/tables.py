"""All tables of the vehicle study in their order."""

from collections.abc import Sequence

from care_sim.reports.table import Table
from care_sim.reports.vehicle.evidence_tables import compensation_table, evidence_table
from care_sim.reports.vehicle.fallback_tables import cost_tables, fallback_table
from care_sim.reports.vehicle.pose_tables import forecast_table, guard_table, pose_tables
from care_sim.reports.vehicle.rows import VehicleRows
from care_sim.study.run_config import Row


def vehicle_tables(rows: Sequence[Row]) -> list[Table]:
    """Evidence, the camera that fails, the pose, the guard."""
    study = VehicleRows(rows)
    return [
        evidence_table(study),
        compensation_table(study),
        fallback_table(study),
        *cost_tables(study),
        forecast_table(study),
        *pose_tables(study),
        guard_table(study),
    ]
