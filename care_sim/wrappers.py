"""Wrappers that make an environment one to learn in; each documents its action and observation in a table."""

from care_sim.envs.grid_observation import GridObservation
from care_sim.envs.sector_actions import SectorReserve, SectorScores

__all__ = ["GridObservation", "SectorReserve", "SectorScores"]
