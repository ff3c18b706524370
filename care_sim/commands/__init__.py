"""The commands of `care-sim`, one file per command."""
