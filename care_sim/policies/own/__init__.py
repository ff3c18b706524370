"""Policies of this project: causal, without learning and without truth, an idea per file."""
