"""The detector that sees points only: remove the road, group points, fit boxes, tell classes."""
