"""Sources of films: generated streets, Argoverse 2 logs and nuScenes databases."""
