"""Foundations of every room: errors, bounds, files, processes, random streams. Nothing here knows
LiDAR.
"""
