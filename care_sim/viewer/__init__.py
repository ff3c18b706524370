"""Recordings for the Rerun viewer. Only this package imports Rerun, and only while it records."""
