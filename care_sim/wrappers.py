"""Wrappers: of some that make an environment one to learn in, each documents its action and observation in a table;
others watch an episode.
"""

from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.grid_observation import GridObservation
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores

__all__ = ["ExportScans", "GridObservation", "RecordRerun", "SectorReserve", "SectorScores"]
