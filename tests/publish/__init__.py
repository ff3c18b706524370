"""Publish the rows of `results/data` anew: `make publish`."""
