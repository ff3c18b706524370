"""The policies of the paper, one a file."""
