"""The policies of the paper, one per file."""
