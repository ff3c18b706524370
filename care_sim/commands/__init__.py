"""The commands of `care-sim`, a file each."""
