"""The closed and the open loop: one keyframe after another, and what is true about each."""
