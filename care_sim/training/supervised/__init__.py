"""Training on truth: what cells, boxes and tracks would have found, and where bodies stood."""
