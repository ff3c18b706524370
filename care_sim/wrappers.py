"""The wrappers. Three make learning easier: `SectorReserve`, `SectorScores` and `GridObservation`,
each with tables of its action and observation. Their versions for vector environments have names
with `Vector`. The others watch an episode and leave it as it is: `RecordRerun` and `ExportScans`.
"""

from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.grid_observation import GridObservation, VectorGridObservation
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.envs.wrappers.sector_actions import (
    SectorReserve,
    SectorScores,
    VectorSectorReserve,
    VectorSectorScores,
)

__all__ = [
    "ExportScans",
    "GridObservation",
    "RecordRerun",
    "SectorReserve",
    "SectorScores",
    "VectorGridObservation",
    "VectorSectorReserve",
    "VectorSectorScores",
]
