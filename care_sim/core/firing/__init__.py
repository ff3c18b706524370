"""What the hardware of a LiDAR can fire of a demand, a family of hardware a file."""
