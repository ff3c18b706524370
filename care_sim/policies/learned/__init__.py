"""Policies with trained weights, and their inputs from a belief."""
