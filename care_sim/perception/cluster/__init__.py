"""The detector that sees points only: road removed, points grouped, boxes fitted, classes by size."""
