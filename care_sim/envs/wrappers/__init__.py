"""Wrappers around the environments; `care_sim.wrappers` is their public door."""
