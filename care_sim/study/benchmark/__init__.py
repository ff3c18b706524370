"""The official suite: which worlds it plays, its result file, and playing one again."""
