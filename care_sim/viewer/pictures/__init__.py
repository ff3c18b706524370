"""Pictures of keyframes and clips of episodes."""
