"""Hardware of a LiDAR: how much of a demand it can fire. A family of hardware per file."""
