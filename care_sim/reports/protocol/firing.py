"""The hardware of the open loop under its former name, until every room uses the engine."""

from care_sim.reports.tables.firing import firing_tables

__all__ = ["firing_tables"]
