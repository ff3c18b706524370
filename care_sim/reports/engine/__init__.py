"""The report engine: rows of either loop as cells, the levels of cells, and their contrasts."""
