"""What the vehicle study (paper, Sec. 5.5) notes of an episode of the closed loop."""
