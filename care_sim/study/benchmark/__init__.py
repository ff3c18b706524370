"""The benchmark: which worlds it plays, its result file, and playing one again."""
