"""Recorded drives as films: Argoverse 2 logs and nuScenes databases."""
