"""Rows of a study: what their columns hold and mean, and their files."""
