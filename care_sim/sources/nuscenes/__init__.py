"""nuScenes v1.0 databases, read without the devkit (Caesar et al. 2020, "nuScenes: A multimodal
dataset").
"""
