"""Policies with trained weights, and what they see of a belief."""
