"""LiDAR and camera: what of the world reaches perception."""
