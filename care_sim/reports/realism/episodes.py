"""Realism in the closed loop under its former names, until every room uses the study."""

from collections.abc import Sequence

from care_sim.reports.closings import collisions
from care_sim.reports.realism.study import RealismStudy as RealismEpisodes
from care_sim.reports.realism.tables import realism_tables, verdict_sentences
from care_sim.study.run_config import Row

__all__ = ["RealismEpisodes", "realism_closing", "realism_tables"]


def realism_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and how many orders hold."""
    return [collisions(rows), *verdict_sentences(rows)]
