"""Cells of the grid: which a body covers, sets of them, and their order."""
