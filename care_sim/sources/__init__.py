"""Where films come from: generated streets, Argoverse 2 logs and nuScenes databases."""
