"""The certificate on a processor without AVX-512."""

import json
import subprocess
import sys

from care_sim.certify.playing import trails_of
from tests.helpers.places import ROOT
from tests.helpers.processor_features import without_avx512


def trails_elsewhere(numbers, workers, code):
    """The trails of episodes as such a processor plays them; `code` is a folder for its code."""
    child = subprocess.run(
        [sys.executable, "-m", "tests.certify.elsewhere", str(workers)],
        cwd=ROOT,
        env=without_avx512(code),
        input=json.dumps(numbers),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    told = json.loads(child.stdout.splitlines()[-1])
    return {int(number): bytes.fromhex(trail) for number, trail in told.items()}


if __name__ == "__main__":
    asked, processes = json.load(sys.stdin), int(sys.argv[1])
    print(json.dumps({n: trail.hex() for n, trail in trails_of(asked, processes).items()}))
