"""The wrappers. Some make an environment easier to learn in: `SectorReserve`, `SectorScores` and
`GridObservation`, each with tables of its action and observation, and the same over vector
environments, whose names begin with `Vector`. The others watch an episode and leave it as it is:
`RecordRerun` and `ExportScans`.
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
