"""What the hardware does to first detections, or to recall."""

from collections.abc import Sequence

from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.varied import Varied
from care_sim.reports.table import Table
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.run_config import Row


def firing_tables(rows: Sequence[Row]) -> list[Table]:
    """The levels of all cells by hardware, and the lead of the policy that knows its hardware over
    the other policies at the same budget.
    """
    frames = {firing: Frame(own) for firing, own in rows_by_firing(rows).items()}
    varied = Varied("hardware", frames)
    return [varied.levels(), *varied.leads(AWARE)]
