"""Training of learned policies: `care-sim train`."""
