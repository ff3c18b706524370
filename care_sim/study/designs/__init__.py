"""The configurations of the published studies."""
