"""Recordings of episodes that the Rerun viewer plays; the one package that imports Rerun, and only
while it records.
"""
