"""Logs without labels: LiDAR sweeps and poses of the car, annotated by a detector."""
