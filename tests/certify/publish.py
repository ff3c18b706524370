"""Publish the list of the certificate anew: `python -m tests.certify.publish`, some minutes."""

import sys

from care_sim.base.limits import WORKERS
from care_sim.certify import ALL_EPISODES, playing, published
from care_sim.certify.design import drawn


def main():
    """Play all episodes and write their trails, unless one of them was not played."""
    _, lacking = playing.playable_here([drawn(number) for number in range(ALL_EPISODES)])
    if lacking:
        return lacking
    found = playing.trails_of(range(ALL_EPISODES), WORKERS)
    for number, trail in found.items():
        if isinstance(trail, str):
            return f"nothing is written: episode {number} was not played: {trail}"
    trails = [trail for _, trail in sorted(found.items())]
    published.write(trails)
    print(f"{len(trails):,} episodes: {published.combined(trails)}, published")
    return 0


if __name__ == "__main__":
    sys.exit(main())
