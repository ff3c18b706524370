"""`care-sim certify`: whether this machine plays a list of episodes as it was published.

The list is in `design`, how it is played in `playing`, what of an episode is hashed in `trail`. The
published trails are `published.parquet`, which `published` reads.
"""

ALL_EPISODES = 10_000
CERTIFIED_EPISODES = 3_600
"""Episodes played by default. With 38 policies the last pair meets in number 3,559."""
