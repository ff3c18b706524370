"""The car's own software: the fixed braking controller and its odometry."""
