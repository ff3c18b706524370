"""How fast the simulator is on this machine, beside known engines and environments: `make bench`."""
