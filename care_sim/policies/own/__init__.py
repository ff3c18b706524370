"""Policies of this project: causal, without learning and without truth, one idea per file."""
