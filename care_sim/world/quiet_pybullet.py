"""PyBullet, imported without the build time that it prints on standard error."""

from care_sim.base.quiet_output import STANDARD_ERROR, silenced

with silenced(STANDARD_ERROR):
    import pybullet

__all__ = ["pybullet"]
