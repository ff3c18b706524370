"""The wrappers. Some make an environment easier to learn in: `SectorReserve`, `SectorScores` and
`GridObservation`, each with tables of its action and observation. The others watch an episode and
leave it as it is: `RecordRerun` and `ExportScans`.
"""

from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.grid_observation import GridObservation
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores

__all__ = ["ExportScans", "GridObservation", "RecordRerun", "SectorReserve", "SectorScores"]
