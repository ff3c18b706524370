"""Policies of this project: causal, without learning and truth, one idea per file."""
