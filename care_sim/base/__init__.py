"""What every room stands on: errors, bounds, files, processes, random streams. Nothing here knows
LiDAR.
"""
