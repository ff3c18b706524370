"""Recordings of episodes that the Rerun viewer plays."""
