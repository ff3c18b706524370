"""The policies of the paper, a family per file."""
