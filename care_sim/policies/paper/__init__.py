"""The policies of the paper, one family per file."""
