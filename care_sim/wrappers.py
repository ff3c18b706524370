"""Wrappers: of some that make an environment one to learn in, each documents its action and observation in a table;
others watch an episode.
"""

from care_sim.envs.export_scans import ExportScans
from care_sim.envs.grid_observation import GridObservation
from care_sim.envs.sector_actions import SectorReserve, SectorScores
from care_sim.viewer.wrapper import RecordRerun

__all__ = ["ExportScans", "GridObservation", "RecordRerun", "SectorReserve", "SectorScores"]
