"""Generated streets: seeded urban scenes, drawn as pure data.

The open loop films them, the closed one drives through them.
"""
