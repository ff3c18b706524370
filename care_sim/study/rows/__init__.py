"""Rows of a study: their columns and their files."""
