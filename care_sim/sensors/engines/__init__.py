"""Engines that answer rays and pictures: Bullet, and the compiled one."""
