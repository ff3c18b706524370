"""How fast the benchmark is on this machine: `care-sim bench`."""
