"""What `care-sim study NAME`, `sweep`, `reproduce` and `protocol` play."""
