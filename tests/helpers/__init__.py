"""Helpers that several tests share: logs, databases, rows, processes."""
