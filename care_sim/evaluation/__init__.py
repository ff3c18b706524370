"""Scoring: pure functions of what an episode recorded."""
