"""Realism in the open loop under its former names, until every room uses the study."""

from care_sim.reports.protocol.closing import protocol_closing as realism_closing
from care_sim.reports.realism.study import RealismStudy as RealismPlays
from care_sim.reports.realism.tables import realism_tables

__all__ = ["RealismPlays", "realism_closing", "realism_tables"]
