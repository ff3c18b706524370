"""Publish the list of the certificate anew: `python -m tests.certify.publish` (takes half an hour,
on a processor with AVX-512).
"""

import sys
import tempfile

from care_sim.base.limits import WORKERS
from care_sim.certify import ALL_EPISODES, playing, published
from care_sim.certify.design import drawn
from tests.certify.elsewhere import trails_elsewhere
from tests.helpers.processor_features import WIDE


def main():
    """Play all episodes and write their trails, unless one of them was not played."""
    if not WIDE:
        return "nothing is played: this processor has no AVX-512"
    numbers = [*range(ALL_EPISODES)]
    _, lacking = playing.playable_here([drawn(number) for number in numbers])
    if lacking:
        return lacking
    found = playing.trails_of(numbers, WORKERS)
    with tempfile.TemporaryDirectory() as code:
        there = trails_elsewhere(numbers, WORKERS, code)
    for number, trail in [*found.items(), *there.items()]:
        if isinstance(trail, str):
            return f"nothing is written: episode {number} was not played: {trail}"
    trails = [found[number] for number in numbers]
    narrow = {number: trail for number, trail in there.items() if trail != found[number]}
    published.write(trails, narrow)
    print(f"{len(trails):,} episodes: {published.combined(trails)}, published")
    print(f"{len(narrow):,} of them go otherwise without AVX-512")
    return 0


if __name__ == "__main__":
    sys.exit(main())
