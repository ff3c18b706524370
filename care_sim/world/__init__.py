"""The simulated world: bodies in PyBullet, road and traffic from highway-env, walking people."""
