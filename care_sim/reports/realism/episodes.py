"""Realism in the closed loop under its former names, until every room uses the study."""

from care_sim.reports.closings import episodes_closing as realism_closing
from care_sim.reports.realism.study import RealismStudy as RealismEpisodes
from care_sim.reports.realism.tables import realism_tables

__all__ = ["RealismEpisodes", "realism_closing", "realism_tables"]
