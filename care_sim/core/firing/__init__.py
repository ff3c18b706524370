"""What the hardware of a LiDAR can fire of a demand, one kind of hardware a file."""
