"""Observations: their bounds, and those of many worlds as one table."""
