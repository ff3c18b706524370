"""How fast the simulator is here, beside known engines and environments: `make bench`."""
