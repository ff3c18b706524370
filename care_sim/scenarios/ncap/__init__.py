"""The Euro NCAP tests of emergency braking: their numbers, and the world of each at a speed."""

from care_sim.scenarios.ncap.scenario import Ncap

__all__ = ["Ncap"]
