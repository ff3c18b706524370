"""Training on truth: detections of cells, boxes and tracks, and the places of bodies."""
